"""The size of a gap: mean squares by hand, mismatch within its bounds by a general solver."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from gcode2krl.gap.choose.gap_size import Size, size_of_gap
from gcode2krl.gap.fit.noise import white
from tests.gap.constructed import applied, columns_nuisance, motion, noise, trace, wave

COUNT, SIGMA = 500, 0.5
SIGNIFICANT_SIGMA, LEAST_SHARE = 4.0, 0.1
"""Of an excess that counts (docs/thresholds.md)."""
TIME_S = motion().time_s
EFFECT = wave(2.0)
SINE = EFFECT.form(TIME_S)


def size(y, nuisance=(), effects=(), usual=(), count=1):
    traces = [trace(y[:, None], number=i) for i in range(count)]
    return size_of_gap(traces, [list(nuisance)] * count, [white(SIGMA)], effects, usual)


def test_before_and_after_are_mean_squares():
    y = 2.0 * SINE + noise(COUNT, 1, SIGMA)[:, 0]
    found = size(y, effects=[applied(EFFECT, 1.9)])
    assert found.before == pytest.approx(np.mean(y**2))
    assert found.after == pytest.approx(np.mean((y - 1.9 * SINE) ** 2))
    assert found.floor == found.noise == pytest.approx(SIGMA**2)
    assert found.excess == pytest.approx(found.after - SIGMA**2)
    assert found.excess_before == pytest.approx(found.before - SIGMA**2)
    assert found.largest_before == pytest.approx(np.abs(y).max())
    assert found.largest_after == pytest.approx(np.abs(y - 1.9 * SINE).max())
    assert found.rows == COUNT
    assert not found.significant


def test_components_add_up():
    y = np.column_stack([3.0 + noise(COUNT, 2, SIGMA)[:, 0], -4.0 + noise(COUNT, 3, SIGMA)[:, 0]])
    found = size_of_gap([trace(y)], [[]], [white(SIGMA), white(2.0 * SIGMA)], [])
    assert found.before == pytest.approx(np.mean(np.sum(y**2, axis=1)))
    assert found.noise == pytest.approx(5.0 * SIGMA**2)
    assert found.largest_before == pytest.approx(np.hypot(*y.T).max())


@pytest.mark.parametrize("height", [0.4, 4.0])
def test_the_floor_is_noise_and_the_mismatch_that_fits_best_within_its_bounds(height):
    """sqrt(sigma² + |N·b|²), at a height of 4 with b at its bound."""
    column = 0.6 * np.sign(SINE)
    y = height * np.sign(SINE) + noise(COUNT, 4, SIGMA)[:, 0]
    stacked = np.append(column / SIGMA, 1.0)[:, None]
    b = lsq_linear(stacked, np.append(y / SIGMA, 0.0), (-np.sqrt(3.0), np.sqrt(3.0)), tol=1e-14).x[0]
    assert bool(b > 1.732) is (height > 1.0)
    found = size(y, [columns_nuisance("mismatch", column)])
    assert found.floor == pytest.approx(SIGMA**2 + np.mean((column * b) ** 2), rel=1e-6)
    assert found.excess == pytest.approx(np.mean((y - column * b) ** 2) - SIGMA**2, rel=1e-6, abs=1e-9)
    assert found.before == pytest.approx(np.mean(y**2))  # what all runs share stays in the gap
    assert found.significant is (height > 1.0)


def test_a_runs_own_clock_or_zero_is_taken_out_of_before_and_after():
    column = np.ones(COUNT)
    y = 1.2 + SINE + noise(COUNT, 5, SIGMA)[:, 0]
    found = size(y, [columns_nuisance("zero", column, shared=False)], [applied(EFFECT, 1.0)])
    b = np.sum(y - SINE) / SIGMA**2 / (COUNT / SIGMA**2 + 1.0)
    assert found.before == pytest.approx(np.mean((y - b) ** 2))
    assert found.after == pytest.approx(np.mean((y - b - SINE) ** 2))
    assert found.floor == pytest.approx(SIGMA**2)


def test_what_is_usual_is_out_of_both():
    slow = wave(0.3)
    y = 2.0 * SINE + 0.7 * slow.form(TIME_S) + noise(COUNT, 6, SIGMA)[:, 0]
    found = size(y, effects=[applied(EFFECT, 2.0)], usual=[applied(slow, 0.7)])
    assert found.before == pytest.approx(np.mean((y - 0.7 * slow.form(TIME_S)) ** 2))
    assert found.after == pytest.approx(np.mean((y - 0.7 * slow.form(TIME_S) - 2.0 * SINE) ** 2))


def test_the_deviation_is_that_of_means_over_seconds():
    """By the median absolute deviation, times 1.4826 for that of a normal distribution."""
    y = noise(COUNT, 7, SIGMA)[:, 0]
    means = np.array([np.mean(y[50 * i : 50 * i + 50] ** 2) for i in range(10)])
    spread = 1.4826 * np.median(np.abs(means - np.median(means)))
    assert size(y).deviation == pytest.approx(spread / np.sqrt(10.0), rel=1e-6)
    assert size(y, count=3).deviation == pytest.approx(spread / np.sqrt(30.0), rel=1e-6)


@pytest.mark.parametrize(
    ("seconds", "count"),
    [
        (60.0, 100),
        pytest.param(
            10.0,
            400,
            marks=pytest.mark.xfail(
                strict=True,
                reason="four deviations, said to be one in 30,000, are one in 200 by ten stretches: "
                "a median of ten absolute deviations is often half of what it should be",
            ),
        ),
    ],
)
def test_white_noise_is_hardly_ever_significant(seconds, count):
    rows = round(seconds / 0.02)
    alarms = sum(size(noise(rows, 100 + seed, SIGMA)[:, 0]).significant for seed in range(count))
    assert alarms == 0


PLAIN = Size(
    rows=100,
    before=10.0,
    after=3.0,
    floor=2.0,
    noise=1.0,
    excess=1.0,
    excess_before=8.0,
    deviation=0.1,
    largest_before=9.0,
    largest_after=4.0,
)


def test_shares_by_hand():
    assert PLAIN.shrink == pytest.approx(1.0 - (3.0 - 2.0) / (10.0 - 2.0))
    assert PLAIN.share_left == pytest.approx(1.0 / 8.0)
    assert replace(PLAIN, after=1.5).shrink == 1.0  # below the floor: all is gone
    assert replace(PLAIN, after=30.0).shrink == 0.0
    assert replace(PLAIN, before=1.9).shrink == 0.0  # no gap, nothing to shrink
    assert replace(PLAIN, excess=-1.0).share_left == 0.0


def test_significance_needs_both_a_certain_excess_and_one_that_counts():
    by_deviation = replace(PLAIN, deviation=1.0, noise=1.0)
    assert not replace(by_deviation, excess=0.99 * SIGNIFICANT_SIGMA).significant
    assert replace(by_deviation, excess=1.01 * SIGNIFICANT_SIGMA).significant
    by_share = replace(PLAIN, deviation=1e-9, noise=2.0)
    assert not replace(by_share, excess=0.99 * LEAST_SHARE * 2.0).significant
    assert replace(by_share, excess=1.01 * LEAST_SHARE * 2.0).significant
