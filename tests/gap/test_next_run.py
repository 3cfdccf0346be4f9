"""The next run: which pairs are open, which program is taken, and how it is told."""

import math
from dataclasses import replace

import pytest

from gcode2krl.canned.trial import trials_of
from gcode2krl.effects import Applied, library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.choose.judged import Cause
from gcode2krl.gap.choose.next_run import (
    Answer,
    Choice,
    Family,
    OpenPair,
    Parting,
    answer_of,
    best,
    choose_next_run,
    open_pairs,
)
from gcode2krl.gap.choose.rivals import Rival
from gcode2krl.gap.choose.separation import Apart
from gcode2krl.gap.tell.next_run import next_run_of, shown, told
from gcode2krl.gap.tell.result import DependsOnResult, NextRun
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.constructed import LINK, cell, stub
from tests.gap.test_separation import ALONG_X, SIGMA_MM, TRIALS, at, measured

KNOWN = library()
LIMITS = THRESHOLDS.choose


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


def judgement(found, *causes, verdict="explained", after=SIGMA_MM, before=0.3):
    size = stub(before=before**2, after=after**2, floor=SIGMA_MM**2, power=1.0, significant=True)
    link = LINK["mechanics"]
    return stub(
        link=link, verdict=verdict, causes=causes, examination=found, size=size, factor=1.0, applied=()
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
    assert labels(open_pairs(KNOWN, [judgement(offset, cause(offset, 0.98))])) == []
    nothing = judgement(offset, cause(offset, 0.6, alike(FRAME, 0.6)), verdict="no_gap")
    assert labels(open_pairs(KNOWN, [nothing])) == []
    settled = judgement(offset, cause(offset, 0.97, worse(FRAME, 0.02)))
    assert labels(open_pairs(KNOWN, [settled])) == []


def test_rivals_alike_are_open_however_sure_the_two_are_together(offset):
    pairs = open_pairs(KNOWN, [judgement(offset, cause(offset, 0.98, alike(FRAME, 0.98)))])
    assert labels(pairs) == [("tool_frame", "base_frame", 0.98)]


def test_an_unsure_cause_is_open_against_its_rivals_and_the_unknown(offset):
    unsure = cause(offset, 0.6, worse(FRAME, 0.2), worse(at("mastering", "A1", offset_deg=0.1), 0.01))
    assert labels(open_pairs(KNOWN, [judgement(offset, unsure)])) == [
        ("tool_frame", "base_frame", 0.12),
        ("tool_frame", "something else", 0.114),
    ]


def test_families_of_the_link_are_open_beside_a_cause_and_among_each_other(offset):
    drift = Family("mechanics", "tip", "wall clock", "drift", 0.5)
    place = Family("mechanics", "tip", "constant", "smooth", 0.3)
    elsewhere = Family("gear", "A2", "reversals", "loop", 0.9)
    families = [drift, place, elsewhere]
    alone = judgement(offset, verdict="unexplained")
    assert labels(open_pairs(KNOWN, [alone], families)) == [("tip, wall clock", "tip, constant", 0.15)]
    named = judgement(offset, cause(offset, 0.98), verdict="partly_explained")
    assert labels(open_pairs(KNOWN, [named], families)) == [
        ("tool_frame", "tip, wall clock", 0.5),
        ("tool_frame", "tip, constant", 0.3),
    ]
    doubted = judgement(offset, cause(offset, 0.02, alike(FRAME, 0.02)), verdict="unexplained")
    assert labels(open_pairs(KNOWN, [doubted], [drift])) == [("tip, wall clock", "something else", 0.5)]


def test_a_family_is_simulated_by_an_effect_that_depends_on_it(offset):
    found = answer_of(Family("mechanics", "A2", "reversals", "loop", 0.5), KNOWN, judgement(offset))
    assert found.applied is not None
    assert found.applied.target == "A2"
    assert "reversals" in {each.value for each in found.applied.effect.depends_on}
    unknown = answer_of(Family("mechanics", "tip", "no such input", "smooth", 0.5), KNOWN, judgement(offset))
    assert unknown.applied is None
    assert unknown.label == "tip, no such input"


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


def test_a_gap_of_which_nothing_is_known_is_run_again(offset):
    unknown = judgement(offset, verdict="unexplained", after=0.3)
    found = next_run_of(context(), [unknown])
    assert found.program == "repeat"
    assert found.minutes > TRIALS["sync"].inputs.time_s[-1] / 60.0
    assert found.separates[0].odds == pytest.approx(math.exp(LIMITS.most_log_odds), rel=0.01)
    assert [each.answer for each in found.expect] == ["it comes back", "it happened once"]
    assert "0.3 mm at the tip again" in found.expect[0].shows


def test_families_of_the_answer_reach_the_choice(offset):
    rest = [
        DependsOnResult(
            link="mechanics", at="tip", on="wall clock", form="drift", probability=0.6, share=0.5
        ),
        DependsOnResult(link="mechanics", at="tip", on="constant", form="smooth", probability=0.3, share=0.5),
    ]
    found = next_run_of(context(), [judgement(offset, verdict="unexplained")], rest)
    assert isinstance(found, NextRun)
    assert (found.separates[0].first, found.separates[0].second) == ("tip, wall clock", "tip, constant")


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


def test_a_program_that_parts_nothing_says_so():
    said = told(choice("circle", 1.6, 1.2))
    assert [each.shows for each in said.expect] == [
        "the same as if b: no program parts them",
        "the same as if a: no program parts them",
    ]


def test_an_applied_effect_is_an_answer_by_its_label():
    assert isinstance(FRAME, Applied)
    assert FRAME.label == "base_frame"
