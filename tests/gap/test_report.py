"""The report and its first sentence."""

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
    Where,
)
from gcode2krl.gap.answer.words import amount, headline, left_lines, stretch, text_report, where_words, worst
from gcode2krl.gap.posterior.cause_tests import Interval
from tests.gap.answered import BACKLASH, GAP, LAG, STEP, STRETCH, TIP, UNEXPLAINED, UNSURE

# The report: lines for links, places, causes, what is left, the next run and what is missing


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


# The first sentence: the size at the part, most of it, the cause, what is left


def where(share, phase="reversal", rms=0.8, joints=("A2",)):
    """Return a phase with a share of the power beside cruise, whose rms is 0.3."""
    rest = () if share == 1.0 else (PhaseResult(phase="cruise", rms=0.3, share=1.0 - share),)
    return Where(
        phases=(PhaseResult(phase=phase, rms=rms, share=share), *rest),
        joints=tuple(JointResult(joint=joint, share=0.9) for joint in joints),
    )


def test_an_explained_gap():
    assert headline(replace(GAP, where=where(0.8))) == (
        "The tip is off by 0.41 mm RMS, four fifths of it after reversals of axis 2: backlash of A2, "
        "0.021 deg ± 0.002. With it in the model 0.061 mm are left on data not used, the noise is 0.030 mm."
    )


def test_two_causes_and_a_rest_that_depends_on_something():
    rest = replace(GAP.unexplained, significant=True, depends_on=(STEP,))
    both = replace(GAP, verdict="partly_explained", causes=(BACKLASH, LAG, UNSURE), unexplained=rest)
    assert headline(both) == (
        "The tip is off by 0.41 mm RMS: backlash of A2, 0.021 deg ± 0.002 and servo lag of A4. With them in "
        "the model 0.061 mm are left on data not used, the noise is 0.030 mm; more is left than noise "
        "explains: a step from 11.2 s of run-1 on at the tip, 0.14 mm along (0.9, 0.3, 0.1)."
    )


def test_an_unexplained_gap_says_on_what_it_depends_and_what_it_may_be():
    assert headline(UNEXPLAINED) == (
        "The tip is off by 0.41 mm RMS: no effect of the library explains it; it is a step from "
        "11.2 s of run-1 on at the tip, 0.14 mm along (0.9, 0.3, 0.1)."
    )
    assert headline(replace(UNEXPLAINED, causes=(UNSURE,))).endswith("; perhaps thermal (0.31).")


def test_no_gap_is_said_in_mm_where_the_tip_was_measured():
    none = replace(GAP, verdict="no_gap", causes=(), at_part=None)
    assert headline(none) == (
        "No gap: the tip is off by 0.41 mm RMS, which noise and normal mismatch explain."
    )
    joints = replace(none, links=(), gap=replace(GAP.gap, unit="deg", rms_before=0.0011))
    assert headline(joints) == "No gap: 0.0011 deg RMS are what noise and normal mismatch explain."
    assert "Nothing was compared" in headline(replace(none, links=(), gap=replace(GAP.gap, rms_before=None)))


def test_poses_whose_noise_nobody_knows_are_not_called_sound():
    noise = NoiseResult(stated=None, learnt=0.3, short=0.3, source="what no effect explains")
    links = tuple(replace(link, noise=noise) for link in GAP.links)
    none = replace(GAP, verdict="no_gap", causes=(), at_part=None, links=links)
    assert headline(none) == (
        "No gap is named, but the noise is unknown: the tip is off by 0.41 mm RMS, noise or a gap that no "
        "effect explains."
    )
    stated = tuple(replace(link, noise=replace(noise, stated=0.3)) for link in GAP.links)
    assert headline(replace(none, links=stated)).endswith("which noise and normal mismatch explain.")


def test_a_slip_is_said_first_whatever_else_there_is():
    slip = replace(LAG, effect="tool_number", target=None, words="the tip is that of tool 3")
    assert headline(replace(GAP, causes=(BACKLASH, slip))) == "Set-up slip: the tip is that of tool 3."


@pytest.mark.parametrize(
    ("what", "link", "rms", "words"),
    [
        ("part", "part", 0.2, "The part is off by 0.20 mm RMS:"),
        ("force", "force", 12.3, "The measured force is off by 12 N RMS:"),
        ("joints", "gear", 0.0123, "The joints are off by 0.012 deg RMS:"),
        ("time", "timing", 0.25, "The robot is 0.25 s RMS early or late on its path:"),
        ("time", "gear", 0.00307, "Time stamps are off by 3.1 ms:"),
    ],
)
def test_what_is_off_in_the_unit_of_a_person(what, link, rms, words):
    unit = {"part": "mm", "force": "N", "joints": "deg", "time": "s"}[what]
    at = AtPart(what=what, unit=unit, rms_before=rms, rms_after=None, noise=None, link=link)
    assert headline(replace(GAP, at_part=at)).startswith(words)


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (0.95, ", nearly all of it after reversals of axis 2: "),
        (0.8, ", four fifths of it after reversals of axis 2: "),
        (0.65, ", two thirds of it after reversals of axis 2: "),
        (0.55, ", half of it after reversals of axis 2: "),
        (0.4, "RMS: "),
    ],
)
def test_the_phase_with_most_of_the_gap_is_in_the_sentence(share, words):
    assert words in headline(replace(GAP, where=where(share)))


