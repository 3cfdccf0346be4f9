"""Intervals: how often they hold the truth, and the clusters of the sandwich they come from."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from gcode2krl.effects import Applied, Parameter, library
from gcode2krl.gap.compare.trace import stretches_of_all
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.posterior.cause_tests import covariance_of, intervals_of
from gcode2krl.gap.posterior.least_squares import Fitted, Numbers
from gcode2krl.gap.posterior.likelihood import Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.constructed import examined, motion, noise, question, refitted, trace, wave


def run_of(seconds, components=2, begins_s=0.0, rate_hz=4.0):
    """Return as much of a part as stretches are numbered by."""
    time_s = begins_s + np.arange(int(seconds * rate_hz)) / rate_hz
    return SimpleNamespace(
        time_s=time_s, inputs=SimpleNamespace(time_s=np.zeros(1)), shape=(len(time_s), components)
    )


@pytest.mark.parametrize("seconds", [15, 1_500, 250_000])
def test_runs_of_any_length_share_no_stretch(seconds):
    runs = [run_of(seconds), run_of(30, components=3), run_of(seconds)]
    numbers = np.split(stretches_of_all(runs), np.cumsum([run.shape[0] * run.shape[1] for run in runs])[:-1])
    distinct = [set(each.tolist()) for each in numbers]
    count = min(seconds, THRESHOLDS.compare.stretches_most)
    assert [len(each) for each in distinct] == [count, 30, count]
    assert len(set.union(*distinct)) == 2 * count + 30


def test_a_table_that_begins_before_its_model_has_stretches_of_its_own():
    runs = [run_of(20), run_of(20, begins_s=-10.0)]
    first, second = np.split(stretches_of_all(runs), 2)
    assert not set(first.tolist()) & set(second.tolist())


def test_components_of_one_moment_are_in_one_stretch():
    numbers = stretches_of_all([run_of(5, components=3)]).reshape(3, -1)
    assert (numbers == numbers[0]).all()


def long_run(seconds, values):
    """Return a run of one row a second whose model is one number, and its measured values."""
    run = run_of(seconds, 1, rate_hz=1.0)
    run.measured = values[:, None]
    run.segments = np.array([[0, seconds]], dtype=np.int64)
    run.sample = lambda applied: np.full((seconds, 1), sum(each[0] for each in applied))
    return run


def test_an_interval_does_not_shrink_because_runs_are_long():
    """Clusters of two runs under one number take out each other's scores."""
    # what one run pulls up in its late seconds, the next one pulls down in its early ones
    seconds, rest = 2_000, np.full(2_000, 30.0)
    likelihood = Likelihood([long_run(seconds, rest), long_run(seconds, -rest)], [[], []], [white(1.0)])
    one = np.ones(1)
    free = SimpleNamespace(names=("x",), low=-9.0 * one, high=9.0 * one, scale=one, applied=lambda x: x)
    fitted = Fitted((np.zeros(1),), 0.0, Numbers((free,)), np.zeros(1), np.zeros((1, 1)))
    information = 4_000.0 + THRESHOLDS.posterior.prior_sizes**-2
    sizes = np.unique(likelihood.clusters, return_counts=True)[
        1
    ]  # a stretch of a run is a cluster of its own
    expected = np.sum((30.0 * sizes) ** 2) * len(sizes) / (len(sizes) - 1) / information**2
    assert len(sizes) == 2 * THRESHOLDS.compare.stretches_most
    assert covariance_of(likelihood, fitted)[0, 0] == pytest.approx(expected, rel=1e-9)


SIGMA, SIZE = 1e-4, 0.5e-4
EFFECT = wave(2.0)


def interval_of(y, sigma=SIGMA):
    """Return the interval of the size of a wave in some data."""
    made = examined([trace(y[:, None])], [EFFECT], sigma)
    assert len(made.applied) == 1
    return intervals_of(made)[0]["size_rad"]


