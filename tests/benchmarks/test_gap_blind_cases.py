"""Seeds of the check, its parts, and the records that it resumes from."""

import json
from collections import Counter
from importlib import import_module

import pytest

from tests.benchmarks import hand_made

cases = import_module("blind.cases")
workers = import_module("blind.cases")
blind = import_module("blind.check")


def test_blocks_of_seeds_never_mix():
    some = cases.plan(1, {"null": 3, "single": 5, "pair": 2, "deleted": 1, "missing": 2})
    more = cases.plan(1, {"null": 9, "single": 50, "slip": 7, "pair": 2, "deleted": 1, "missing": 4})
    assert set(some) <= set(more)
    assert len({case.seed for case in more}) == len(more)
    assert max(case.seed for case in more) < cases.SCORED_FROM


def test_no_call_has_seeds_on_both_sides():
    last = cases.SCORED_FROM - len(cases.KINDS) * cases.BLOCK
    assert cases.plan(last, {"null": 1})[0].seed == last
    for seed in (last + 1, cases.SCORED_FROM - 1):
        with pytest.raises(ValueError, match="calibration"):
            cases.plan(seed, {"null": 1})
    assert cases.plan(cases.SCORED_FROM, {"null": 1})[0].seed == cases.SCORED_FROM


def test_what_is_asked_for_must_exist():
    with pytest.raises(ValueError, match="no effect blacklash"):
        cases.plan(1, {"single": 1}, ["blacklash"])
    with pytest.raises(ValueError, match="at most 1000"):
        cases.plan(1, {"null": 1001})


def test_the_whole_check_has_what_was_promised():
    counts = cases.full_counts()
    nulls = sum(counts[kind] for kind in cases.NULLS)
    assert nulls >= 500
    assert counts["null_foreign_noise"] >= nulls / 5
    assert counts["null_foreign_mismatch"] >= nulls / 5
    assert (counts["single"], counts["pair"], counts["open"]) == (600, 220, 500)
    planned = cases.plan(1, counts)
    deleted = Counter(case.without for case in planned if case.kind == "deleted")
    assert {without[0] for without in deleted} == set(cases.simulated())
    assert min(deleted.values()) >= 10
    other = sum(case.form == "other" for case in planned if case.kind == "single")
    assert other >= 600 / 3


def test_what_the_library_has_is_not_outside_it(monkeypatch):
    monkeypatch.setattr(cases, "UNKNOWN", {"backlash": None, "cable_snag": None})
    asked = {case.effect for case in cases.plan(1, {"open": 4})}
    assert asked == {"open:cable_snag"}


def test_a_check_that_is_cut_short_has_some_of_each_kind():
    counts = {"null": 6, "single": 12, "pair": 3}
    planned = cases.plan(1, counts)
    mixed = cases.in_turn(planned)
    assert sorted(mixed, key=planned.index) == planned
    for cut in (7, 14, 21):
        had = Counter(case.kind for case in mixed[:cut])
        assert had == {kind: count * cut // 21 for kind, count in counts.items()}


def test_no_case_begins_after_its_time(monkeypatch):
    now = iter(range(100))
    monkeypatch.setattr(workers.time, "monotonic", lambda: next(now))
    asked = [(number,) for number in range(10)]
    assert list(workers.in_processes(lambda number: number, asked, 1, 4.0)) == [0, 1, 2, 3]
    assert list(workers.in_processes(lambda number: number, asked, 1)) == list(range(10))


def test_processes_return_everything_and_stop_in_time():
    asked = [(number,) for number in range(-6, 0)]
    assert sorted(workers.in_processes(abs, asked, 2)) == [1, 2, 3, 4, 5, 6]
    assert list(workers.in_processes(abs, asked, 2, 0.0)) == []


def test_a_record_is_kept_for_its_case_and_its_code(tmp_path):
    case = cases.Case(1001, "single", "backlash", "same")
    record = {"case": {"seed": 1001, "kind": "single", "effect": "backlash", "form": "same"}, "code": "a"}
    workers.store(record, tmp_path)
    assert workers.done(case, tmp_path, "a") == record
    assert workers.done(case, tmp_path, None) == record
    assert workers.done(case, tmp_path, "b") is None
    assert workers.done(cases.Case(1001, "single", "backlash", "other"), tmp_path, "a") is None
    assert workers.done(cases.Case(1002, "single", "backlash", "same"), tmp_path, "a") is None
    assert [file.name for file in (tmp_path / "results").iterdir()] == ["single-01001.json"]


def test_reports_take_records_of_any_code(tmp_path, capsys):
    record = hand_made.record(kind="null") | {"code": "old"}
    record["case"] |= {"effect": "none", "form": None}
    workers.store(record, tmp_path)
    assert blind.main(["--null", "2", "--resume", str(tmp_path), "--only-report"]) == 0
    out = capsys.readouterr().out
    assert "1 of 2 cases from seed 1 (calibration, not to be quoted), code old" in out
    assert "| false alarms, usual noise" in out
    assert blind.main(["--null", "2", "--resume", str(tmp_path), "--only-report", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["exact"]
