"""Which answers a further run is driven for, which program it is, and when the answer is settled."""

import json
from importlib import import_module
from types import SimpleNamespace

import numpy as np

from tests.benchmarks.hand_made import answer, cause, effect, record

following = import_module("blind.next_run")
canned = import_module("blind.next_run")

TRUTH = ("backlash", "A2")
LEFT_OPEN = [cause(alike=[("hysteresis", "A2")])]


def test_settled_is_the_truth_alone_and_told_from_all_others():
    assert following.is_settled(answer([cause()]), TRUTH)
    for causes in (
        LEFT_OPEN,
        [cause(probability=0.4)],
        [cause(), cause("clock", None)],
        [cause("clock")],
        [],
    ):
        assert not following.is_settled(answer(causes), TRUTH)


def test_only_answers_that_list_the_truth_and_leave_it_open_get_another_run():
    assert following.is_left_open(record([effect()], LEFT_OPEN))
    assert following.is_left_open(record([effect()], [cause(probability=0.3)], "unexplained"))
    for other in (
        record([effect()], [cause()]),
        record([effect()], [cause("friction")]),
        record([effect(ratio=0.5)], LEFT_OPEN),
        record([effect(), effect("friction")], LEFT_OPEN),
        record([effect()], LEFT_OPEN, kind="open"),
        record([effect()], LEFT_OPEN) | {"result": None},
    ):
        assert not following.is_left_open(other)


def test_programs_of_the_three_ways(monkeypatch):
    made = record([effect()], LEFT_OPEN, next_run={"program": "reversals"})
    made["label"]["runs"] = [{"program": "zigzag"}]
    monkeypatch.setattr(following, "names", lambda: ("circle", "weights"))
    assert following.chosen_program(following.ASKED, made, TRUTH) == ("reversals", None)
    assert following.chosen_program(following.REPEAT, made, TRUTH) == ("zigzag", None)
    random, skipped = following.chosen_program(following.RANDOM, made, TRUTH)
    assert random in ("circle", "weights")
    assert skipped is None


def test_rates_leave_out_what_was_skipped_and_count_it():
    def drive(way, settled, skipped=None):
        return {"way": way, "program": "circle", "settled": settled, "skipped": skipped}

    driven = [
        {"drives": [drive(following.ASKED, True), drive(following.REPEAT, False)]},
        {"drives": [drive(following.ASKED, False, following.NONE_ASKED), drive(following.REPEAT, False)]},
    ]
    asked, random, repeat = following.rows(driven)
    assert asked[1:] == ("1.000 (>= 0.050, n 1)", f"{following.NONE_ASKED}: 1", ">= .85")
    assert random[1] == "-"
    assert repeat[1] == "0.000 (>= 0.000, n 2)"


def test_stored_runs_are_not_driven_again(tmp_path):
    made = record([effect()], LEFT_OPEN) | {"code": "a"}
    stored = {"case": made["case"], "code": "a", "drives": []}
    (tmp_path / "next").mkdir()
    (tmp_path / "next" / "single-00001.json").write_text(json.dumps(stored), encoding="utf-8")
    assert following.next_records([made], tmp_path, "a", following.Asked(5)) == [stored]
    assert following.next_records([made], tmp_path, "b", following.Asked(5, only_stored=True)) == [stored]
    assert following.next_records([made], tmp_path, "a", following.Asked(0)) == []


def test_what_no_motion_can_part_may_stay_in_the_set():
    truth = ("mastering", "A6")
    alike = ("tool_frame", None)
    assert following.is_settled(answer([cause(*truth, alike=[alike])]), truth)
    assert following.is_settled(answer([cause(*alike, alike=[truth])]), truth)
    assert not following.is_settled(answer([cause(*alike)]), truth)
    assert not following.is_settled(answer([cause(*truth, alike=[alike, ("base_frame", None)])]), truth)
    assert not following.is_settled(answer([cause(*alike, alike=[truth])]), alike)  # only the one way round


def begun(*states):
    """A program that moves until 0.5 s on line 1, stands until 5 s, and moves again on line 6."""
    move = np.array([0, 0, *[0] * 8, 1, 1])
    speed = np.array([9.0, 9.0, *[0.0] * 8, 9.0, 9.0])
    motion = SimpleNamespace(time_s=0.5 * np.arange(12), speed_mm_s=speed, move=move)
    made = [
        SimpleNamespace(line=line, stood_s=stood, pull_N=pull, rpm=rpm) for line, stood, pull, rpm in states
    ]
    return canned.moments(made, motion, np.array([1, 6]))


def test_states_begin_after_the_last_move_and_the_dwells_since():
    found = begun((1, 1.5, (0, 0, 0), 6000.0), (5, 3.5, (0, 0, 0), 0.0), (6, 9.0, (0, 0, 0), 900.0))
    assert canned.spindle(found) == [[0.0, 0.0], [2.0, 6000.0], [4.0, 0.0], [5.5, 900.0]]


def test_pulls_last_until_the_next_change():
    pulls = ((0.0, 0.0, -200.0), (0.0, 0.0, 0.0), (200.0, 0.0, 0.0))
    found = begun(*((1, 1.0 + number, pull, 0.0) for number, pull in enumerate(pulls)))
    assert canned.weights(found, 9.0) == [
        {"from_s": 1.5, "to_s": 2.5, "pull_N": [0.0, 0.0, -200.0]},
        {"from_s": 3.5, "to_s": 9.0, "pull_N": [200.0, 0.0, 0.0]},
    ]
    assert canned.weights([], 9.0) == []
