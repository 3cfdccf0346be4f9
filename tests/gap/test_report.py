"""The report and its first sentence."""

import re
from dataclasses import replace

import pytest

from gcode2krl.gap.answer.result import (
    AtPart,
    EffectAt,
    EventResult,
    Expectation,
    JointResult,
    MomentResult,
    NextRun,
    NoiseResult,
    PhaseResult,
    RunSize,
    Separates,
    UnknownAt,
    Where,
)
from gcode2krl.gap.answer.words import amount, headline, left_lines, stretch, text_report, where_words, worst
from gcode2krl.gap.posterior.cause_tests import Interval
from tests.gap.answered import BACKLASH, GAP, LAG, STEP, STRETCH, TIP, UNEXPLAINED, UNSURE

# The report: lines for links, places, causes, what is left, the next run and what is missing

BLOW = EventResult(
    link="force", run="run-2", t_s=11.8, line=42, what="impulse", size=1154.0, unit="N", lasts_s=0.04
)


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
    said = text_report(replace(GAP, gap=replace(GAP.gap, per_run=per_run), events=(BLOW,)))
    assert "run by run, those that explain included; the table above is of data not used" in said
    assert "  run-1: 0.029 mm RMS, 0.02 with the named causes\n" in said
    assert "  run-2: 0.159 mm RMS, 0.02 with the named causes, held out\n" in said
    assert "what happened\n  11.80 s of run-2, line 42: an impulse of 1154 N in force, for 40 ms\n" in said
    assert "run by run" not in text_report(GAP)


# The first sentence: the size at the part, most of it, the cause, what is left


def where(share, phase="reversal", rms=0.8, joints=("A2",)):
    """Return a phase with a share of the power beside cruise, whose rms is 0.3."""
    rest = () if share == 1.0 else (PhaseResult(phase="cruise", rms=0.3, share=1.0 - share),)
    return Where(
        phases=(PhaseResult(phase=phase, rms=rms, share=share), *rest),
        joints=tuple(JointResult(joint=joint, share=0.9) for joint in joints),
    )


def off(what, link, rms, unit):
    at = AtPart(what=what, unit=unit, rms_before=rms, rms_after=None, noise=None, link=link)
    return replace(GAP, at_part=at)


def of_runs(*sizes, **more):
    per_run = tuple(
        RunSize(run=f"run-{number}", rms_before=size, rms_after=None, held_out=False)
        for number, size in enumerate(sizes, 1)
    )
    return replace(GAP, at_part=replace(TIP, rms_before=0.114, per_run=per_run), **more)


def left(held_out_before):
    return replace(
        GAP, at_part=replace(TIP, rms_before=0.114, rms_after=0.0201, held_out_before=held_out_before)
    )


def with_noise(stated):
    noise = NoiseResult(stated=stated, learnt=0.3, short=0.3, source="what no effect explains")
    return replace(NO_GAP, links=tuple(replace(link, noise=noise) for link in GAP.links))


