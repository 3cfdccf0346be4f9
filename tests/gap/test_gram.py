"""Least squares in a box and columns by runs: against SciPy's solvers and the whole array."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.sparse import csr_array

from gcode2krl.gap.posterior.gram import MOST, boxed
from tests.gap.constructed import split

# Least squares in a box: against SciPy's solvers and the conditions of the least

FITS = 300


def columns(kind, generator):
    """Return the columns (rows, width) of a fit: how they hang together is its kind."""
    rows, width = 80, int(generator.integers(4, 40))
    own = generator.standard_normal((rows, width))
    common = generator.standard_normal((rows, width // 4))
    shared = common @ generator.standard_normal((width // 4, width)) * generator.uniform(1.0, 5.0)
    correlated = shared + own * generator.uniform(0.05, 1.0)
    if kind == "independent":
        return own * generator.uniform(0.1, 3.0, width)
    if kind == "rank-deficient":
        return shared
    if kind == "equal":
        return np.column_stack([correlated, correlated[:, :2], -correlated[:, 2:4]])
    if kind == "badly scaled":
        return correlated * 10.0 ** generator.uniform(-4.0, 4.0, width)
    if kind == "strong":
        return correlated * 1e4
    return correlated


def fits(kind, count=FITS):
    """Yield fits of columns (rows, width) to data (rows,) that drive some numbers to their bounds."""
    for seed in range(count):
        generator = np.random.default_rng(seed)
        n = columns(kind, generator)
        y = n @ generator.uniform(-4.0, 4.0, n.shape[1]) + generator.standard_normal(len(n))
        yield n, y


def normal(n, y):
    """Return the matrix and the right side of a fit in which each number costs its square."""
    return n.T @ n + np.eye(n.shape[1]), n.T @ y


def chi2(n, y, b):
    """Return what is to be least."""
    return float(np.sum((y - n @ b) ** 2) + b @ b)


def least(n, y, method):
    """Return SciPy's fit, with the cost of each number as a row of its own."""
    width = n.shape[1]
    stacked, wanted = np.vstack([n, np.eye(width)]), np.concatenate([y, np.zeros(width)])
    return lsq_linear(stacked, wanted, (-MOST, MOST), method=method, tol=1e-14, max_iter=2000).x


def excess(a, right, b):
    """Return an upper bound of how far chi2 is above its least, from slopes alone.

    It is the duality gap of a convex function in a box (Frank & Wolfe 1956): zero exactly where the
    conditions of Karush, Kuhn and Tucker hold.
    """
    slope = a @ b - right
    return float(2.0 * np.sum(slope * b + MOST * np.abs(slope)))


def rounding(a, b):
    """Return what an error in the last digits of a slope makes of chi2."""
    return 1e-6 + 1e-11 * float(np.abs(b) @ np.abs(a) @ np.abs(b))