def test_a_phase_in_which_the_robot_merely_is_most_of_the_time_is_not():
    """A constant offset has most of its power where most of the time is spent."""
    assert "in air" not in headline(replace(GAP, where=where(0.6, "air", rms=0.3)))
    assert "in air" not in headline(replace(GAP, where=where(1.0, "air", rms=0.3)))
    assert "two thirds of it in air" in headline(replace(GAP, where=where(0.6, "air", rms=0.8)))


@pytest.mark.parametrize(
    ("phase", "words"),
    [("corner", "at corners"), ("entry", "where the cutter enters"), ("exit", "where it leaves")],
)
def test_phases_have_words_of_their_own(phase, words):
    assert f", nearly all of it {words}: " in headline(replace(GAP, where=where(0.95, phase)))


def test_where_nothing_was_held_out_the_share_or_nothing_is_said():
    unknown = replace(GAP, at_part=replace(TIP, rms_after=None))
    assert "With it in the model 98% of the gap is gone on data not used." in headline(unknown)
    neither = replace(unknown, gap=replace(GAP.gap, shrink=None))
    assert headline(neither).endswith("0.021 deg ± 0.002.")


def test_amounts_and_stretches():
    assert amount(0.0031, "s") == "3.1 ms"
    assert amount(0.31, "s") == "0.31 s"
    assert amount(0.0031, "mm") == "0.0031 mm"
    assert stretch(STRETCH) == "run-1: 2.00-4.00 s, lines 120-131"
    assert stretch(replace(STRETCH, lines=(), t_start_s=-0.001)) == "run-1: 0.00-4.00 s"


def runs(*sizes):
    return tuple(
        RunSize(run=f"run-{number}", rms_before=size, rms_after=None, held_out=False)
        for number, size in enumerate(sizes, 1)
    )


@pytest.mark.parametrize(
    ("what", "sizes", "words"),
    [
        ("tip", (0.029, 0.159), "The tip is off by 0.11 mm RMS, 0.16 mm in run-2: backlash"),
        ("tip", (0.1, 0.12), "The tip is off by 0.11 mm RMS: backlash"),
        ("tip", (0.11,), "The tip is off by 0.11 mm RMS: backlash"),
    ],
)
def test_the_run_that_is_off_most_is_named_where_it_stands_out(what, sizes, words):
    at = replace(TIP, rms_before=0.114, per_run=runs(*sizes))
    assert headline(replace(GAP, at_part=at)).startswith(words)


def test_the_worst_run_and_the_phase_are_told_apart():
    at = replace(TIP, rms_before=0.114, per_run=runs(0.029, 0.159))
    assert headline(replace(GAP, at_part=at, where=where(0.8))).startswith(
        "The tip is off by 0.11 mm RMS, 0.16 mm in run-2, four fifths of the gap after reversals of axis 2:"
    )


def test_what_is_left_is_told_beside_what_there_was_on_the_same_data_where_that_is_another_size():
    at = replace(TIP, rms_before=0.114, rms_after=0.0201, held_out_before=0.029)
    said = headline(replace(GAP, at_part=at))
    assert said.startswith("The tip is off by 0.11 mm RMS: ")
    assert "With it in the model 0.020 mm of 0.029 mm are left on data not used" in said
    same = replace(at, held_out_before=0.11)
    assert "0.020 mm are left on data not used" in headline(replace(GAP, at_part=same))


BLOW = EventResult(
    link="force", run="run-2", t_s=11.8, line=42, what="impulse", size=1154.0, unit="N", lasts_s=0.04
)
SLIPPED = replace(
    LAG,
    effect="step",
    target="A2",
    probability=0.9,
    parameters={"at_s": Interval(6384.0, 6383.9, 6384.1), "size_deg": Interval(-0.0225, -0.023, -0.022)},
    moment=MomentResult(run="run-2", t_s=11.82, line=42),
)


def test_what_happened_is_told_before_the_step_that_it_left_behind():
    hit = replace(GAP, causes=(SLIPPED,), events=(BLOW,))
    assert headline(hit).startswith(
        "The tool hit something at 11.80 s of run-2, line 42: 1.2 kN; since then A2 is off by 0.0225 deg. "
        "The tip is off by 0.41 mm RMS: step of A2, at 11.82 s of run-2, line 42, -0.0225 deg"
    )
    later = replace(SLIPPED, moment=MomentResult(run="run-2", t_s=14.0, line=50))
    assert "since then" not in headline(replace(GAP, causes=(later,), events=(BLOW,)))


def test_one_reading_alone_is_no_blow_and_a_burst_is_not_in_the_first_sentence():
    alone = replace(
        GAP,
        verdict="unexplained",
        causes=(),
        events=(BLOW,),
        unexplained=replace(UNEXPLAINED.unexplained, depends_on=()),
    )
    assert headline(alone) == (
        "The force jumps at 11.80 s of run-2, line 42, for 40 ms: 1.2 kN. "
        "What else the runs differ by, noise and normal mismatch explain."
    )
    tip = replace(BLOW, link="mechanics", size=0.6, unit="mm")
    assert headline(replace(alone, events=(BLOW, tip))).startswith("The tool hit something")
    assert headline(replace(GAP, events=(replace(BLOW, what="burst"),))) == headline(GAP)