NO_GAP = replace(GAP, verdict="no_gap", causes=(), at_part=None)
MORE = replace(GAP.unexplained, significant=True, depends_on=(STEP,))
TOOL = replace(LAG, effect="tool_number", target=None, words="the tip is that of tool 3")
UNKNOWN = replace(GAP, at_part=replace(TIP, rms_after=None))
SLIPPED = replace(
    LAG,
    effect="step",
    target="A2",
    probability=0.9,
    parameters={"at_s": Interval(6384.0, 6383.9, 6384.1), "size_deg": Interval(-0.0225, -0.023, -0.022)},
    moment=MomentResult(run="run-2", t_s=11.82, line=42),
)
LATER = replace(SLIPPED, moment=MomentResult(run="run-2", t_s=14.0, line=50))
ALONE = replace(UNEXPLAINED, events=(BLOW,), unexplained=replace(UNEXPLAINED.unexplained, depends_on=()))
OFF, TIP_TOO = "The tip is off by 0.11 mm RMS", replace(BLOW, link="mechanics", size=0.6, unit="mm")
SENTENCES = {
    "an explained gap": (
        replace(GAP, where=where(0.8)),
        "The tip is off by 0.41 mm RMS, four fifths of it after reversals of axis 2: backlash of A2, "
        "0.021 deg ± 0.002. With it in the model 0.061 mm are left on data not used, the noise is 0.030 mm.",
    ),
    "two causes, and a rest that depends on something": (
        replace(GAP, verdict="partly_explained", causes=(BACKLASH, LAG, UNSURE), unexplained=MORE),
        "The tip is off by 0.41 mm RMS: backlash of A2, 0.021 deg ± 0.002 and servo lag of A4. With them in "
        "the model 0.061 mm are left on data not used, the noise is 0.030 mm; more is left than noise "
        "explains: a step from 11.2 s of run-1 on at the tip, 0.14 mm along (0.9, 0.3, 0.1).",
    ),
    "an unexplained gap says on what it depends": (
        UNEXPLAINED,
        "The tip is off by 0.41 mm RMS: no effect of the library explains it; it is a step from "
        "11.2 s of run-1 on at the tip, 0.14 mm along (0.9, 0.3, 0.1).",
    ),
    "and what it may be": (replace(UNEXPLAINED, causes=(UNSURE,)), "…; perhaps thermal (0.31)."),
    "no gap is said in mm where the tip was measured": (
        NO_GAP,
        "No gap: the tip is off by 0.41 mm RMS, which noise and normal mismatch explain.",
    ),
    "else in the unit of the joints": (
        replace(NO_GAP, links=(), gap=replace(GAP.gap, unit="deg", rms_before=0.0011)),
        "No gap: 0.0011 deg RMS are what noise and normal mismatch explain.",
    ),
    "nothing compared": (
        replace(NO_GAP, links=(), gap=replace(GAP.gap, rms_before=None)),
        "Nothing was compared…",
    ),
    "poses whose noise nobody knows are not called sound": (
        with_noise(None),
        "No gap is named, but the noise is unknown: the tip is off by 0.41 mm RMS, noise or a gap that no "
        "effect explains.",
    ),
    "those whose noise is stated are": (with_noise(0.3), "…which noise and normal mismatch explain."),
    "a slip is said first": (
        replace(GAP, causes=(BACKLASH, TOOL)),
        "Set-up slip: the tip is that of tool 3.",
    ),
    "the part": (off("part", "part", 0.2, "mm"), "The part is off by 0.20 mm RMS:…"),
    "a force": (off("force", "force", 12.3, "N"), "The measured force is off by 12 N RMS:…"),
    "joints": (off("joints", "gear", 0.0123, "deg"), "The joints are off by 0.012 deg RMS:…"),
    "time": (off("time", "timing", 0.25, "s"), "The robot is 0.25 s RMS early or late on its path:…"),
    "stamps": (off("time", "gear", 0.00307, "s"), "Time stamps are off by 3.1 ms:…"),
    "nearly all": (replace(GAP, where=where(0.95)), "…, nearly all of it after reversals of axis 2: …"),
    "two thirds": (replace(GAP, where=where(0.65)), "…, two thirds of it after reversals of axis 2: …"),
    "half": (replace(GAP, where=where(0.55)), "…, half of it after reversals of axis 2: …"),
    "less than half": (replace(GAP, where=where(0.4)), "The tip is off by 0.41 mm RMS: …"),
    "corners": (replace(GAP, where=where(0.95, "corner")), "…, nearly all of it at corners: …"),
    "entry": (replace(GAP, where=where(0.95, "entry")), "…, nearly all of it where the cutter enters: …"),
    "exit": (replace(GAP, where=where(0.95, "exit")), "…, nearly all of it where it leaves: …"),
    "in air where it is larger there": (
        replace(GAP, where=where(0.6, "air")),
        "…, two thirds of it in air: …",
    ),
    # a constant offset has most of its power where most of the time is spent
    "not where the robot merely is": (replace(GAP, where=where(0.6, "air", 0.3)), "…0.41 mm RMS: …"),
    "nor always is": (replace(GAP, where=where(1.0, "air", 0.3)), "…0.41 mm RMS: …"),
    "the share where nothing was held out": (
        UNKNOWN,
        "…With it in the model 98% of the gap is gone on data not used.",
    ),
    "or nothing": (replace(UNKNOWN, gap=replace(GAP.gap, shrink=None)), "…0.021 deg ± 0.002."),
    "a run that stands out": (of_runs(0.029, 0.159), f"{OFF}, 0.16 mm in run-2: backlash…"),
    "runs alike": (of_runs(0.1, 0.12), f"{OFF}: backlash…"),
    "one run": (of_runs(0.11), f"{OFF}: backlash…"),
    "a run and a phase": (
        of_runs(0.029, 0.159, where=where(0.8)),
        f"{OFF}, 0.16 mm in run-2, four fifths of the gap after reversals of axis 2:…",
    ),
    "what is left of what there was on the same data": (
        left(0.029),
        f"{OFF}: …With it in the model 0.020 mm of 0.029 mm are left on data not used…",
    ),
    "or of about the same": (left(0.11), "… 0.020 mm are left on data not used…"),
    "a blow, and the step that it left behind": (
        replace(GAP, causes=(SLIPPED,), events=(BLOW,)),
        "The tool hit something at 11.80 s of run-2, line 42: 1.2 kN; since then A2 is off by 0.0225 deg. "
        "The tip is off by 0.41 mm RMS: step of A2, at 11.82 s of run-2, line 42, -0.0225 deg…",
    ),
    "one reading alone is no blow": (
        ALONE,
        "The force jumps at 11.80 s of run-2, line 42, for 40 ms: 1.2 kN. "
        "What else the runs differ by, noise and normal mismatch explain.",
    ),
    "two readings are one": (replace(ALONE, events=(BLOW, TIP_TOO)), "The tool hit something…"),
    "a burst is not told": (replace(GAP, events=(replace(BLOW, what="burst"),)), headline(GAP)),
}
"""Gaps, and their first sentences; … is anything."""


@pytest.mark.parametrize(("gap", "sentence"), SENTENCES.values(), ids=SENTENCES)
def test_the_first_sentence(gap, sentence):
    said = headline(gap)
    assert re.fullmatch(re.escape(sentence).replace("…", ".*"), said), said


def test_a_step_of_another_moment_was_not_left_behind_by_a_blow():
    assert "since then" not in headline(replace(GAP, causes=(LATER,), events=(BLOW,)))


def test_amounts_and_stretches():
    assert amount(0.0031, "s") == "3.1 ms"
    assert amount(0.31, "s") == "0.31 s"
    assert amount(0.0031, "mm") == "0.0031 mm"
    assert stretch(STRETCH) == "run-1: 2.00-4.00 s, lines 120-131"
    assert stretch(replace(STRETCH, lines=(), t_start_s=-0.001)) == "run-1: 0.00-4.00 s"
