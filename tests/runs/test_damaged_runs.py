"""Run folders made to harm: one line, and no memory allocated for what a file announces."""

import numpy as np
import polars as pl
import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.runs import load_run
from tests.runs import maker


def refused(folder, *words, capfd=None):
    with pytest.raises(NotUnderstoodError) as caught:
        load_run(folder)
    assert len(str(caught.value).splitlines()) == 1
    assert str(folder) in str(caught.value)
    for word in words:
        assert word in str(caught.value)


@pytest.fixture
def folder(tmp_path):
    return maker.run_folder(tmp_path / "run", tracker=maker.tracker())


@pytest.mark.parametrize(
    "text",
    ["a = " + "[" * 100_000, "a." * 100_000 + "a = 1", "[a" + ".a" * 100_000 + "]", "# " + "x" * 17_000_000],
    ids=["arrays", "names", "header", "large"],
)
def test_a_head_that_is_nested_or_huge(folder, text):
    (folder / "run.toml").write_text(text)
    refused(folder, "run.toml")


@pytest.mark.parametrize("name", ["x" * 5000, "a\\u0000b"])
def test_a_file_name_that_no_system_takes(folder, name):
    (folder / "run.toml").write_text(f'[files]\nforce = "{name}"\n')
    refused(folder, "files.force", "no file")


@pytest.mark.parametrize("key", ["cell", "program", "prediction"])
def test_a_path_that_no_system_takes_leads_nowhere(folder, key):
    (folder / "run.toml").write_text(f'{key} = "{"x" * 5000}"\n')
    (found,) = [issue for issue in load_run(folder).issues if issue.code == "run-path"]
    assert len(found.message) < 200


@pytest.mark.parametrize("rows", [2**40, 2**58])
def test_a_table_that_announces_exabytes(folder, rows):
    from tests.prediction.test_damaged import announce

    frame = pl.DataFrame({"t_s": np.arange(5000) * 0.004} | {f"f{a}_N": np.arange(5000) * 1.0 for a in "xyz"})
    frame.write_parquet(folder / "force.parquet")
    announce(folder / "force.parquet", rows)
    refused(folder, "force.parquet", "damaged")


@pytest.mark.parametrize("value", [1e300, -1e300, 1e20])
@pytest.mark.parametrize("column", ["t_s", "fx_N"])
def test_a_value_that_nothing_measures(folder, capfd, column, value):
    columns = maker.force()
    columns[column] = columns[column].copy()
    columns[column][7] = value
    maker.write(folder, "force.csv", columns)
    refused(folder, "row 9", column, "not a measured value")
    assert capfd.readouterr().err == ""


def test_a_scan_out_of_this_world(folder):
    points = {f"{a}_mm": np.arange(60.0) for a in "xyz"}
    points["y_mm"][3] = 1e30
    maker.write(folder, "scan.csv", points)
    refused(folder, "scan.csv", "point 4")


def test_names_of_columns_that_are_no_text(folder):
    frame = pl.DataFrame({"a\nb\x00c": np.arange(20.0), "d" * 4000: np.arange(20.0)})
    frame.write_parquet(folder / "force.parquet")
    refused(folder, "a?b?c", "missing")
