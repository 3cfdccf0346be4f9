"""Words of causes, numbers, dependences and the next run."""

from dataclasses import replace

import pytest

from gcode2krl.gap.answer.result import Course, EffectAt, Expectation, NextRun, Separates, UnknownAt
from gcode2krl.gap.answer.words import (
    alike,
    depends,
    describe,
    kind,
    listed,
    measured,
    next_run,
    number,
    rounded,
    unit_of,
    what_there_is,
)
from gcode2krl.gap.posterior.cause_tests import Constancy, Interval
from tests.gap.answered import BACKLASH, STEP


@pytest.mark.parametrize(
    ("value", "text"), [(None, "-"), (0.0, "0"), (1234.5678, "1.23e+03"), (0.000123456, "0.000123")]
)
def test_numbers_have_three_digits(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (1234.5678, "1235"), (0.4123, "0.41"), (12.34, "12"), (0.000123, "0.00012")],
)
def test_rounded_numbers_are_written_out_with_two_digits(value, text):
    assert rounded(value) == text


@pytest.mark.parametrize(
    ("value", "half", "text"),
    [
        (0.0212, 0.002, "0.021 deg ± 0.002"),
        (0.02124, 0.0012, "0.0212 deg ± 0.0012"),
        (123.4, 56.0, "123 deg ± 56"),
        (2.0, 0.0, "2 deg"),
        (2.0, float("inf"), "2 deg"),
    ],
)
def test_a_value_has_the_digits_that_its_interval_leaves(value, half, text):
    assert measured(Interval(value, value - half, value + half), "deg") == text


@pytest.mark.parametrize(
    ("name", "stem", "unit"),
    [
        ("gap_deg", "gap", "deg"),
        ("mm_per_h", "", "mm/h"),
        ("growth_per_m", "growth", "1/m"),
        ("torque_Nm", "torque", "Nm"),
        ("acc_cp_m_s2", "acc cp", "m/s²"),
        ("offset_s", "offset", "s"),
        ("mm", "", "mm"),
        ("scale", "scale", ""),
        ("hz", "", "Hz"),
        ("N_per_deg", "", "N/deg"),
        ("x_um_per_N", "x", "µm/N"),
        ("H_xx_N_rad", "H xx", "N/rad"),
    ],
)
def test_the_unit_of_a_parameter(name, stem, unit):
    assert unit_of(name) == (stem, unit)


def test_a_cause_with_its_numbers():
    frame = replace(
        BACKLASH,
        effect="base_frame",
        target=None,
        parameters={"x_mm": Interval(0.5, 0.45, 0.55), "scale": Interval(2.0, 1.5, 2.5)},
    )
    assert describe(frame) == "base frame, x 0.50 mm ± 0.05, scale 2.0 ± 0.5"
    assert describe(frame, most=1) == "base frame"
    around = {
        f"direction_{axis}": Interval(value, -1.0, 1.0)
        for axis, value in zip("xyz", (0.6, 0.0, 0.8), strict=True)
    }
    heated = replace(frame, effect="thermal", parameters={"mm_per_h": Interval(0.2, 0.1, 0.3), **around})
    assert describe(heated) == "thermal, 0.20 mm/h ± 0.10, along (0.60, 0, 0.80)"


def test_lists_and_what_a_cause_cannot_be_told_from():
    assert [listed([]), listed(["a"]), listed(["a", "b", "c"])] == ["", "a", "a, b and c"]
    others = [EffectAt("mastering", "A1"), EffectAt("base_frame", None)]
    assert alike(others) == "mastering of A1 or base frame"
    unknown = UnknownAt("A2", "reversals")
    assert alike([others[0], unknown]) == (
        "mastering of A1 or something that the library lacks (A2, reversals)"
    )


def test_dependences():
    assert depends(STEP) == ("tip, a step from 11.2 s of run-1 on, 0.14 mm along (0.9, 0.3, 0.1)")
    loop = replace(STEP, at="A2", on="own torque", form="loop", at_time_s=None, run=None, direction=None)
    assert depends(replace(loop, size=0.0123, unit="deg")) == "A2, a loop with own torque, 0.012 deg"
    assert depends(replace(loop, form="drift", on="wall clock", size=None)) == "A2, a drift with wall clock"
    assert depends(replace(loop, form="else", size=None)) == "A2, a function of own torque"
    assert depends(replace(loop, at="fz", size=None)) == "force, a loop with own torque"


def test_a_tone_has_its_frequency_and_a_course_its_ends_and_its_bend():
    tone = replace(
        STEP, on="tone", form="periodic", at_time_s=None, run=None, frequency_hz=7.304, direction=None
    )
    assert depends(tone) == "tip, a tone of 7.3 Hz, 0.14 mm"
    assert what_there_is(tone) == "a tone of 7.3 Hz at the tip, 0.14 mm"
    drift = replace(tone, on="time in the run", form="drift", frequency_hz=None)
    rising = Course(
        over="time in the run",
        over_unit="s",
        unit="mm",
        points=((1.0, 0.0), (5.0, 0.08), (9.0, 0.14)),
        run="run-2",
    )
    assert depends(replace(drift, course=rising)) == (
        "tip, a drift with time in the run, 0.14 mm, over time in the run of run-2: "
        "0 mm at 1.0 s to 0.14 mm at 9.0 s"
    )
    bent = replace(rising, points=((1.0, 0.0), (5.0, 0.14), (9.0, 0.02)), run=None)
    assert depends(replace(drift, course=bent)).endswith(
        "over time in the run: 0 mm at 1.0 s to 0.14 mm at 5.0 s to 0.020 mm at 9.0 s"
    )


def test_dependences_within_a_sentence():
    assert what_there_is(replace(STEP, direction=None)) == (
        "a step from 11.2 s of run-1 on at the tip, 0.14 mm"
    )
    places = {"A2": "in A2", "fx": "in the force", "timing": "in time"}
    for at, words in places.items():
        assert (
            what_there_is(replace(STEP, at=at, form="drift", size=None)) == f"a drift with {STEP.on} {words}"
        )


def test_the_kind_is_said_and_form_and_constancy_only_where_poor():
    assert kind(BACKLASH) is None
    good = replace(
        BACKLASH, family="A2, reversals", form_fits=0.99, constant=Constancy(inconstancy=0.02, p=0.6)
    )
    assert kind(good) == "of the kind A2, reversals"
    poor = replace(good, form_fits=0.7, constant=Constancy(inconstancy=0.4, p=0.011))
    assert kind(poor) == (
        "of the kind A2, reversals; its form takes 70% of what its kind takes; its size varies by 40% over "
        "runs and halves (p = 0.011)"
    )


def test_the_next_run_with_what_is_expected_in_either_case():
    run = NextRun(
        program="dwell",
        minutes=32.0,
        separates=(Separates(first="thermal", second="step", odds=31.2),),
        expect=(
            Expectation(answer="thermal", shows="0.05 mm after 30 min"),
            Expectation(answer="step", shows="nothing"),
        ),
    )
    assert next_run(run) == [
        "gcode2krl make-test dwell, 32 minutes",
        'tells "thermal" from "step", odds 31 to 1',
        "if thermal: 0.05 mm after 30 min",
        "if step: nothing",
    ]
    sure = replace(run, minutes=0.9, separates=(replace(run.separates[0], odds=1e9),))
    assert next_run(sure)[:2] == [
        "gcode2krl make-test dwell, a minute",
        'tells "thermal" from "step", odds over 1000 to 1',
    ]
