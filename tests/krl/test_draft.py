"""A program that is written while its motion is planned: the same bytes, and what is found later counts."""

from dataclasses import replace

import pytest

from gcode2krl import load_cell, read_gcode, set_targets, write_krl
from gcode2krl.compiled.threads import THREADS_VARIABLE
from gcode2krl.errors import Issue, NotUnderstoodError, RefusedError
from gcode2krl.pipeline import forecast_begun, forecast_toolpath
from gcode2krl.translation import Order, carry_out
from tests.krl.conftest import PART

FOUND = Issue("error", "corner-tolerance", 12, "found on the way", "")


@pytest.fixture
def begun(tmp_path):
    part = tmp_path / "part.nc"
    part.write_text(PART, encoding="ascii")
    cell = load_cell()
    toolpath = read_gcode(part, cell)
    return forecast_begun(toolpath, cell, set_targets(toolpath, cell))


def completed(begun, *issues):
    forecast = forecast_toolpath(begun.toolpath, begun.cell, begun.targets, forces=False)
    return replace(forecast, issues=(*forecast.issues, *issues))


def test_one_thread_and_two_write_the_same(begun, tmp_path, monkeypatch):
    written = []
    for threads in ("1", "2"):
        monkeypatch.setenv(THREADS_VARIABLE, threads)
        carry_out(Order(tmp_path / "part.nc", tmp_path / "out.src", no_forces=True))
        written.append((tmp_path / "out.src").read_bytes())
        (tmp_path / "out.src").unlink()
    assert written[0] == written[1]
    monkeypatch.setenv(THREADS_VARIABLE, "2")
    whole = write_krl(completed(begun), tmp_path / "out.src")
    assert whole.texts["OUT.src"].count(b"LIN ") == written[0].count(b"LIN ")


def test_the_draft_is_the_program_where_nothing_else_is_found(begun, tmp_path, monkeypatch):
    monkeypatch.setenv(THREADS_VARIABLE, "2")
    seen = []

    def complete():
        seen.append(sorted(file.name for file in tmp_path.iterdir()))
        return completed(begun)

    program = write_krl(begun, tmp_path / "out.src", complete=complete)
    assert len(seen) == 1
    assert not any(name.endswith(".src") for name in seen[0])
    assert program.texts["OUT.src"] == write_krl(completed(begun), tmp_path / "out.src").texts["OUT.src"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out.dat", "out.src", "part.nc"]


def test_what_is_found_on_the_way_refuses_the_program(begun, tmp_path, monkeypatch):
    monkeypatch.setenv(THREADS_VARIABLE, "2")
    with pytest.raises(RefusedError, match="found on the way"):
        write_krl(begun, tmp_path / "out.src", complete=lambda: completed(begun, FOUND))
    assert [file.name for file in tmp_path.iterdir()] == ["part.nc"]


def test_a_release_of_what_is_found_on_the_way_stands_in_the_header(begun, tmp_path, monkeypatch):
    monkeypatch.setenv(THREADS_VARIABLE, "2")
    program = write_krl(
        begun,
        tmp_path / "out.src",
        allow=["corner-tolerance"],
        complete=lambda: completed(begun, FOUND),
    )
    assert b"corner-tolerance (whole file, 1)" in program.texts["OUT.src"]
    assert program.report.ok


def test_an_error_of_the_planning_leaves_no_file(begun, tmp_path, monkeypatch):
    monkeypatch.setenv(THREADS_VARIABLE, "2")

    def fails():
        raise NotUnderstoodError([Issue("error", "option-value", 0, "no motion", "")])

    with pytest.raises(NotUnderstoodError, match="no motion"):
        write_krl(begun, tmp_path / "out.src", complete=fails)
    assert [file.name for file in tmp_path.iterdir()] == ["part.nc"]
