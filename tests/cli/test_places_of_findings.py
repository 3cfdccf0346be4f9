"""Where a finding is, for a machine that reads it and for a person who releases it."""

import json

import pytest

from gcode2krl.result.model import Record

MAIN = "G21 G90 G17\nT1 M6\nS9000 M3\nG0 X0 Y0\no<side> call\nG0 Z50\nX50\nG1 Z40 F900\nG0 Z50\nM5\nM2\n"
SIDE = "o<side> sub\n(the length of another tool)\nG43 H2\no<side> endsub\nM2\n"


@pytest.fixture
def part(tmp_path):
    (tmp_path / "side.ngc").write_text(SIDE)
    (tmp_path / "part.ngc").write_text(MAIN)
    return tmp_path / "part.ngc"


def record_of(run, *words):
    record = json.loads(run(*words, "--json").out)
    Record.model_validate(record)
    return record


def test_the_column_of_a_finding(run, tmp_path):
    (tmp_path / "part.nc").write_text("G21\nG0 X0 Y0 Z5\nG1 X5 F100 Q3\nM2\n")
    (found,) = [i for i in record_of(run, "part.nc", "-o", "part.src")["issues"] if i["severity"] == "error"]
    assert (found["line"], found["column"], "file" in found) == (3, 12, False)


def test_a_finding_in_a_subprogram_has_its_file_and_the_line_there(run, part):
    issues = record_of(run, "part.ngc", "-o", "part.src")["issues"]
    (found,) = [issue for issue in issues if issue["code"] == "h-differs"]
    assert (found["file"], found["line"], found["severity"]) == ("side.ngc", 3, "error")


@pytest.mark.parametrize(
    ("word", "code"),
    [
        ("h-differs:side.ngc:3", 0),
        ("h-differs:side.ngc:2", 1),
        ("h-differs:part.ngc:3", 1),
        ("h-differs:3", 1),
    ],
)
def test_it_is_released_by_file_and_line(run, part, word, code):
    releases = ("--allow", word, "--allow", "g43-missing")
    outcome = run("part.ngc", "-o", "part.src", *releases, code=code)
    if code == 0:
        assert "h-differs:side.ngc:3" in (part.parent / "part.src").read_text()
    else:
        assert "error: H2 while tool 1 is in the spindle (in side.ngc line 3)" in outcome.err
