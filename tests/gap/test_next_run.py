"""The next run: which pairs are open, which program is taken, and how it is told."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gcode2krl.canned.trial import trials_of
from gcode2krl.effects import Applied, library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.answer.causes import next_run_of, shown, told
from gcode2krl.gap.answer.result import DependsOnResult
from gcode2krl.gap.posterior.judgement import Cause, judge
from gcode2krl.gap.posterior.next_run import (
    Answer,
    Apart,
    Choice,
    OpenPair,
    Parting,
    best,
    choose_next_run,
    open_pairs,
)
from gcode2krl.gap.posterior.selection import Rival
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.constructed import LINK, cell, noise, question, stub, trace
from tests.gap.test_separation import ALONG_X, SIGMA_MM, TRIALS, at, measured

KNOWN = library()


def cause(found, probability, *rivals, **intervals):
    return Cause(
        applied=found.applied[0],
        link="mechanics",
        probability=probability,
        parameters=intervals,
        shrink=0.9,
        rms_after=SIGMA_MM,
        rivals=rivals,
    )


def judgement(
    found, *causes, verdict="explained", after=SIGMA_MM, before=0.3, runs=(), impulses=(), significant=True
):
    size = stub(before=before**2, after=after**2, floor=SIGMA_MM**2, power=1.0, significant=significant)
    return stub(
        link=LINK["mechanics"],
        verdict=verdict,
        causes=causes,
        examination=found,
        size=size,
        told=size,
        factor=1.0,
        applied=tuple(each.applied for each in causes if each.probability >= THRESHOLDS.posterior.named),
        every=tuple(runs or found.traces),
        impulses=impulses,
        rest=None,
    )


def context(hours=0.0):
    inputs = replace(TRIALS["sync"].inputs, hours=hours)
    return stub(offered=KNOWN, pairs=(stub(inputs=inputs, known_robot=True),), mismatch=Mismatch())


def alike(applied, probability):
    return Rival(applied, 0.0, 0.0), probability


def worse(applied, probability):
    return Rival(applied, 20.0, 20.0), probability


@pytest.fixture(scope="module")
def offset():
    return measured("tool_frame", None, (("x_mm", 0.3), ("y_mm", 0.2)))


FRAME = at("base_frame", x_mm=0.3, y_mm=0.2)


# --- what is open -----------------------------------------------------------------------------------------


def labels(pairs):
    return [(pair.first.label, pair.second.label, round(pair.weight, 4)) for pair in pairs]


def test_what_is_settled_or_no_gap_leaves_nothing_open(offset):
    assert labels(open_pairs([judgement(offset, cause(offset, 0.98))])) == []
    nothing = judgement(offset, cause(offset, 0.6, alike(FRAME, 0.6)), verdict="no_gap")
    assert labels(open_pairs([nothing])) == []
    settled = judgement(offset, cause(offset, 0.97, worse(FRAME, 0.02)))
    assert labels(open_pairs([settled])) == []


def test_rivals_alike_are_open_however_sure_the_two_are_together(offset):
    pairs = open_pairs([judgement(offset, cause(offset, 0.98, alike(FRAME, 0.98)))])
    assert labels(pairs) == [("tool_frame", "base_frame", 0.98)]


def test_an_unsure_cause_is_open_against_its_rivals_and_the_unknown(offset):
    unsure = cause(offset, 0.6, worse(FRAME, 0.2), worse(at("mastering", "A1", offset_deg=0.1), 0.01))
    assert labels(open_pairs([judgement(offset, unsure)])) == [
        ("tool_frame", "base_frame", 0.12),
        ("tool_frame", "something else", 0.114),
    ]


def test_families_of_the_link_are_open_beside_a_cause_and_among_each_other(offset):
    drift, place = Answer("tip, wall clock", 0.5), Answer("tip, constant", 0.3)
    families = {"mechanics": [drift, place], "gear": [Answer("A2, reversals", 0.9)]}
    alone = judgement(offset, verdict="unexplained")
    assert labels(open_pairs([alone], families)) == [("tip, wall clock", "tip, constant", 0.15)]
    named = judgement(offset, cause(offset, 0.98), verdict="partly_explained")
    assert labels(open_pairs([named], families)) == [
        ("tool_frame", "tip, wall clock", 0.5),
        ("tool_frame", "tip, constant", 0.3),
    ]
    doubted = judgement(offset, cause(offset, 0.02, alike(FRAME, 0.02)), verdict="unexplained")
    assert labels(open_pairs([doubted], {"mechanics": [drift]})) == [
        ("tip, wall clock", "something else", 0.25)
    ]


def of_joint(number):
    """Return what a family says of one joint's signal, as far as pairs ask."""
    return stub(place=stub(component=number))


