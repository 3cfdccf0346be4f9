"""The lines of results.jsonl: sorted, deterministic, read back."""

import json

import pytest

from gcode2krl.batch.written import contents, records_of, results_jsonl
from gcode2krl.batch.written.part import part_of, parts_of
from tests.batch.written.records import ERROR, NASTY, NOTE, OF_CELL, WARNING, many, record


def test_lines_are_sorted_and_hold_the_records():
    records = many(40)
    lines = results_jsonl(records).decode("ascii").splitlines()
    parts = [json.loads(line)["part"] for line in lines]
    assert parts == sorted(one["part"] for one in records)
    assert {one["part"]: one for one in map(json.loads, lines)} == {one["part"]: one for one in records}


def test_the_order_of_records_and_keys_does_not_matter():
    records = many(20)
    turned = [dict(reversed(one.items())) for one in reversed(records)]
    assert results_jsonl(turned) == results_jsonl(records)


def test_the_last_record_of_a_part_counts():
    written = read([record("a.nc", 1), record("b.nc"), record("a.nc", 0)])
    assert [(one["part"], one["exit_code"]) for one in written] == [("a.nc", 0), ("b.nc", 0)]


def test_what_json_cannot_hold_is_null():
    (found,) = read([record("a.nc", time_s=float("inf"), thumbnail=[[float("nan"), 1.0], (2.0, 3.0)])])
    assert found["time_s"] is None
    assert found["thumbnail"] == [[None, 1.0], [2.0, 3.0]]


def test_names_of_any_bytes_come_back():
    (found,) = read([record(NASTY)])
    assert found["part"] == NASTY


def read(records):
    return [json.loads(line, parse_constant=refused) for line in results_jsonl(records).splitlines()]


def refused(word):
    raise AssertionError(word)


def test_a_line_that_is_no_record_is_left_out():
    whole = results_jsonl(many(3))
    assert len(records_of(whole + b'{"part": "half.nc", "exit_c')) == 3
    assert len(records_of(whole + b'7\n[]\n\xff\n{"part": "d.nc"}\n')) == 4
    assert records_of(b"") == []


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
