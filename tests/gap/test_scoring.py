"""Surprise against SciPy's chi-square, thresholds by counting false alarms, scores against least squares."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import optimize, special, stats

from gcode2krl.gap.noise.nuisance import Column
from gcode2krl.gap.posterior.selection import scores, surprise, threshold
from tests.gap.constructed import gram, noise, trace

COUNT = 300
FALSE_ALARMS = 1e-3
"""Of each link, on runs without any effect."""
FREE = (np.array([-np.inf]), np.array([np.inf]))


def tail(gain, width):
    """Return -log P(chi-square > gain) by the closed form of its width, far beyond what a float can hold."""
    x = gain / 2.0
    if width % 2 == 0:  # the first terms of an exponential series (Abramowitz & Stegun 26.4.5)
        order = np.arange(width // 2)
        return x - special.logsumexp(order * np.log(x) - special.gammaln(order + 1.0))
    normal = np.log(2.0) + special.log_ndtr(-np.sqrt(gain))
    return -normal if width == 1 else -np.logaddexp(normal, np.log(2.0 * np.sqrt(x / np.pi)) - x)


@pytest.mark.parametrize("width", [1, 2, 3, 6])
def test_surprise_is_the_tail_of_chi_square(width):
    for gain in np.geomspace(0.1, 1e4, 40):
        if gain < 1300.0:
            assert tail(gain, width) == pytest.approx(-np.log(stats.chi2.sf(gain, width)), rel=1e-9)
        # above a gain of 200 by the first term of the series: right to its second, (width/2 - 1)/(gain/2)
        slack = 0.0 if gain < 200.0 else abs(width - 2.0) / gain * 1.1
        assert surprise(gain, width) == pytest.approx(tail(gain, width), rel=1e-8, abs=slack)


def test_no_gain_is_no_surprise():
    assert surprise(0.0, 2) == 0.0
    assert surprise(-5.0, 1) == 0.0


def test_more_gain_is_more_surprise_across_the_change_of_formula():
    gains = np.linspace(190.0, 210.0, 401)
    for width in (1, 2, 3, 6):
        values = np.array([surprise(gain, width) for gain in gains])
        assert np.diff(values).min() > -0.03  # the step where the formula changes is of the second term


@pytest.mark.parametrize("blocks", [1, 10, 60, 1000])
def test_the_largest_of_independent_blocks_passes_once_in_a_thousand(blocks):
    level = threshold(blocks)
    gain = optimize.brentq(lambda g: surprise(g, 1) - level, 1.0, 100.0)
    alarms = 1.0 - stats.chi2.cdf(gain, 1) ** blocks
    assert 0.999 * FALSE_ALARMS * (1.0 - FALSE_ALARMS) <= alarms <= FALSE_ALARMS * (1.0 + 1e-9)


def test_white_noise_passes_as_often_as_that():
    draws, blocks = 200_000, 8
    largest = np.max(np.random.default_rng(1).standard_normal((draws, blocks)) ** 2, axis=1)
    alarms = sum(surprise(gain, 1) > threshold(blocks) for gain in largest[largest > 9.0])
    low, high = stats.binom.ppf([1e-4, 1.0 - 1e-4], draws, FALSE_ALARMS)
    assert low <= alarms <= high


def test_the_statistic_of_white_noise_is_chi_square():
    signatures = np.random.default_rng(3).standard_normal((COUNT, 4))
    gains = []
    for seed in range(200):
        made = gram(trace(noise(COUNT, seed)), signatures)
        gains.append(scores(made, [Column(block(), 1, 2, *(np.repeat(b, 2) for b in FREE))])[0].gain)
    assert stats.kstest(gains, "chi2", args=(2,)).pvalue > 1e-3


def block(bent=False):
    """Return the block of an effect that is proportional to its size, or is not."""
    return SimpleNamespace(effect=SimpleNamespace(is_linear=not bent))


def scored(y, signatures, bent=False, **column):
    made = gram(trace(y[:, None]), signatures)
    given = {"block": block(bent), "first": 0, "width": 1, "low": FREE[0], "high": FREE[1]} | column
    return scores(made, [Column(**given)])[0]


def test_gain_and_coefficients_are_those_of_least_squares():
    generator = np.random.default_rng(4)
    x = 5.0 * generator.standard_normal((COUNT, 2))
    y = x @ [0.7, -0.4] + generator.standard_normal(COUNT)
    found = scored(y, x, width=2, low=np.full(2, -9.0), high=np.full(2, 9.0))
    expected, left, _, _ = np.linalg.lstsq(x, y, rcond=None)
    np.testing.assert_allclose(found.coefficients, expected, rtol=1e-3)
    assert found.gain == pytest.approx(float(y @ y - left[0]), rel=1e-4)
    assert found.surprise == pytest.approx(surprise(found.gain, 2))
    assert found.within


@pytest.mark.parametrize(
    ("size", "low", "high", "bent", "within"),
    [
        (0.5, 0.0, 1.0, False, True),
        (1.5, 0.0, 1.0, False, False),
        (-0.5, 0.0, 1.0, False, False),  # a negative backlash is none
        (-0.5, 0.0, 1.0, True, False),
        (1.5, 0.0, 1.0, True, True),  # of a bent effect the first order may go beyond by all of the range
        (2.5, 0.0, 1.0, True, False),
        (-0.5, -1.0, 1.0, False, True),
    ],
)
def test_coefficients_must_be_plausible(size, low, high, bent, within):
    x = 20.0 * np.sin(np.arange(COUNT))
    found = scored(size * x, x[:, None], low=np.array([low]), high=np.array([high]), bent=bent)
    assert found.within is within
    assert low <= found.coefficients[0] <= high
