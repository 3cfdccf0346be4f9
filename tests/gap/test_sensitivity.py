"""What one effect of a fit says of the data: derivatives beside the others, gains on rows left out."""

import math

import numpy as np
import pytest

from gcode2krl.gap.posterior.likelihood import refit, sensitivity_of
from tests.gap.constructed import Added, applied, likelihood, motion, noise, trace, wave

SIGMA = 0.4
TIME_S = motion().time_s
ONE, TWO = wave(2.0), Added("mixed", lambda t: np.sin(4.0 * np.pi * t) + np.sin(6.0 * np.pi * t))
FORMS = np.stack([ONE.form(TIME_S), TWO.form(TIME_S)], axis=1)


def fitted(y, *effects):
    target = likelihood([trace(y[:, None])], sigma=SIGMA)
    return target, refit(target, [applied(each, 0.3) for each in effects])


def test_the_derivative_is_what_the_other_effects_cannot_explain():
    y = FORMS @ [1.0, 0.5] + noise(500, 1, SIGMA)[:, 0]
    found = sensitivity_of(*fitted(y, ONE, TWO), 0)
    rest = FORMS[:, 0] - FORMS[:, 1] * (FORMS[:, 0] @ FORMS[:, 1]) / (FORMS[:, 1] @ FORMS[:, 1])
    np.testing.assert_allclose(np.abs(found.jacobian[:, 0]), np.abs(rest) / SIGMA, atol=1e-6)
    np.testing.assert_allclose(found.information, rest @ rest / SIGMA**2, rtol=1e-6)
    left = y - FORMS @ np.linalg.lstsq(FORMS, y, rcond=None)[0]
    np.testing.assert_allclose(found.residual, left / SIGMA, atol=1e-2)


def test_the_gain_on_rows_left_out_is_that_of_fits_without_them():
    """Two groups of one effect, of equal power: each half is predicted by a fit to the other."""
    y = 0.5 * FORMS[:, 0] + noise(500, 2, SIGMA)[:, 0]
    found = sensitivity_of(*fitted(y, ONE), 0)
    x = FORMS[:, 0]
    halves = (slice(0, 250), slice(250, 500))
    gain = 0.0
    for held, kept in (halves, halves[::-1]):
        size = x[kept] @ y[kept] / (x[kept] @ x[kept])
        gain += (y[held] @ y[held] - np.sum((y[held] - size * x[held]) ** 2)) / SIGMA**2
    assert found.left_out_gain(y / SIGMA, 2) == pytest.approx(gain, rel=0.03)


def test_what_has_its_own_sign_in_each_half_gains_nothing_there():
    sign = np.where(TIME_S < 5.0, 1.0, -0.9)
    y = 0.8 * sign * FORMS[:, 0] + noise(500, 3, SIGMA)[:, 0]
    found = sensitivity_of(*fitted(y, ONE), 0)
    assert found.left_out_gain(y / SIGMA, 2) < 0.0
    assert found.inflation() > 3.0


def test_few_stretches_cannot_be_left_out():
    y = FORMS[:, 0] + noise(500, 4, SIGMA)[:, 0]
    assert sensitivity_of(*fitted(y, ONE), 0).left_out_gain(y / SIGMA, 11) == math.inf


def test_white_noise_inflates_by_nothing_on_the_whole():
    """At least 1 by definition; of ten stretches the scatter about 1 has a deviation of a half."""
    grown = [
        sensitivity_of(*fitted(FORMS[:, 0] + noise(500, 10 + seed, SIGMA)[:, 0], ONE), 0).inflation()
        for seed in range(20)
    ]
    assert min(grown) >= 1.0
    assert np.mean(grown) < 1.5
