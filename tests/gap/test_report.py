"""The report: lines for links, places, causes, what is left, the next run and what is missing."""

from dataclasses import replace

import pytest

from gcode2krl.gap.answer.result import (
    EffectAt,
    EventResult,
    Expectation,
    NextRun,
    RunSize,
    Separates,
    UnknownAt,
    Where,
)
from gcode2krl.gap.answer.words import headline, left_lines, text_report, where_words, worst
from tests.gap.answered import BACKLASH, GAP, STRETCH, UNEXPLAINED, UNSURE


def stretches(*shares):
    return tuple(replace(STRETCH, share=share) for share in shares)


def test_the_whole_report_line_by_line():
    alike = replace(BACKLASH, indistinguishable_from=(EffectAt("hysteresis", "A2"),), family="A2, reversals")
    some = replace(
        GAP,
        causes=(alike, UNSURE),
        where=Where(intervals=(STRETCH, *stretches(0.1, 0.05))),
        notes=("angles are relative",),
        next_run=NextRun(
            program="reversals",
            minutes=4.0,
            separates=(Separates(first="backlash A2", second="hysteresis A2", odds=30.0),),
            expect=(Expectation(answer="backlash A2", shows="the same at any force"),),
        ),
    )
    lines = text_report(some).splitlines()
    assert lines[0] == headline(some)
    assert lines[1:] == [
        "",
        "link        before      after       noise       verdict",
        "servo       0.001       0.001       -           no_gap (deg)",
        "mechanics   0.412       0.0611      0.0304      explained (mm)",
        "",
        "where",
        "  the first of 3 stretches holds 85% of the gap; in them it exceeds the noise",
        "  run-1: 2.00-4.00 s, lines 120-131: 0.8 mm (reversal of A2), 85% of the gap",
        "",
        "causes",
        "  0.94 backlash of A2, 0.021 deg ± 0.002, takes 98% of the gap on data not used",
        "       these data cannot tell it from hysteresis of A2",
        "       of the kind A2, reversals",
        "  0.31 thermal, would take 98% of the gap (not named)",
        "",
        "next run",
        "  gcode2krl make-test reversals, 4 minutes",
        '  tells "backlash A2" from "hysteresis A2", odds 30 to 1',
        "  if backlash A2: the same at any force",
        "",
        "not examined",
        "  force: needs force.csv",
        "note: angles are relative",
    ]


def test_what_is_left_is_said_by_what_it_depends_on():
    assert list(left_lines(UNEXPLAINED)) == [
        "0.93 tip, a step from 11.2 s of run-1 on, 0.14 mm along (0.9, 0.3, 0.1); takes 88% of the gap"
    ]
    drift = replace(
        UNEXPLAINED.unexplained.depends_on[0],
        probability=0.4,
        indistinguishable_from=(UnknownAt(at="A4", on="wall clock"), UnknownAt(at="tip", on="travel")),
        set_probability=0.7,
    )
    gap = replace(UNEXPLAINED, unexplained=replace(UNEXPLAINED.unexplained, depends_on=(drift,)))
    assert list(left_lines(gap))[1] == (
        "     0.70 that or what these data cannot tell from it: A4, wall clock or tip, travel"
    )
    assert "what is left depends on" in text_report(UNEXPLAINED).splitlines()
    assert "what is left depends on" not in text_report(GAP)


@pytest.mark.parametrize(
    ("shares", "count", "held"),
    [
        ((0.5, 0.35, 0.1, 0.05), 2, 0.85),
        ((1.0,), 1, 1.0),
        ((0.05,) * 20, 8, 0.4),
        ((0.3, 0.2), 2, 0.5),
    ],
)
def test_stretches_are_printed_until_they_hold_four_fifths(shares, count, held):
    assert worst(stretches(*shares)) == (count, pytest.approx(held))


def test_how_much_the_printed_stretches_hold():
    assert where_words(stretches(1.0)) == "this stretch holds 100% of the gap"
    assert where_words(stretches(0.3, 0.2)) == "these 2 stretches hold 50% of the gap"
    assert where_words(stretches(0.5, 0.35, 0.1)) == "these 2 of 3 stretches hold 85% of the gap"


def test_an_empty_report_is_its_sentence():
    bare = replace(GAP, verdict="no_gap", links=(), causes=(), not_examined=())
    assert text_report(bare) == headline(bare)


def test_runs_and_what_happened_have_sections_of_their_own():
    sizes = [("run-1", 0.029, False), ("run-2", 0.159, True)]
    per_run = tuple(
        RunSize(run=run, rms_before=before, rms_after=0.02, held_out=held) for run, before, held in sizes
    )
    blow = EventResult(
        link="force", run="run-2", t_s=11.8, line=42, what="impulse", size=1154.0, unit="N", lasts_s=0.04
    )
    said = text_report(replace(GAP, gap=replace(GAP.gap, per_run=per_run), events=(blow,)))
    assert "run by run, those that explain included; the table above is of data not used" in said
    assert "  run-1: 0.029 mm RMS, 0.02 with the named causes\n" in said
    assert "  run-2: 0.159 mm RMS, 0.02 with the named causes, held out\n" in said
    assert "what happened\n  11.80 s of run-2, line 42: an impulse of 1154 N in force, for 40 ms\n" in said
    assert "run by run" not in text_report(GAP)