KINDS = ["independent", "correlated", "rank-deficient", "equal", "badly scaled", "strong"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_fit_is_the_least(kind):
    missed, at_bounds = [], 0
    for number, (n, y) in enumerate(fits(kind)):
        a, right = normal(n, y)
        b = boxed(a, right)
        assert np.abs(b).max() <= MOST
        at_bounds += bool((np.abs(b) == MOST).any())
        if not excess(a, right, b) <= rounding(a, b):
            missed.append(number)
    assert missed == []
    assert at_bounds > FITS / 2  # else nothing was tried


@pytest.mark.parametrize("method", ["bvls", "trf"])
@pytest.mark.parametrize("kind", KINDS)
def test_it_agrees_with_a_general_solver(kind, method):
    for n, y in fits(kind, 30):
        a, right = normal(n, y)
        b, best = boxed(a, right), least(n, y, method)
        assert chi2(n, y, b) <= chi2(n, y, best) + rounding(a, b)


def test_where_the_least_is_sharp_the_numbers_agree_too():
    for n, y in fits("independent", 40):
        np.testing.assert_allclose(boxed(*normal(n, y)), least(n, y, "bvls"), atol=1e-6)


def test_columns_that_are_equal_to_the_last_bit_are_no_failure():
    a = np.full((3, 3), 1e17) + np.eye(3)  # the unit is lost in rounding: singular as it stands
    b = boxed(a, np.full(3, 1e17))
    assert abs(b.sum() - 1.0) < 1e-6
    assert np.abs(b).max() <= MOST


def test_nothing_to_fit_is_nothing():
    assert boxed(np.zeros((0, 0)), np.zeros(0)).shape == (0,)


def test_numbers_within_the_box_are_those_of_least_squares():
    a = np.array([[3.0, 1.0], [1.0, 2.0]])
    np.testing.assert_allclose(boxed(a, a @ [0.5, -1.0]), [0.5, -1.0], atol=1e-12)


def test_a_number_at_its_bound_is_exactly_there():
    for scale in (1.0, 3.0, 0.7, 1e5):
        assert boxed(np.array([[scale]]), np.array([5.0 * scale])).tolist() == [MOST]


def test_chains_of_correlated_columns_agree_with_a_general_solver_number_by_number():
    """Correlation falls with distance, as r to the power |i - j|: the least is sharp, so numbers agree."""
    for seed in range(60):
        generator = np.random.default_rng(1000 + seed)
        width, r = int(generator.integers(3, 25)), generator.uniform(0.5, 0.95)
        covariance = r ** np.abs(np.subtract.outer(np.arange(width), np.arange(width)))
        n = generator.multivariate_normal(np.zeros(width), covariance, 4 * width)
        y = n @ generator.uniform(-4.0, 4.0, width) + generator.standard_normal(len(n))
        most = float(generator.uniform(0.5, 3.0))
        a, right = normal(n, y)
        stacked, wanted = np.vstack([n, np.eye(width)]), np.concatenate([y, np.zeros(width)])
        best = lsq_linear(stacked, wanted, (-most, most), method="bvls", tol=1e-14, max_iter=2000).x
        np.testing.assert_allclose(boxed(a, right, most), best, atol=1e-6)


def test_slopes_are_zero_inside_and_point_outwards_at_the_bounds():
    for kind in ("independent", "correlated"):
        for n, y in fits(kind, 60):
            a, right = normal(n, y)
            b = boxed(a, right)
            slope = right - a @ b
            size = np.abs(a) @ np.abs(b) + np.abs(right)
            inside = np.abs(b) < MOST
            assert np.all(np.abs(slope[inside]) < 1e-9 * size[inside])
            assert np.all(slope[~inside] * np.sign(b[~inside]) > -1e-9 * size[~inside])


# Columns by runs and components: against the whole array

GENERATOR = np.random.default_rng(1)


def test_split_columns_are_those_of_one_array():
    """Products, parts of the rows with some of the columns, and what is not zero: against the whole array."""
    components = np.repeat([0, 1, 2, 0, 1, 2], [40, 40, 40, 60, 60, 60])
    whole, columns = GENERATOR.standard_normal((300, 2)), GENERATOR.standard_normal((300, 7))
    columns[:120, 4:] = columns[120:, :2] = 0.0
    columns[np.ix_(components == 1, [3, 6])] = 0.0
    joined = replace(split(columns, components), whole=whole)
    dense = np.concatenate([whole, columns], axis=1)
    left, right = GENERATOR.standard_normal((5, 300)), GENERATOR.standard_normal((9, 4))
    sums = csr_array(left * (left > 1.0))
    some, kept = components == 1, np.array([True, False, True, True, False, True, True])
    part = joined.of(some, kept)
    inner = columns[np.ix_(some, kept)]
    assert sum(each.values.size for each in joined.parts) == np.count_nonzero(columns)
    assert all(
        np.shares_memory(each.values, joined.parts[i].values)
        for each, i in zip(part.parts, (1, 4), strict=True)
    )
    np.testing.assert_array_equal(joined.used(some), dense[some].any(axis=0))
    for found, expected in (
        (joined.dense, dense),
        (joined @ right, dense @ right),
        (left @ joined, left @ dense),
        (left[0] @ joined, left[0] @ dense),
        (sums @ joined, sums @ dense),
        (joined.gram, dense.T @ dense),
        (part.dense, inner),
        (part.gram, inner.T @ inner),
        (left[:, some] @ part, left[:, some] @ inner),
    ):
        np.testing.assert_allclose(found, expected, atol=1e-12)
