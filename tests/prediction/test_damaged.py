"""A prediction folder that is damaged, or made to harm, is one line, whatever it announces."""

import os
import shutil

import numpy as np
import polars as pl
import pytest

from gcode2krl import Gcode2KrlError, Prediction, predict
from gcode2krl.files.parquet_guard import DamagedError, outline_of, read_parquet

PART = "G21 G90\nT1 M6\nS9000 M3\nM8\nG0 G43 H1 Z30\nX0 Y0\nG1 Z-2 F600\nX20 F1500\nY10\nG0 Z30\nM9\nM30\n"


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    place = tmp_path_factory.mktemp("saved")
    (place / "part.nc").write_text(PART, encoding="ascii")
    predict(place / "part.nc", dt_s=0.02).save(place / "p")
    return place / "p"


@pytest.fixture
def folder(saved, tmp_path):
    shutil.copytree(saved, tmp_path / "p")
    return tmp_path / "p"


def refused(folder, *words):
    """Check that the folder is refused in one line with all words."""
    with pytest.raises(Gcode2KrlError) as caught:
        Prediction.load(folder)
    text = str(caught.value)
    assert len(text.splitlines()) == 1
    assert caught.value.exit_code == 2
    for word in words:
        assert word in text


def varint(number):
    """Return a count as Thrift's compact protocol writes it."""
    number, out = 2 * number, bytearray()
    while number > 127:
        out.append(number & 127 | 128)
        number >>= 7
    return bytes([*out, number])


def announce(file, rows):
    """Let a Parquet file announce another number of rows, wherever its footer has it."""
    data = file.read_bytes()
    length = int.from_bytes(data[-8:-4], "little")
    footer = data[-8 - length : -8]
    there = varint(pl.read_parquet(file).height)
    footer = footer.replace(there, varint(rows))
    file.write_bytes(data[: -8 - length] + footer + len(footer).to_bytes(4, "little") + b"PAR1")


@pytest.mark.parametrize("rows", [2**40, 2**58, 2**62])
def test_a_table_that_announces_exabytes_is_not_believed(tmp_path, rows):
    file = tmp_path / "a.parquet"
    pl.DataFrame({"t_s": np.arange(100_000) * 0.1}).write_parquet(file)
    announce(file, rows)
    with pytest.raises(DamagedError):
        outline_of(file)


@pytest.mark.parametrize("rows", [2**40, 2**58])
def test_a_prediction_that_announces_exabytes_is_one_line(folder, rows):
    announce(folder / "motion.parquet", rows)
    refused(folder, "motion.parquet", "damaged", "predict the part again")


def test_a_constant_table_of_absurd_length_is_refused(tmp_path):
    file = tmp_path / "a.parquet"
    pl.DataFrame({"a": np.zeros(9_000_000)}).write_parquet(file)
    assert os.path.getsize(file) < 100_000  # noqa: PTH202
    with pytest.raises(DamagedError, match="72 MB announced"):
        outline_of(file)


@pytest.mark.slow
def test_a_long_table_of_real_values_is_read(tmp_path):
    file = tmp_path / "a.parquet"
    long = pl.DataFrame(
        {
            "t_s": np.arange(300_000) * 0.012,
            "zero": np.zeros(300_000),
            "name": ["x"] * 300_000,
            "list": [[1, 2]] * 300_000,
        }
    )
    long.write_parquet(file)
    assert outline_of(file).columns["list"] == "nested"
    assert read_parquet(file).equals(long)


@pytest.mark.parametrize("cut", [0, 3, 11, 100, 2000, -1, -5, -9, -60])
def test_a_table_that_is_cut_off(folder, cut):
    file = folder / "toolpath.parquet"
    file.write_bytes(file.read_bytes()[:cut])
    refused(folder, "toolpath.parquet", "damaged")


def test_a_panic_of_the_reader_is_one_line_and_says_nothing_by_itself(tmp_path, monkeypatch, capfd):
    file = tmp_path / "a.parquet"
    pl.DataFrame({"a": [1.0]}).write_parquet(file)

    def panics(*arguments, **options):
        os.write(2, b"thread '<unnamed>' panicked at somewhere\n")
        raise pl.exceptions.PanicException("assertion failed\nmore")

    monkeypatch.setattr(pl, "read_parquet", panics)
    with pytest.raises(DamagedError, match=r"\Aassertion failed\Z"):
        read_parquet(file)
    assert capfd.readouterr().err == ""


