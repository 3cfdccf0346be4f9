"""What becomes of a right answer when a channel goes or comes; channels taken from a run by hand."""

from importlib import import_module

import polars as pl
import pytest

from tests.benchmarks.hand_made import answer, cause, effect

metamorphic = import_module("blind.channels")
channels = import_module("blind.channels")

RIGHT, WRONG, NONE = answer([cause()]), answer([cause("friction")]), answer(verdict="unexplained")


def fates(whole, smaller, channel="force", **label):
    made = {
        "case": {"seed": 1, "kind": "single"},
        "label": {"effects": [effect(**label)]},
        "answers": {
            metamorphic.WHOLE: {"result": whole, "error": None},
            channel: {"result": smaller, "error": None},
        },
    }
    return [(each.added, each.fate) for each in metamorphic.changes(made)]


def test_an_answer_may_stay():
    assert fates(RIGHT, RIGHT) == [(False, metamorphic.SAME), (True, metamorphic.SAME)]
    assert fates(NONE, NONE) == []


def test_taking_away_never_makes_a_wrong_name():
    assert fates(RIGHT, WRONG) == [(False, metamorphic.WRONG)]
    gone = {"main_signal": "force", "signals": {"force": {"ratio": 2.0}}}
    assert fates(RIGHT, WRONG, depends=None, **gone) == [(False, metamorphic.WRONG)]


def test_a_name_may_be_lost_where_the_effect_does_not_show():
    assert fates(RIGHT, NONE) == [(False, metamorphic.LOST)]  # it shows in tcp
    assert fates(RIGHT, NONE, "tracker") == [(False, metamorphic.HIDDEN)]


def test_adding_costs_nothing():
    assert fates(WRONG, RIGHT) == [(True, metamorphic.WRONG)]
    assert fates(NONE, RIGHT, "tracker") == [(True, metamorphic.LOST)]


def test_an_exception_is_worse_than_an_answer():
    made = metamorphic.judge(
        {
            "case": {"seed": 1, "kind": "single"},
            "label": {"effects": [effect()]},
            "result": None,
            "error": "x",
        }
    )
    right = metamorphic.judge(
        {"case": {"seed": 1, "kind": "single"}, "label": {"effects": [effect()]}, "result": RIGHT}
    )
    assert metamorphic._change(right, "force", False, made, True).is_worse


def test_load_encoders_of_other_joints_hide_nothing():
    entry = effect(
        "transmission",
        "A5",
        main_signal="joint_load",
        signals={"joint_load": {"ratio": 3.0}, "tcp": {"ratio": 0.2}},
        depends={"where": "joint", "joints": ["A5"], "on": ["motor_angle"], "form": "periodic"},
    )
    shows = {name: channels.shows_without(each, entry) for name, each in channels.CHANNELS.items()}
    hidden = {name for name, each in shows.items() if not each}
    assert hidden == {"controller", "load encoders", "load encoders of A4-A6"}


@pytest.fixture
def case(tmp_path):
    run = tmp_path / "case" / "run-1"
    run.mkdir(parents=True)
    pl.DataFrame({"t_s": [0.0, 0.1], "x_mm": [1.0, 2.0], "a_deg": [None, 0.5]}).write_csv(run / "tracker.csv")
    load = {f"q{joint}_load_deg": [0.0, 0.1] for joint in range(1, 7)}
    pl.DataFrame({"t_s": [0.0, 0.1], **load}).write_parquet(run / "controller.parquet")
    return tmp_path / "case"


def test_columns_are_taken_and_the_rest_stays(case, tmp_path):
    to = tmp_path / "smaller"
    assert channels.without(channels.CHANNELS["orientation"], case, to)
    assert (to / "run-1" / "tracker.csv").read_text().splitlines() == ["t_s,x_mm", "0.0,1.0", "0.1,2.0"]
    some = tmp_path / "some"
    assert channels.without(channels.CHANNELS["load encoders of A4-A6"], case, some)
    left = pl.read_parquet(some / "run-1" / "controller.parquet").columns
    assert left == ["t_s", "q1_load_deg", "q2_load_deg", "q3_load_deg"]


def test_a_channel_that_is_not_there_makes_no_case(case, tmp_path):
    assert not channels.without(channels.CHANNELS["force"], case, tmp_path / "smaller")
    assert not (tmp_path / "smaller").exists()


def test_the_last_table_stays(case, tmp_path):
    one = tmp_path / "one"
    assert channels.without(channels.CHANNELS["controller"], case, one)
    assert not channels.without(channels.CHANNELS["tracker"], one, tmp_path / "none")


def test_the_report_lists_what_became_worse():
    found = [
        metamorphic.Change(
            "single-00001", "backlash A2 (2.00)", "force", False, metamorphic.WRONG, "friction"
        ),
        metamorphic.Change(
            "single-00001", "backlash A2 (2.00)", "scan", True, metamorphic.SAME, "backlash A2"
        ),
    ]
    text = metamorphic.report(found, 1)
    assert "1 of 2 right answers became worse" in text
    assert "| single-00001 | backlash A2 (2.00) " in text


def test_unknown_channels_are_refused(capsys):
    assert metamorphic.main(["--channels", "smell"]) == 2
    assert "no channel smell" in capsys.readouterr().err


@pytest.mark.slow
def test_channels_of_a_play_in_the_wrist(tmp_path):
    options = ["--cases", "1", "--seed", "1", "--effects", "backlash@A4", "--jobs", "1"]
    options += ["--channels", "load encoders of A4-A6", "--resume", str(tmp_path)]
    assert metamorphic.main(options) == 0