def test_families_of_two_joints_are_no_rivals_and_one_that_stands_alone_has_to_foretell(offset):
    families = [
        Answer("A1, jerk", 0.93, evidence=of_joint(0)),
        Answer("A3, jerk", 0.4, evidence=of_joint(2)),
        Answer("A3, velocity", 0.3, evidence=of_joint(2)),
    ]
    alone = judgement(offset, verdict="unexplained")
    assert labels(open_pairs([alone], {"mechanics": families})) == [
        ("A1, jerk", "something else", 0.0651),
        ("A3, jerk", "A3, velocity", 0.12),
    ]


# --- the choice -------------------------------------------------------------------------------------------


def choice(program, minutes, *odds, weight=1.0):
    nothing = Apart(
        distance2=1.0,
        time_s=1.0,
        component="x",
        first=0.3,
        second=0.0,
        is_change=False,
        unit="mm",
        signal="tcp",
        noise=0.02,
    )
    pair = OpenPair(Answer("a", 0.5), Answer("b", 0.5), weight, None, None)
    return Choice(program, minutes, tuple(Parting(pair, each, math.log(each), nothing) for each in odds))


def test_the_best_odds_win_and_among_near_equals_the_shortest():
    assert best([]) is None
    assert best([choice("sync", 1.0, 2.0), choice("dwell", 30.0, 900.0)]).program == "dwell"
    assert best([choice("weights", 15.0, 950.0), choice("orientation", 4.0, 900.0)]).program == "orientation"
    assert best([choice("circle", 2.0, 10.0, 10.0), choice("dwell", 30.0, 900.0, 1.0)]).program == "dwell"


def test_tool_and_base_are_parted_by_turning_the_tool(offset):
    open_case = judgement(offset, cause(offset, 0.98, alike(FRAME, 0.98)))
    found = choose_next_run(context(), [open_case])
    assert found.program == "orientation"
    assert found.partings[0].odds > 100.0
    assert found.minutes == pytest.approx(TRIALS["orientation"].minutes)
    again = choose_next_run(context(), [open_case])
    assert again.partings[0].odds == found.partings[0].odds  # nothing depends on the time it took


def test_drift_and_offset_are_parted_by_waiting(offset):
    warming = at("thermal", mm_per_h=0.3, time_constant_h=1.0, **ALONG_X)
    found = measured("base_frame", None, (("x_mm", 0.118),), hours=0.5)
    made = choose_next_run(context(0.5), [judgement(found, cause(found, 0.98, alike(warming, 0.98)))])
    assert made.program == "dwell"
    assert made.partings[0].odds > 10.0
    said = told(made)
    assert {each.answer for each in said.expect} == {"base_frame", "thermal"}
    drift = next(each.shows for each in said.expect if each.answer == "thermal")
    grown = 0.3 * (math.exp(-0.5) - math.exp(-0.5 - TRIALS["dwell"].inputs.time_s[-1] / 3600.0))
    assert float(drift.split()[0]) == pytest.approx(grown, abs=0.015)
    assert drift.endswith("mm in x at the tip after 32 min since the start")
    assert next(each.shows for each in said.expect if each.answer == "base_frame").startswith("nothing")


def test_nothing_open_is_no_run(offset):
    assert choose_next_run(context(), [judgement(offset, cause(offset, 0.98))]) is None
    assert next_run_of(context(), []) is None


def moved(run, program=0.0):
    """Return a trace of a run: its program, by where it is, and whether it cuts."""
    one = TRIALS["sync"].inputs
    inputs = replace(one, position_mm=one.position_mm + program)
    return replace(trace(np.zeros((len(one), 3)), "mechanics", inputs=inputs), run=run)


def cutting(one):
    return replace(one, inputs=replace(one.inputs, force_base_N=np.full((len(one.inputs), 3), 10.0)))


RUNS = {
    "one run": [moved("run-1")],
    "two programs": [moved("run-1"), moved("run-2", 5.0)],
    "two of one program": [moved("run-1"), moved("run-2")],
    "two of one program beside another": [moved("run-1"), moved("run-2", 5.0), moved("run-3")],
    "two of one program, cutting": [cutting(moved("run-1")), cutting(moved("run-2"))],
    "one of them in air": [cutting(moved("run-1")), moved("run-2"), moved("run-3")],
}
AGAIN = ("repeat", ["it comes back", "it happened once"])
IN_AIR = ["it comes with motion", "it is there at rest too"]


