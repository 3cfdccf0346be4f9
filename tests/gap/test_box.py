"""Least squares in a box."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from gcode2krl.gap.box import MOST, boxed


@pytest.mark.parametrize("seed", range(20))
def test_it_agrees_with_a_general_solver(seed):
    generator = np.random.default_rng(seed)
    rows, width = 60, 12
    n = generator.standard_normal((rows, width)) * generator.uniform(0.1, 3.0, width)
    y = n @ generator.uniform(-4.0, 4.0, width) + generator.standard_normal(rows)
    # with the cost of each number as a row of its own
    stacked, wanted = np.vstack([n, np.eye(width)]), np.concatenate([y, np.zeros(width)])
    best = lsq_linear(stacked, wanted, (-MOST, MOST), tol=1e-12)
    found = boxed(n.T @ n + np.eye(width), n.T @ y)
    np.testing.assert_allclose(found, best.x, atol=1e-6)
    assert np.abs(best.x).max() > MOST - 1e-6  # the case has numbers at their bounds


def test_nothing_to_fit_is_nothing():
    assert boxed(np.zeros((0, 0)), np.zeros(0)).shape == (0,)


def test_numbers_within_the_box_are_those_of_least_squares():
    a = np.array([[3.0, 1.0], [1.0, 2.0]])
    np.testing.assert_allclose(boxed(a, a @ [0.5, -1.0]), [0.5, -1.0], atol=1e-12)