def test_nine_in_ten_intervals_hold_the_truth():
    """An effect of eight deviations; 3 % of its size, what models are off by, widen the interval by 1 %."""
    held, count = 0, 200
    form = EFFECT.form(motion(5.0).time_s)
    size = 8.0 * SIGMA / np.sqrt(form @ form)
    made = examined([trace(size * form[:, None])], [EFFECT], SIGMA)
    for seed in range(count):
        data = trace(size * form[:, None] + noise(250, 1000 + seed, SIGMA))
        found = intervals_of(refitted(made, data, SIGMA))[0]["size_rad"]
        held += found.low <= size <= found.high
    low, high = stats.binom.ppf([1e-3, 1.0 - 1e-3], count, 0.9)
    assert low <= held <= high


def test_an_interval_is_that_of_least_squares():
    form = EFFECT.form(motion(5.0).time_s)
    found = interval_of(8.0 * SIZE * form + noise(250, 1, SIGMA)[:, 0])
    half = 1.645 * SIGMA / np.sqrt(form @ form)
    expected = np.hypot(half, 0.03 * found.value)
    # quantiles of 400 draws are right to a tenth of a deviation
    assert found.value - found.low == pytest.approx(expected, rel=0.1)
    assert found.high - found.value == pytest.approx(expected, rel=0.1)


def test_noise_that_keeps_its_sign_for_a_second_widens_it():
    """The sandwich by hand: H = |s|²/sigma², B = the sum of squared scores of each second."""
    time_s = motion(20.0).time_s
    form = EFFECT.form(time_s)
    sign = np.repeat(np.random.default_rng(2).choice([-1.0, 1.0], 20), 50)
    y = (2.0 + 0.6 * sign) * SIGMA * form + noise(1000, 3, SIGMA)[:, 0]
    found = interval_of(y)
    rest = y - found.value * form
    scores = [form[50 * i : 50 * i + 50] @ rest[50 * i : 50 * i + 50] / SIGMA**2 for i in range(20)]
    plain = SIGMA / np.sqrt(form @ form)
    robust = np.sqrt(np.sum(np.square(scores)) * 20.0 / 19.0) * plain**2
    assert robust > 2.0 * plain
    expected = np.hypot(1.645 * robust, 0.03 * found.value)
    assert (found.high - found.low) / 2.0 == pytest.approx(expected, rel=0.1)


def test_an_angle_near_zero_has_an_interval_about_zero_and_a_count_has_none():
    swing = library()["transmission"]
    truth = Applied(swing, "A2", {"amplitude_deg": 0.004, "harmonic": 2.0, "phase": 0.02})
    nominal = trace(np.zeros((500, 2)), "gear")
    residual = nominal.sample([truth]) - nominal.nominal + noise(500, 4, 1e-5, 2)
    made = examined([trace(residual, "gear")], question([swing], "A2"), 1e-5)
    (found,) = intervals_of(made)
    assert found["harmonic"] == (2.0, 2.0, 2.0)
    phase = found["phase"]
    assert 0.01 < phase.high - phase.low < 0.5
    off = (phase.value - 0.02 + np.pi) % (2.0 * np.pi) - np.pi
    assert phase.low - phase.value < -off < phase.high - phase.value


class HalfSeen(type(EFFECT)):
    """A wave with a second size that does nothing."""

    def __init__(self):
        super().__init__("half_seen", EFFECT.form)
        unseen = Parameter(
            "unseen_mm", "mm", -90.0, 90.0, nominal=0.0, start=1.0, source="a test", linear=True
        )
        self.parameters = (*self.parameters, unseen)


def test_of_a_number_that_the_data_do_not_see_all_is_left_that_was_expected():
    """Normal with three typical sizes: nine in ten within 1.645 times that."""
    form = EFFECT.form(motion(5.0).time_s)
    data = [trace(8.0 * SIZE * form[:, None] + noise(250, 5, SIGMA))]
    (found,) = intervals_of(examined(data, [HalfSeen()], SIGMA))
    assert found["unseen_mm"].value == pytest.approx(0.0, abs=1e-6)
    assert found["unseen_mm"].high == pytest.approx(1.645 * 3.0, rel=0.15)
    assert found["unseen_mm"].low == pytest.approx(-1.645 * 3.0, rel=0.15)
    assert found["size_rad"].low < 8.0 * SIZE < found["size_rad"].high


def test_nothing_found_has_no_interval():
    assert intervals_of(examined([trace(noise(250, 6, SIGMA))], [EFFECT], SIGMA)) == []