CHANGES = {
    "time that falls": (
        "motion",
        lambda f: f.with_columns(time_s=pl.col("time_s").reverse()),
        "does not rise",
    ),
    "time that is no number": ("motion", lambda f: f.with_columns(time_s=pl.lit(np.nan)), "not a number"),
    "a position without end": ("motion", lambda f: f.with_columns(position_x_mm=pl.lit(np.inf)), "infinite"),
    "a move that is not there": (
        "motion",
        lambda f: f.with_columns(move=pl.lit(999, pl.Int32)),
        "Motion.move",
    ),
    "a tool that is not there": ("motion", lambda f: f.with_columns(tool=pl.lit(99, pl.Int32)), "tool 99"),
    "a target of no row": ("targets", lambda f: f.with_columns(move=pl.lit(-2, pl.Int32)), "Targets.move"),
    "no orientation": ("targets", lambda f: f.with_columns(rotation_w=pl.lit(5.0)), "length 1"),
    "another type": ("targets", lambda f: f.with_columns(tool=pl.col("tool").cast(pl.Int64)), "INT64"),
    "a date": ("targets", lambda f: f.with_columns(tool=pl.col("tool").cast(pl.Date)), "Date"),
    "a missing value": ("targets", lambda f: f.with_columns(tool=pl.lit(None, pl.Int32)), "missing"),
    "a missing column": ("toolpath", lambda f: f.drop("axis_x"), "axis_x is missing"),
    "no rows": ("toolpath", lambda f: f.head(0), "no rows"),
    "too few rows": ("toolpath", lambda f: f.head(2), "of 2"),
}


@pytest.mark.parametrize("change", CHANGES, ids=str)
def test_a_whole_table_with_wrong_values(folder, change):
    name, changed, word = CHANGES[change]
    file = folder / f"{name}.parquet"
    changed(pl.read_parquet(file)).write_parquet(file)
    refused(folder, word)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ('severity = "note"', 'severity = "rumour"', "issues.0.severity"),
        ('severity = "note"', 'severity = "note"\nother = 1', "issues.0.other"),
        ("line = 0", 'line = "0"', ".line"),
        ("line = 0", "line = -7", ".line"),
        ("row = 0,", "row = 99999999,", "99999999"),
        ("row = 0,", "row = 99999999999,", "events.0.row"),
        ("tool = 1,", "", "without tool"),
        ("rpm = 9000.0", "rpm = nan", "rpm"),
        ("forces_relative_band", "toolpath_events = 5\nx", "toml"),
        ("forces_relative_band = 0.75", "forces_relative_band = inf", "forces_relative_band"),
        ("dt_s = 0.02", "dt_s = 0", "dt_s"),
        ("dt_s = 0.02", "dt_s = 'fast'", "dt_s"),
    ],
)
def test_a_record_with_wrong_values(folder, old, new, word):
    file = folder / "prediction.toml"
    text = file.read_text(encoding="utf-8")
    assert old in text
    before, inputs = text[: text.index("[inputs]")], text[text.index("[inputs]") :]
    if old in inputs:  # the record before them has some of them too, and nobody reads it
        inputs = inputs.replace(old, new, 1)
    else:
        before = before.replace(old, new, 1)
    file.write_text(before + inputs, encoding="utf-8")
    refused(folder, word)


@pytest.mark.parametrize("key", ["issues", "inputs", "toolpath_events", "cell"])
def test_a_record_without_a_part(folder, key):
    import tomllib

    import tomli_w

    file = folder / "prediction.toml"
    record = tomllib.loads(file.read_text(encoding="utf-8"))
    del record[key]
    file.write_bytes(tomli_w.dumps(record).encode("utf-8"))
    refused(folder, key, "missing")


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 100_000,
        "a = " + "{a = " * 50_000,
        "a." * 100_000 + "a = 1",
        "[a" + ".a" * 100_000 + "]",
        '"a" . ' * 50_000 + "a = 1",
        "\x00",
        "a = 0000-00-00",
        "a = 1" + "0" * 5000,
        "# " + "x" * 17_000_000,
    ],
    ids=["arrays", "tables", "names", "header", "quoted", "nul", "date", "number", "large"],
)
def test_a_record_that_is_nested_or_huge(folder, text):
    (folder / "prediction.toml").write_text(text, encoding="utf-8")
    refused(folder, "prediction.toml")


def test_several_faults_of_the_cell_are_one_line(folder):
    file = folder / "prediction.toml"
    text = file.read_text(encoding="utf-8")
    changed = text.replace("teeth = ", "teeth = -").replace("diameter_mm = ", "diameter_mm = -")
    file.write_text(changed, encoding="utf-8")
    refused(folder, "cell: tool", "more)")


@pytest.mark.parametrize("name", ["toolpath.parquet", "motion.parquet", "prediction.toml"])
def test_a_folder_where_a_file_should_be(folder, name):
    (folder / name).unlink()
    (folder / name).mkdir()
    refused(folder, name)


def test_the_command_says_one_line(run, folder):
    announce(folder / "motion.parquet", 2**58)
    assert len(run("online", "simulate", folder, code=2).err.strip().splitlines()) == 1
