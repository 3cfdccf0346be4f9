"""The size of a gap: mean squares by hand, mismatch within its bounds by a general solver."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import norm, t

from gcode2krl.gap.compare.events import command_changes
from gcode2krl.gap.noise.short import Noise, Slow, drawn_noise, white
from gcode2krl.gap.posterior.examination import Size, size_of_gap
from tests.gap.constructed import applied, columns_nuisance, motion, noise, trace, wave

pytestmark = pytest.mark.slow

COUNT, SIGMA = 500, 0.5
SIGNIFICANT_SIGMA = 4.0
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


def test_an_instrument_noisier_than_stated_is_no_gap_by_its_size():
    y = noise(COUNT, 5, 2.0 * SIGMA)
    stated = replace(white(1.4 * SIGMA), beyond=SIGMA * float(np.sqrt(4.0 - 1.4**2)))
    assert size_of_gap([trace(y)], [[]], [replace(stated, beyond=0.0)], []).significant
    assert not size_of_gap([trace(y)], [[]], [stated], []).significant
    assert size_of_gap([trace(y + 3.0 * SINE[:, None])], [[]], [stated], []).significant


@pytest.mark.parametrize(("in_step", "is_gap"), [(True, True), (False, False)])
def test_what_is_loud_for_moments_is_a_gap_where_the_command_changes(in_step, is_gap):
    y, inputs = noise(3000, 7, SIGMA), motion(60.0)
    # joints that begin and end a way of a second, every seven seconds
    since = np.clip(inputs.time_s % 7.0, 0.0, 1.0) + np.floor(inputs.time_s / 7.0)
    inputs = replace(inputs, q_cmd_rad=inputs.q_cmd_rad[:1] + 0.02 * since[:, None])
    at = np.flatnonzero(command_changes(trace(y, inputs=inputs)) == in_step)
    assert 0.02 < len(at) / len(y) < 0.98
    for row in at[:: len(at) // 20]:
        y[row : row + 10] *= 5.0
    found = size_of_gap([trace(y, inputs=inputs)], [[]], [white(SIGMA)], [])
    assert found.calm_excess < 4.0 * found.deviation
    assert found.significant == is_gap


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


def test_the_deviation_joins_the_noises_model_and_the_scatter_between_seconds():
    """Of ten degrees of freedom the model's, of 0.37 a stretch the scatter's; never less than the model's."""
    steady = noise(COUNT, 7, SIGMA)[:, 0]
    growing = steady * np.linspace(0.2, 1.8, COUNT)
    model = 2.0 / COUNT * SIGMA**4
    assert size(steady).deviation == pytest.approx(np.sqrt(model))
    assert size(steady, count=3).deviation == pytest.approx(np.sqrt(model / 3.0))
    means = np.array([np.mean(growing[50 * i : 50 * i + 50] ** 2) for i in range(10)])
    scatter = (1.4826 * np.median(np.abs(means - np.median(means)))) ** 2 / 10.0
    joined = (10.0 * model + 0.37 * 9.0 * scatter) / (10.0 + 0.37 * 9.0)
    assert size(growing).deviation == pytest.approx(np.sqrt(joined), rel=1e-6)
    assert size(growing).freedom == pytest.approx(10.0 + 0.37 * 9.0)


def test_the_model_s_deviation_is_that_of_drawn_noise():
    """Mean squares of noise with a slow part scatter far more than those of white noise of the same power."""
    slow = Noise(np.array([0.5]), 1.0, 1.0 / np.sqrt(0.75), (Slow(np.exp(-0.02 / 0.5), 1.5),))
    squares = [np.mean(drawn_noise(slow, COUNT, np.random.default_rng(seed)) ** 2) for seed in range(2000)]
    c = slow.autocovariance(COUNT)
    assert c[0] == pytest.approx(slow.sigma**2)
    predicted = np.sqrt(2.0 / COUNT * (c[0] ** 2 + 2.0 * np.sum(c[1:] ** 2)))
    assert np.std(squares) == pytest.approx(predicted, rel=0.07)
    found = size_of_gap([trace(np.zeros((COUNT, 1)))], [[]], [slow], [])
    assert found.deviation > predicted  # the rms of the slow part is learnt


@pytest.mark.parametrize(("seconds", "count"), [(60.0, 100), (10.0, 400), (5.0, 400)])
def test_white_noise_is_hardly_ever_significant(seconds, count):
    rows = round(seconds / 0.02)
    alarms = sum(size(noise(rows, 100 + seed, SIGMA)[:, 0]).significant for seed in range(count))
    assert alarms == 0


@pytest.mark.parametrize("seconds", [5.0, 20.0])
def test_slow_noise_is_hardly_ever_significant(seconds):
    rows = round(seconds / 0.02)
    slow = Noise(np.zeros(0), 1.0, 1.0, (Slow(np.exp(-0.02 / 1.0), 1.0),))
    alarms = 0
    for seed in range(200):
        x = drawn_noise(slow, rows, np.random.default_rng(seed))
        alarms += size_of_gap([trace(x[:, None])], [[]], [slow], []).significant
    assert alarms <= 1


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


def test_few_stretches_need_more_deviations():
    """A t distribution of 11.5 degrees of freedom beyond about six is as rare as a normal one beyond four."""
    certain = replace(PLAIN, deviation=1.0, noise=1.0, freedom=11.5)
    rare = norm.sf(SIGNIFICANT_SIGMA)
    assert not replace(certain, calm_excess=0.99 * t.isf(rare, 11.5)).significant
    assert replace(certain, calm_excess=1.01 * t.isf(rare, 11.5)).significant
    assert 5.5 < t.isf(rare, 11.5) < 6.5


def test_an_excess_is_significant_by_its_deviation_whatever_the_noise():
    certain = replace(PLAIN, deviation=1.0)
    for noise_power in (1.0, 1e6):
        beside = replace(certain, noise=noise_power)
        assert not replace(beside, calm_excess=0.99 * SIGNIFICANT_SIGMA).significant
        assert replace(beside, calm_excess=1.01 * SIGNIFICANT_SIGMA).significant


def test_an_event_in_a_few_rows_is_no_excess_and_a_wander_below_a_tenth_of_the_noise_is():
    spike = noise(5000, 8, SIGMA)[:, 0]
    spike[2000:2012] += 100.0 * SIGMA
    found = size(spike)
    assert found.excess > 10.0 * SIGMA**2
    assert not found.significant
    assert abs(found.calm_excess) < 0.1 * SIGMA**2
    wander = noise(60_000, 9, SIGMA)[:, 0] + 0.35 * SIGMA * np.sign(np.sin(np.arange(60_000) / 700.0))
    assert size(wander).significant
