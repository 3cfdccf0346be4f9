"""The report: a sentence for each verdict, lines for links, places, causes and what is missing."""

from dataclasses import replace

import pytest

from gcode2krl.gap.choose.intervals import Interval
from gcode2krl.gap.tell.report import describe, headline, number, text_report
from gcode2krl.gap.tell.result import (
    CauseResult,
    Gap,
    GapSize,
    IntervalResult,
    JointResult,
    LinkResult,
    NotExamined,
    PhaseResult,
    Unexplained,
    Where,
)

BACKLASH = CauseResult(
    effect="backlash",
    target="A2",
    link="mechanics",
    probability=0.94,
    parameters={"gap_deg": Interval(0.0212, 0.0192, 0.0232)},
    shrink=0.976,
    rms_after=0.06,
)
LAG = replace(BACKLASH, effect="servo_lag", target="A4", parameters={}, probability=0.8, shrink=None)
UNSURE = replace(BACKLASH, effect="thermal", target=None, parameters={}, probability=0.31)
GAP = Gap(
    verdict="explained",
    gap=GapSize(signal="tcp", unit="mm", rms_before=0.4123, rms_after=0.0611, noise_floor=0.0304),
    links=(
        LinkResult(link="servo", rms_before=1e-3, rms_after=1e-3, noise=None, unit="deg", verdict="no_gap"),
        LinkResult(
            link="mechanics",
            rms_before=0.4123,
            rms_after=0.0611,
            noise=0.0304,
            unit="mm",
            verdict="explained",
        ),
    ),
    where=Where(),
    causes=(BACKLASH,),
    unexplained=Unexplained(rms=0.06, significant=False, structure="white"),
    not_examined=(NotExamined(link="force", needs="force.csv"),),
)


def where(share, phase="reversal", joints=("A2",)):
    return Where(
        phases=(PhaseResult(phase=phase, rms=0.5, share=share),),
        joints=tuple(JointResult(joint=joint, share=0.9) for joint in joints),
    )


def test_an_explained_gap():
    assert headline(GAP) == (
        "0.412 mm RMS at the tool tip: backlash of A2, gap 0.0212 ± 0.002 deg; with it in the model "
        "0.0611 mm on data not used; noise floor 0.0304 mm."
    )


def test_two_causes_and_a_rest():
    both = replace(
        GAP,
        verdict="partly_explained",
        causes=(BACKLASH, LAG, UNSURE),
        unexplained=replace(GAP.unexplained, significant=True),
    )
    assert headline(both) == (
        "0.412 mm RMS at the tool tip: backlash of A2, gap 0.0212 ± 0.002 deg and servo lag of A4; with them "
        "in the model more remain than noise explains: 0.0611 mm on data not used; noise floor 0.0304 mm."
    )


def test_no_gap():
    assert headline(replace(GAP, verdict="no_gap", causes=())) == (
        "No gap: 0.412 mm RMS are what noise and normal mismatch explain."
    )


def test_an_unexplained_gap_names_no_unsure_cause():
    assert headline(replace(GAP, verdict="unexplained", causes=(UNSURE,))) == (
        "0.412 mm RMS at the tool tip: no effect of the library explains it; noise floor 0.0304 mm."
    )


def test_a_slip_is_said_first_whatever_else_there_is():
    slip = replace(LAG, effect="tool_number", target=None, words="the tip is that of tool 3")
    assert headline(replace(GAP, causes=(BACKLASH, slip))) == "Set-up slip: the tip is that of tool 3."


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (0.95, ", nearly all of it after reversals of axis 2: "),
        (0.8, ", four fifths of it after reversals of axis 2: "),
        (0.65, ", two thirds of it after reversals of axis 2: "),
        (0.55, ", half of it after reversals of axis 2: "),
        (0.4, "at the tool tip: "),
    ],
)
def test_the_phase_with_most_of_the_gap_is_in_the_sentence(share, words):
    assert words in headline(replace(GAP, where=where(share)))


@pytest.mark.parametrize(
    ("phase", "words"),
    [
        ("corner", "at corners"),
        ("entry", "where the cutter enters"),
        ("exit", "where it leaves"),
        ("cruise", "while cutting"),
        ("air", "in air"),
    ],
)
def test_phases_have_words_of_their_own(phase, words):
    assert f", nearly all of it {words}: " in headline(replace(GAP, where=where(0.95, phase)))


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        ("force", "of force"),
        ("joint_actual", "of servo error"),
        ("joint_load", "behind the gears"),
        ("joint_commanded", "off the commanded path"),
        ("timing", "off in time"),
        ("scan", "on the part"),
    ],
)
def test_signals_have_words_of_their_own(signal, words):
    assert f"RMS {words}: " in headline(replace(GAP, gap=replace(GAP.gap, signal=signal)))


def test_a_cause_with_its_numbers():
    frame = replace(
        BACKLASH,
        effect="base_frame",
        target=None,
        parameters={"x_mm": Interval(0.5, 0.45, 0.55), "scale": Interval(2.0, 1.5, 2.5)},
    )
    assert describe(frame) == "base frame, x 0.5 ± 0.05 mm, scale 2 ± 0.5"


@pytest.mark.parametrize(
    ("value", "text"), [(None, "-"), (0.0, "0"), (1234.5678, "1.23e+03"), (0.000123456, "0.000123")]
)
def test_numbers_have_three_digits(value, text):
    assert number(value) == text


def test_the_whole_report_line_by_line():
    interval = IntervalResult(
        run="run-1",
        signal="tcp",
        t_start_s=3.1,
        t_end_s=3.9,
        lines=(120, 131),
        rms=0.8,
        what="reversal of A2",
    )
    some = replace(
        GAP,
        causes=(BACKLASH, UNSURE),
        where=Where(intervals=(interval, replace(interval, lines=()))),
        notes=("angles are relative",),
    )
    lines = text_report(some).splitlines()
    assert lines[1:] == [
        "",
        "link        before      after       noise       verdict",
        "servo       0.001       0.001       -           no_gap (deg)",
        "mechanics   0.412       0.0611      0.0304      explained (mm)",
        "",
        "where",
        "  run-1: 3.10-3.90 s, lines 120-131: 0.8 (reversal of A2)",
        "  run-1: 3.10-3.90 s: 0.8 (reversal of A2)",
        "",
        "causes",
        "  0.94 backlash of A2, gap 0.0212 ± 0.002 deg, takes 98% of the gap on data not used",
        "  0.31 thermal, takes 98% of the gap on data not used (not named)",
        "",
        "not examined",
        "  force: needs force.csv",
        "note: angles are relative",
    ]
    many = replace(some, where=Where(intervals=(interval,) * 11))
    assert "  … and 3 more" in text_report(many).splitlines()


def test_an_empty_report_is_its_sentence():
    bare = replace(GAP, verdict="no_gap", links=(), causes=(), not_examined=())
    assert text_report(bare) == headline(bare)