@pytest.mark.parametrize(
    ("runs", "program", "asked"),
    [
        ("one run", *AGAIN),
        ("two programs", *AGAIN),
        ("two of one program", "circle", IN_AIR),
        ("two of one program beside another", "circle", IN_AIR),
        ("two of one program, cutting", "circle", ["it comes with the cut", *IN_AIR]),
        ("one of them in air", "circle", IN_AIR),
    ],
)
def test_what_is_asked_first_of_a_gap_is_never_what_the_runs_already_show(offset, runs, program, asked):
    unknown = judgement(offset, verdict="unexplained", after=0.3, runs=RUNS[runs])
    found = next_run_of(context(), [unknown])
    assert found.program == program
    assert [each.answer for each in found.expect] == asked
    assert len({each.shows for each in found.expect}) == len(asked)
    assert [(each.first, each.second) for each in found.separates] == list(pairwise(asked))
    assert found.separates[0].odds == pytest.approx(math.exp(THRESHOLDS.posterior.most_log_odds), rel=0.01)


def test_a_blow_is_run_again_only_where_no_other_run_is_of_its_program(offset):
    def blow(runs):
        found = judgement(
            offset, verdict="unexplained", runs=RUNS[runs], impulses=(stub(),), significant=False
        )
        return next_run_of(context(), [found])

    assert blow("one run").program == "repeat"
    assert blow("two of one program") is None


@pytest.fixture(scope="module")
def drifting():
    """What families say of a tip that drifts along x by 0.3 mm an hour, from a run half an hour in."""
    t, shift = TRIALS["sync"].inputs.time_s, np.array([1.0, 0.0, 0.0])
    traces = [
        replace(
            trace(
                (0.3 * (hours + t / 3600.0))[:, None] * shift + noise(len(t), number, SIGMA_MM, 3),
                "mechanics",
                number,
                inputs=replace(TRIALS["sync"].inputs, hours=hours),
            ),
            run=f"run-{number + 1}",
        )
        for number, hours in enumerate((0.0, 0.5, 1.0))
    ]
    found = judge(LINK["mechanics"], traces, [], question([]))
    return found, {each.on.value: each for each in found.rest.study.evidences if each.place.name == "tip"}


def test_families_are_foretold_and_parted_by_the_program_in_which_they_differ(drifting):
    found, evidences = drifting
    rest = [
        (
            DependsOnResult(link="mechanics", at="tip", on=on, form="drift", probability=0.4, share=0.5),
            evidences[on],
        )
        for on in ("wall clock", "run to run")
    ]
    asked = next_run_of(context(1.0), [found], rest)
    assert (asked.separates[0].first, asked.separates[0].second) == ("tip, wall clock", "tip, run to run")
    said = {each.answer: each.shows for each in asked.expect}
    assert len(set(said.values())) == 2
    assert asked.program == "dwell"


def test_without_a_known_robot_no_program_is_simulated(offset):
    alone = context()
    alone.pairs[0].known_robot = False
    assert choose_next_run(alone, [judgement(offset, cause(offset, 0.98, alike(FRAME, 0.98)))]) is None


def test_a_cell_that_states_too_little_has_no_program(offset):
    small = cell().model_copy(update={"mounted_tool": None})
    assert trials_of(small) == ()


# --- the words --------------------------------------------------------------------------------------------


def test_what_a_run_shows_is_told_with_its_unit_and_its_time():
    apart = choice("dwell", 1.0, 10.0).partings[0].apart
    assert shown(apart, 0.3) == "+0.3 mm in x at the tip after 1 s"
    assert shown(apart, 0.001) == "nothing above the noise after 1 s"
    assert shown(apart, 0.3, is_open=True) == "up to 0.3 mm either way in x at the tip after 1 s"


def test_a_program_that_parts_nothing_says_so():
    said = told(choice("circle", 1.6, 1.2))
    assert [each.shows for each in said.expect] == [
        "the same as if b: no program parts them",
        "the same as if a: no program parts them",
    ]


def test_an_applied_effect_is_an_answer_by_its_label():
    assert isinstance(FRAME, Applied)
    assert FRAME.label == "base_frame"
