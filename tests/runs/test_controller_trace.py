"""Traces: what is read, and the error each wrong input gets, with file, row and column."""

import numpy as np
import polars as pl
import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.runs import (
    ControllerTrace,
    check_scale,
    noise_mm,
    program_rests,
    read_controller_trace,
    resolution_mm,
    standstills,
)

HEADER = "t_s,x_cmd_mm,y_cmd_mm,z_cmd_mm"


def write(folder, rows, header=HEADER):
    file = folder / "trace.csv"
    file.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return file


def rows(count=20):
    return [f"{0.012 * i:.3f},{i}.5,2.0,3.0" for i in range(count)]


def trace_of(position_mm, dt_s=0.012):
    position = np.asarray(position_mm, dtype=float)
    time = np.arange(len(position)) * dt_s
    return ControllerTrace(time, position, np.arange(len(position)) + 2, 0, "trace.csv")


def refused(file):
    with pytest.raises(NotUnderstoodError) as caught:
        read_controller_trace(file)
    assert str(file) in str(caught.value)
    return caught.value.issues[0]


def test_csv_and_parquet_give_the_same(tmp_path):
    file = write(tmp_path, rows(), HEADER)
    other = tmp_path / "trace.parquet"
    pl.read_csv(file).with_columns(pl.lit("x").alias("extra")).write_parquet(other)
    csv, parquet = read_controller_trace(file), read_controller_trace(other)
    assert np.array_equal(csv.time_s, parquet.time_s)
    assert np.array_equal(csv.position_mm, parquet.position_mm)
    assert csv.position_mm.shape == (20, 3)
    assert csv.row[0] == 2
    assert parquet.row[0] == 1


def test_columns_in_any_order_and_others_ignored(tmp_path):
    lines = [f"a,{i}.5,2,3,{0.012 * i:.3f}" for i in range(12)]
    trace = read_controller_trace(write(tmp_path, lines, "note,z_cmd_mm,y_cmd_mm,x_cmd_mm,t_s"))
    assert trace.position_mm[3].tolist() == [3.0, 2.0, 3.5]


def test_missing_values_are_dropped_and_counted(tmp_path):
    lines = rows()
    lines[4], lines[7], lines[9] = "0.048,,2,3", "0.084,nan,2,3", "0.108,1,2,inf"
    trace = read_controller_trace(write(tmp_path, lines))
    assert (len(trace), trace.dropped) == (17, 3)
    assert 6 not in trace.row


def with_row(row, text):
    return [text if k == row else line for k, line in enumerate(rows())]


@pytest.mark.parametrize(
    ("lines", "header", "place", "words"),
    [
        (rows(), "t_s,x_cmd_mm,y_mm,z_cmd_mm", ("trace-column", 1), ["y_cmd_mm: missing", "y_mm"]),
        (with_row(8, "0.010,1,2,3"), HEADER, ("trace-time", 10), ["t_s"]),
        ([f"{12 * i},1,2,3" for i in range(20)], HEADER, ("trace-unit", 3), ["t_s"]),
        (with_row(5, "0.060,1,#ERR,3"), HEADER, ("trace-number", 7), ["y_cmd_mm"]),
        (rows(9), HEADER, ("trace-short", 0), ["9 usable rows"]),
    ],
    ids=["a missing column", "time that falls", "time in ms", "no number", "too few rows"],
)
def test_a_wrong_table_is_named_with_its_place(tmp_path, lines, header, place, words):
    issue = refused(write(tmp_path, lines, header))
    assert (issue.code, issue.line) == place
    assert [word for word in words if word not in issue.message] == []


@pytest.mark.parametrize("content", [b"", b"\x00\xff\xfe\x01", b"PAR1 and then nothing"])
def test_no_table(tmp_path, content):
    file = tmp_path / "trace.csv"
    file.write_bytes(content)
    assert refused(file).severity == "error"


def test_no_file(tmp_path):
    assert refused(tmp_path / "none.csv").code == "file-unreadable"


def test_metres_show_against_the_program():
    program = np.array([[0.0, 0.0, 5.0], [100.0, 80.0, 5.0]])
    steps = np.linspace(0.0, 1.0, 50)[:, None]
    good = trace_of(program[0] + steps * (program[1] - program[0]))
    check_scale(good, program)
    bad = trace_of(good.position_mm * [1.0, 0.001, 1.0])
    with pytest.raises(NotUnderstoodError, match="y_cmd_mm"):
        check_scale(bad, program)


@pytest.mark.parametrize("decimals", [0, 1, 3, 4])
def test_resolution(decimals):
    rng = np.random.default_rng(4)
    assert resolution_mm(np.round(rng.normal(0.0, 30.0, (500, 3)), decimals)) == pytest.approx(
        10.0**-decimals
    )
    assert resolution_mm(rng.normal(0.0, 30.0, (500, 3))) == 0.0


def stop_and_go(rng=None, noise=0.0):
    """Stand 0.3 s, move 5 mm along x in 0.2 s, stand, move back, stand."""
    t = np.arange(0.0, 1.3, 0.012)
    x = 5.0 * (np.clip((t - 0.3) / 0.2, 0.0, 1.0) - np.clip((t - 0.8) / 0.2, 0.0, 1.0))
    position = np.stack([x, np.zeros_like(t), np.full_like(t, 7.0)], axis=1)
    return trace_of(position + (rng.normal(0.0, noise, position.shape) if noise else 0.0))


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.02])
def test_standstills_and_noise(noise):
    trace = stop_and_go(np.random.default_rng(5), noise)
    assert noise_mm(trace) == pytest.approx(noise, rel=0.35, abs=1e-6)
    found = standstills(trace, 0.1, 8.0 * noise + 0.001)
    assert len(found) == 3
    assert np.abs(trace.time_s[found] - [[0.0, 0.3], [0.5, 0.8], [1.0, 1.296]]).max() <= 0.013


def test_motion_at_the_ends_of_a_trace_counts_as_ends():
    trace = stop_and_go()
    middle = trace_of(trace.position_mm[30:80])
    found = standstills(middle, 0.1, 0.001)
    assert found[0].tolist() == [0, 0]
    assert found[-1].tolist() == [49, 49]


def test_sections_before_the_program_are_left_out():
    trace = stop_and_go()
    here, there = [0.0, 0.0, 7.0], [5.0, 0.0, 7.0]
    rests, others = program_rests(trace, np.array([there, here]), np.array([4, 4]), 0.1)
    assert (len(rests), others) == (2, 1)
    with pytest.raises(NotUnderstoodError, match=r"2 sections between standstills, the program 3; it ends"):
        program_rests(trace, np.array([here, there, here, there]), np.array([4, 5, 6, 6]), 0.1)
    with pytest.raises(NotUnderstoodError, match=r"differ at standstill 3 \(G-code line 6\)"):
        program_rests(trace, np.array([here, there, [9.0, 0.0, 7.0]]), np.array([4, 5, 6]), 0.1)
    with pytest.raises(NotUnderstoodError, match=r"shifted .* \(-?0.00\d, -3.000, 0.000\)"):
        program_rests(trace, np.add([here, there, here], [0, 3, 0]), np.array([4, 5, 6]), 0.1)
