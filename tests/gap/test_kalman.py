"""Innovations beside the dense covariance: variances, log determinant, and every row of a segment."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from gcode2krl.gap.noise.short import innovation_gains, innovations, transition_of

A = np.array([0.9, -0.3])
SLOW = [(0.98, 1.5)]


def covariance(count):
    """Return that of the short part, by its pulse response, plus that of the slow one."""
    h = [1.0, A[0]]
    for _ in range(400):
        h.append(A[0] * h[-1] + A[1] * h[-2])
    h = np.array(h)
    short = 0.6**2 * np.array([h[: len(h) - k] @ h[k:] for k in range(count)])
    return toeplitz(short + SLOW[0][1] ** 2 * SLOW[0][0] ** np.arange(count))


def test_innovations_are_those_of_the_dense_covariance():
    count = 60
    gains, variances = innovation_gains(A, 0.6, SLOW, count)
    factor = np.linalg.cholesky(covariance(count))
    np.testing.assert_allclose(np.sqrt(variances), np.diag(factor), rtol=1e-7)
    assert np.sum(np.log(variances)) == pytest.approx(np.linalg.slogdet(covariance(count))[1], rel=1e-7)
    values = np.random.default_rng(1).standard_normal((count, 3))
    white = innovations(values, np.array([[0, count]]), A, SLOW, gains, variances)
    np.testing.assert_allclose(white, np.linalg.solve(factor, values), rtol=1e-6, atol=1e-9)


def test_the_gain_settles_and_is_then_kept():
    _, variances = innovation_gains(A, 0.6, SLOW, 5000)
    assert len(variances) < 2000
    whole = np.diag(np.linalg.cholesky(covariance(300))) ** 2
    np.testing.assert_allclose(variances, whole[: len(variances)], rtol=1e-6)
    np.testing.assert_allclose(variances[-1], whole[len(variances) :], rtol=1e-6)


def test_without_a_slow_part_it_is_the_autoregressive_filter():
    gains, variances = innovation_gains(A, 0.6, [], 50)
    x = np.random.default_rng(2).standard_normal((50, 1))
    white = innovations(x, np.array([[0, 50]]), A, [], gains, variances)[:, 0]
    np.testing.assert_allclose(white[2:], (x[2:, 0] - A[0] * x[1:-1, 0] - A[1] * x[:-2, 0]) / 0.6, rtol=1e-9)


def test_states_are_the_short_parts_lags_and_each_slow_part():
    np.testing.assert_array_equal(
        transition_of(A, SLOW), [[0.9, 1.0, 0.0], [-0.3, 0.0, 0.0], [0.0, 0.0, 0.98]]
    )
    np.testing.assert_array_equal(transition_of(np.zeros(0), []), [[0.0]])
