"""Tables as frames of polars, pandas and pyarrow, with their units in memory and in the Parquet files."""

import builtins
import subprocess
import sys
from inspect import isfunction

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from gcode2krl import Gcode2KrlError, Issue
from gcode2krl.exchange import ColumnFrame, Findings, unit_of
from gcode2krl.exchange.views import VIEWS, view

STAGES = ("toolpath", "targets", "motion", "joints", "forces", "deflection")
UNITS = {
    "position_x_mm": "mm",
    "speed_mm_s": "mm/s",
    "acceleration_mm_s2": "mm/s^2",
    "jerk_mm_s3": "mm/s^3",
    "time_s": "s",
    "dwell_s": "s",
    "q6_rad": "rad",
    "qd1_rad_s": "rad/s",
    "spindle_rad_s": "rad/s",
    "force_base_z_N": "N",
    "torque_Nmm": "N*mm",
    "moment_base_x_Nmm": "N*mm",
    "phi_0_rad": "rad",
    "deflection_base_y_mm": "mm",
    "rotation_w": None,
    "sigma_min": None,
    "corner": None,
    "source_line": None,
    "exact_stop": None,
    "tool": None,
}


@pytest.mark.parametrize(("name", "unit"), UNITS.items())
def test_a_unit_is_read_from_the_end_of_the_name(name, unit):
    assert unit_of(name) == unit


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_is_the_same_in_every_library(prediction, stage):
    table = getattr(prediction, stage)
    columns = table.columns()
    arrow = pa.table(table)
    frames = {
        "polars": table.to_polars(),
        "polars from arrow": pl.DataFrame(table),
        "pandas": table.to_pandas(),
        "pyarrow": arrow,
    }
    for library, frame in frames.items():
        names = frame.column_names if library == "pyarrow" else list(frame.columns)
        assert names == list(columns), library
        for name, values in columns.items():
            np.testing.assert_array_equal(np.asarray(frame[name]), values, err_msg=f"{library}: {name}")
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in arrow.schema}
    assert units == {name: unit_of(name) or "" for name in columns}
    assert frames["pandas"].attrs["units"] == {n: unit for n, unit in units.items() if unit} == table.units()


def test_vectors_are_split_as_on_disk(prediction, tmp_path):
    prediction.save(tmp_path / "p")
    for name, stages in (
        ("toolpath", ("toolpath",)),
        ("targets", ("targets",)),
        ("motion", ("motion", "joints", "forces", "deflection")),
    ):
        saved = pl.read_parquet(tmp_path / "p" / f"{name}.parquet")
        beside = {k: v for stage in stages for k, v in getattr(prediction, stage).columns().items()}
        assert saved.columns == list(beside)


def test_the_files_have_the_units_and_every_reader_reads_them(prediction, tmp_path):
    prediction.save(tmp_path / "p")
    for name in ("toolpath", "targets", "motion"):
        file = tmp_path / "p" / f"{name}.parquet"
        table = pq.read_table(file)
        for field in table.schema:
            wanted = {b"unit": unit_of(field.name).encode()} if unit_of(field.name) else None
            assert field.metadata == wanted, field.name
        frame = pl.read_parquet(file)
        assert frame.equals(pl.from_arrow(table))
        read = pd.read_parquet(file)
        assert list(read.columns) == frame.columns
        np.testing.assert_array_equal(read.iloc[:, 0], frame.to_series(0).to_numpy())


def test_arrow_takes_texts_flags_and_empty_tables():
    columns = {
        "name": np.array(["a", "b<", "ü" * 40]),
        "flag": np.array([True, False, True]),
        "n": np.array([1, 2, 3], dtype=np.int32),
        "x_mm": np.array([0.5, np.nan, np.inf]),
    }
    table = pa.table(ColumnFrame(columns))
    assert table["name"].to_pylist() == ["a", "b<", "ü" * 40]
    assert table["flag"].to_pylist() == [True, False, True]
    assert table.schema.field("x_mm").metadata == {b"unit": b"mm"}
    empty = pa.table(ColumnFrame({name: values[:0] for name, values in columns.items()}))
    assert empty.num_rows == 0
    assert empty.schema.field("x_mm").metadata == {b"unit": b"mm"}


def test_a_stream_outlives_its_table_and_the_interpreter_ends_quietly():
    program = (
        "import gc, pyarrow as pa, numpy as np\n"
        "from gcode2krl.exchange import ColumnFrame\n"
        "reader = pa.RecordBatchReader.from_stream(ColumnFrame({'x_mm': np.arange(5.0)}))\n"
        "gc.collect()\n"
        "kept = pa.RecordBatchReader.from_stream(ColumnFrame({'x_mm': np.arange(5.0)}))\n"
        "print(reader.read_all()['x_mm'].to_pylist())\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip() == "[0.0, 1.0, 2.0, 3.0, 4.0]"


def test_pandas_owns_what_it_is_given(prediction):
    frame = prediction.motion.to_pandas()
    frame.loc[0, "time_s"] = -1.0
    assert prediction.motion.time_s[0] == 0.0


def test_without_pandas_one_line_says_what_to_do(prediction, monkeypatch):
    real = builtins.__import__

    def without_pandas(name, *rest, **more):
        if name.split(".")[0] == "pandas":
            raise ModuleNotFoundError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without_pandas)
    with pytest.raises(Gcode2KrlError) as caught:
        prediction.motion.to_pandas()
    assert "pip install pandas" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_findings_are_a_table_and_a_sequence(prediction):
    findings = prediction.findings
    assert tuple(findings) == prediction.issues
    assert findings[0] == prediction.issues[0]
    assert len(findings[:2]) == 2
    frame = findings.to_polars()
    assert frame.columns == ["severity", "code", "line", "message", "remedy"]
    assert frame["line"].to_list() == [issue.line for issue in prediction.issues]
    assert frame["remedy"].to_list() == [issue.advice() for issue in prediction.issues]
    assert pa.table(findings)["code"].to_pylist() == [issue.code for issue in prediction.issues]
    assert len(findings.to_pandas()) == len(prediction.issues)


def test_no_findings_are_an_empty_table():
    nothing = Findings(())
    assert nothing.to_polars().shape == (0, 5)
    assert pa.table(nothing).num_rows == 0
    assert "no findings" in nothing._repr_html_()
    assert repr(Findings([Issue("note", "a", 0, "b")])) == "Findings(1 note)"


@pytest.mark.parametrize("name", VIEWS)
def test_what_shows_a_result_is_there(name):
    assert isfunction(view(name))
