"""Constancy of a cause's size against sizes that are known part by part."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import library
from gcode2krl.gap.posterior import cause_tests
from gcode2krl.gap.posterior.cause_tests import constancy_of, intervals_of, spread_between_runs
from gcode2krl.gap.posterior.selection import examine
from tests.gap.constructed import LINK, applied, examined, motion, noise, question, split, trace, wave
from tests.gap.test_counted_once import examined as with_clocks
from tests.gap.test_counted_once import late_encoders

WAVE = wave(0.5, "ripple")
TIME_S = motion().time_s


def ripple(sizes, seed=0):
    """Return traces of runs, each with its own size of one wave (n,) in the first joint."""
    form = trace(np.zeros((500, 1))).sample([applied(WAVE, 1.0)])
    return [
        trace(np.asarray(size).reshape(-1, 1) * form + noise(500, seed + n, 0.1), number=n)
        for n, size in enumerate(sizes)
    ]


def judged(sizes):
    found = examined(ripple(sizes), [WAVE])
    (number,) = found.cause_numbers
    return constancy_of(found, number), found


def test_one_size_in_all_runs_is_constant():
    constant, found = judged([1.0, 1.0, 1.0])
    assert constant.p > 0.01
    assert constant.inconstancy < 0.03
    assert spread_between_runs(found, 0)[1] == 3


def test_a_size_that_differs_between_runs_is_not():
    """Sizes 0.7, 1.0, 1.3: the standard deviation is 0.3 of the mean."""
    constant, found = judged([0.7, 1.0, 1.3])
    assert constant.p < 1e-4
    assert constant.inconstancy == pytest.approx(0.3, abs=0.03)
    assert spread_between_runs(found, 0)[0] == pytest.approx(0.3, abs=0.03)


def test_a_size_that_grows_within_a_run_is_not():
    growing = np.where(TIME_S < 5.0, 0.7, 1.3)
    constant, _ = judged([growing, growing])
    assert constant.p < 1e-3
    assert constant.inconstancy > 0.2


def test_a_clock_is_one_number_in_all_joints():
    found = with_clocks([3.07e-3])
    constant = constancy_of(found, 0)
    assert constant.p > 0.01
    assert constant.inconstancy < 0.02


def test_a_clock_of_one_joint_alone_is_not():
    """A lag of one joint is fitted by a clock of all, and its size then differs from joint to joint."""
    one = late_encoders(0.0)
    late = late_encoders(4e-3)
    mixed = np.where(np.arange(6) == 1, late.measured, one.measured)
    asked = question([library()["clock"]], "q_load")
    found = examine(LINK["gear"], [replace(one, measured=mixed)], asked)
    for number in range(len(found.applied)):
        assert constancy_of(found, number).p < 1e-6


def test_clocks_that_were_set_run_by_run_still_differ():
    """Runs that are 4.5, 5.0 and 5.5 ms late are set to 5.0 before the clock of all is fitted."""
    found = with_clocks([5.5e-3, 4.5e-3, 5.0e-3])
    spread, runs = spread_between_runs(found, 0)
    assert runs == 3
    assert spread == pytest.approx(0.1, abs=0.01)
    half = 2.92 * 0.5e-3 / 3**0.5  # Student's quantile of the mean of three
    interval = intervals_of(found)[0]["offset_s"]
    assert interval.high - interval.low == pytest.approx(2.0 * half, rel=0.1)
    assert constancy_of(found, 0).p > 0.01  # 2 ms are normal


@pytest.mark.parametrize(
    ("sizes", "is_one"), [([1.0, 1.0, 1.0], True), ([0.9, 1.0, 1.1], True), ([0.5, 1.0, 1.5], False)]
)
def test_a_size_that_varies_by_more_than_a_fifth_is_not_one_number(sizes, is_one):
    constant, _ = judged(sizes)
    assert constant.is_one_number == is_one


def test_a_run_whose_own_zero_hides_the_effect_says_nothing_of_its_size():
    """A step that has happened before a run is constant in it, as the zero of the run's encoders is."""
    rows = np.ones(400, dtype=bool)
    step = np.where(np.arange(400) < 200, np.arange(400) >= 100, 1.0)  # in the first of two runs
    zeros = 1e3 * np.stack([np.arange(400) < 200, np.arange(400) >= 200], axis=1)
    both = cause_tests._Residual(
        left=noise(400, 1)[:, 0],
        change=5.0 * step,
        nuisance=split(zeros, np.repeat([0, 1], 200)),
        run=np.repeat([0, 1], 200),
        time_s=np.tile(np.arange(200.0), 2),
        component=np.zeros(400),
        inflation=1.0,
        set_share=np.zeros(2),
    )
    assert both.part(rows & (both.run == 0)).share == pytest.approx(0.0, abs=0.1)
    assert both.part(rows & (both.run == 1)) is None
