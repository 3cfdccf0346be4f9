"""Records of other versions, or damaged ones, are read as far as they go."""

import pytest

from gcode2krl.batch.written import contents
from gcode2krl.batch.written.part import part_of, parts_of
from tests.batch.written.records import ERROR, NASTY, NOTE, OF_CELL, WARNING, record


@pytest.mark.parametrize(
    "damaged",
    [
        {},
        {"part": None, "exit_code": "0", "issues": "none", "thumbnail": 3, "files": None, "seconds": "2"},
        {"part": 7, "exit_code": True, "issues": [None, {}, {"line": "x", "severity": 3}], "time_s": True},
        {"part": "a.nc", "exit_code": 0, "issues": [{"line": -4.5}], "thumbnail": [[1, 2], [3]]},
        {"part": "a.nc", "exit_code": 99, "time_s": float("nan"), "thumbnail": [[0, 0], [float("inf"), 1]]},
        {"part": "a" * 10**5, "exit_code": 1, "thumbnail": [[0, 0], [0, 0]], "files": [3, "x.html"]},
    ],
)
def test_a_damaged_record_is_told_all_the_same(damaged):
    part = part_of(damaged)
    assert part.time_s is None
    assert part.thumbnail in ((), ((0.0, 0.0), (0.0, 0.0)))
    made = contents([damaged, record("good.nc")], [damaged])
    assert all(content.decode("utf-8") for content in made.values())


def test_folder_and_file():
    assert [(part.folder, part.file) for part in parts_of([record("a/b/c.nc"), record("d.nc")])] == [
        ("a/b", "c.nc"),
        (".", "d.nc"),
    ]
    assert part_of(record("a\\b.nc")).name == "a/b.nc"


def test_why_a_part_was_not_written():
    def reasons(exit_code, *issues):
        return [one.issue.code for one in part_of(record("a.nc", exit_code, issues)).reasons()]

    assert reasons(1, WARNING, ERROR, NOTE) == ["out-of-reach"]
    assert reasons(1, WARNING, NOTE) == ["force-high"]  # --strict
    assert reasons(0, WARNING) == []
    assert reasons(2) == []


def test_verdicts():
    verdicts = [part_of({"exit_code": code}).verdict for code in (0, 1, 2, None, -9)]
    assert verdicts == ["written", "refused", "not understood", "not understood", "not understood"]


def test_all_files_are_made_of_nothing_and_of_anything():
    names = {"results.jsonl", "junit.xml", "findings.sarif", "summary.md", "index.html"}
    assert set(contents([])) == names
    issues = [ERROR | {"message": NASTY, "code": NASTY}, OF_CELL]
    once, again = (contents([record(NASTY, 1, issues)], [record(NASTY)]) for _ in range(2))
    assert once == again
