"""The lines of results.jsonl: sorted, deterministic, read back."""

import json

from gcode2krl.batch.written import records_of, results_jsonl
from tests.batch.written.records import NASTY, many, record


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
