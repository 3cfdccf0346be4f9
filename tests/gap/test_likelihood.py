"""The likelihood and its fast view against dense textbook algebra on small cases.

The reference knows nothing of filters or Gram matrices: it writes down the covariance Σ = L·Lᵀ of the noise,
AR(3) and a slow part, and solves generalised least squares with it.
"""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.optimize import lsq_linear

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gap.noise.nuisance import Nuisance
from gcode2krl.gap.noise.short import Noise, Slow
from gcode2krl.gap.posterior.gram import MOST, cluster_scores, clustered_covariance, gain_inflation
from gcode2krl.gap.posterior.least_squares import (
    Box,
    Damped,
    Numbers,
    Shortened,
    derivative,
    gauss_newton,
    pattern_search,
)
from gcode2krl.gap.posterior.likelihood import Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS

PRIOR = THRESHOLDS.posterior.prior_sizes
NOISE = (
    Noise(np.array([0.6, -0.2, 0.1]), 0.5, 0.7),
    Noise(np.array([0.3, 0.25, -0.15]), 1.3, 1.5, (Slow(0.9, 0.8),)),
)
ROWS = ((17, ((0, 6), (6, 8), (8, 17))), (13, ((0, 13),)))
"""Rows and segments of two runs; one segment is shorter than the memory of the noise."""
STEP_S = 0.3
"""So that a stretch of one second holds three or four rows."""


# The dense reference


def dense_filter(noise, rows, segments):
    """Return L⁻¹ (n, n) of one component: of each segment the covariance of a stationary process."""
    pulse = [1.0]
    for row in range(1, 200):
        pulse.append(sum(a * pulse[row - lag] for lag, a in enumerate(noise.a, start=1) if lag <= row))
    lagged = [noise.scale**2 * np.dot(pulse[: 200 - lag], pulse[lag:]) for lag in range(rows)]
    for part in noise.slow:
        lagged = lagged + part.sigma**2 * part.pole ** np.arange(rows)
    inverse = np.zeros((rows, rows))
    for first, last in segments:
        covariance = toeplitz(lagged[: last - first])
        inverse[first:last, first:last] = np.linalg.inv(np.linalg.cholesky(covariance))
    return inverse


def block_diagonal(blocks):
    size = sum(len(block) for block in blocks)
    whole, at = np.zeros((size, size)), 0
    for block in blocks:
        whole[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return whole


def flat(columns):
    """Return columns (k, n, c) as (k·n, c), component after component."""
    return columns.reshape(columns.shape[0] * columns.shape[1], -1)


class LinearTrace:
    """A trace whose model is linear in an effect's numbers."""

    def __init__(self, number, rows, segments, generator):
        self.run_number = number
        self.time_s = STEP_S * np.arange(rows)
        self.inputs = SimpleNamespace(time_s=self.time_s)
        self.segments = np.array(segments, dtype=np.int64)
        self.measured = generator.standard_normal((rows, len(NOISE)))
        self.slopes = generator.standard_normal((len(NOISE), rows, 3))
        self.shape = self.measured.shape

    def sample(self, applied):
        x = np.concatenate([each.x for each in applied]) if applied else np.zeros(3)
        return (self.slopes @ np.pad(x, (0, 3 - len(x)))).T


@dataclass(frozen=True)
class LinearEffect:
    """The numbers of an effect, as they are."""

    x: np.ndarray


@dataclass(frozen=True)
class LinearFree:
    """What a fit moves of one."""

    names: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    scale: np.ndarray

    def applied(self, x):
        return LinearEffect(x)


class Case:
    """Two runs with shared and own nuisance, and the same as dense matrices."""

    def __init__(self, seed, size=1.0):
        generator = np.random.default_rng(seed)
        self.traces = [
            LinearTrace(number, rows, segments, generator) for number, (rows, segments) in enumerate(ROWS)
        ]
        k = len(NOISE)
        self.nuisance = []
        for trace in self.traces:
            n = len(trace.time_s)
            shared = [Nuisance("machine", True, size * generator.standard_normal((k, n, 2)))]
            if trace.run_number == 0:  # the other run does not have it
                shared.append(Nuisance("tool", True, size * generator.standard_normal((k, n, 1))))
            own = [Nuisance("clock", False, size * generator.standard_normal((k, n, 1)))]
            own.append(Nuisance("frame", False, size * generator.standard_normal((k, n, 2))))
            # own ones first in one run: places must not depend on the order
            self.nuisance.append([*own, *shared] if trace.run_number else [*shared, *own])
        self.signatures = [generator.standard_normal((k, len(t.time_s), 4)) for t in self.traces]
        self.likelihood = Likelihood(self.traces, self.nuisance, NOISE)
        self.numbers = Numbers(
            (
                LinearFree(("a",), np.array([-5.0]), np.array([5.0]), np.array([2.0])),
                LinearFree(("b", "c"), np.array([-1.0, -9.0]), np.array([1.0, 9.0]), np.array([1.0, 0.5])),
            )
        )
        self.x = np.array([0.4, 1.0, -2.0])  # the second stands at its bound
        self.applied = self.numbers.applied(self.x)

    def raw_residual(self, applied=()):
        return np.concatenate([(t.measured - t.sample(applied)).T.ravel() for t in self.traces])

    def inverse_root(self):
        """Return L⁻¹ (v, v) of all values."""
        return block_diagonal(
            [
                dense_filter(noise, len(trace.time_s), trace.segments.tolist())
                for trace in self.traces
                for noise in NOISE
            ]
        )

    def raw_nuisance(self):
        """Return N (v, m): machine 2, tool 1, then clock 1 and frame 2 of each run."""
        wide = []
        for trace, items in zip(self.traces, self.nuisance, strict=True):
            by_name = {each.name: flat(each.columns) for each in items}
            rows = len(by_name["machine"])
            whole = np.zeros((rows, 9))
            whole[:, :2] = by_name["machine"]
            whole[:, 2:3] = by_name.get("tool", 0.0)
            first = 3 + 3 * trace.run_number
            whole[:, first : first + 1], whole[:, first + 1 : first + 3] = by_name["clock"], by_name["frame"]
            wide.append(whole)
        return np.concatenate(wide)

    def raw_signatures(self):
        return np.concatenate([flat(each) for each in self.signatures])

    def raw_slopes(self):
        """Return ∂f/∂θ (v, 3) in typical sizes."""
        slopes = np.concatenate([flat(trace.slopes) for trace in self.traces])
        return slopes * self.numbers.box.scale

    def covariance(self):
        """Return Σ + N·Nᵀ (v, v)."""
        root = np.linalg.inv(self.inverse_root())
        n = self.raw_nuisance()
        return root @ root.T + n @ n.T

    def bounded(self, free=None, precision=()):
        """Return chi2, free coefficients and b by SciPy, from the whitened stacked system."""
        root, n = self.inverse_root(), self.raw_nuisance()
        free = np.zeros((len(n), 0)) if free is None else free
        m, p = n.shape[1], free.shape[1]
        prior = np.sqrt(np.asarray(precision, dtype=float)) if len(precision) else np.zeros(p)
        left = np.block(
            [
                [root @ free, root @ n],
                [np.zeros((m, p)), np.eye(m)],
                [np.diag(prior), np.zeros((p, m))],
            ]
        )
        right = np.concatenate([root @ self.raw_residual(self.applied), np.zeros(m + p)])
        bound = np.r_[np.full(p, np.inf), np.full(m, MOST)]
        fit = lsq_linear(left, right, (-bound, bound), method="bvls", tol=1e-15, max_iter=1000)
        return 2.0 * fit.cost, fit.x[:p], fit.x[p:]

    def gram(self, with_tangents=True):
        tangents = self.likelihood.tangents(self.numbers, self.x)
        if not with_tangents:
            tangents = [each[:, :, :0] for each in tangents]
        view = self.likelihood.gram(self.signatures)
        return view.beside(self.likelihood.data(self.applied, tangents))


SEEDS = range(6)


# Whitening and chi2


@pytest.mark.parametrize("seed", SEEDS)
def test_whitened_values_are_those_of_the_dense_filter(seed):
    case = Case(seed)
    whitened = case.likelihood.whiten([trace.measured for trace in case.traces])
    assert whitened == pytest.approx(case.inverse_root() @ case.raw_residual(), abs=1e-12)


def test_noise_of_the_model_is_white_behind_the_filter():
    """Σ of the stationary process, by its own autocovariance: behind the head the filter makes it 1."""
    noise, rows, settled = NOISE[0], 40, 400
    impulse = np.zeros(settled)
    impulse[0] = 1.0
    for t in range(1, settled):
        impulse[t] = sum(a * impulse[t - lag] for lag, a in enumerate(noise.a, start=1) if t >= lag)
    covariance = noise.scale**2 * np.array(
        [[impulse[: settled - abs(i - j)] @ impulse[abs(i - j) :] for j in range(rows)] for i in range(rows)]
    )
    inverse = dense_filter(noise, rows, [(0, rows)])
    white = inverse @ covariance @ inverse.T
    assert white[3:, 3:] == pytest.approx(np.eye(rows - 3), abs=1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_chi2_is_generalised_least_squares_while_nuisance_is_within_its_bounds(seed):
    case = Case(seed, size=3.0)
    residual = case.raw_residual(case.applied)
    expected = residual @ np.linalg.solve(case.covariance(), residual)
    _, _, b = case.bounded()
    assert np.abs(b).max() < MOST, "the case is one without a bound"
    assert case.likelihood.chi2(case.applied) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_chi2_with_nuisance_at_its_bounds_is_that_of_a_bounded_solver(seed):
    case = Case(seed, size=0.2)
    for trace in case.traces:
        trace.measured *= 20.0
    chi2, _, b = case.bounded()
    assert np.count_nonzero(np.abs(b) > MOST - 1e-9) >= 1, "the case drives nuisance to its bounds"
    residual = case.likelihood.residual(case.applied)
    assert residual @ residual == pytest.approx(chi2, rel=1e-8)
    rows = len(case.raw_residual())
    assert residual[rows:] == pytest.approx(b, abs=1e-7)
    root = case.inverse_root()
    expected = root @ (case.raw_residual(case.applied) - case.raw_nuisance() @ b)
    assert residual[:rows] == pytest.approx(expected, abs=1e-6)


# Derivatives and information


@pytest.mark.parametrize("seed", SEEDS)
def test_the_unbounded_jacobian_is_the_projected_analytic_one(seed):
    case = Case(seed)
    jacobian = case.likelihood.jacobian(case.numbers, case.x, bounded=False)
    slopes = case.raw_slopes()
    information = slopes.T @ np.linalg.solve(case.covariance(), slopes)
    assert jacobian.T @ jacobian == pytest.approx(information, rel=1e-8, abs=1e-8)
    residual = case.likelihood.projected(case.likelihood.whiten(case_residuals(case))[:, None])[:, 0]
    gradient = -slopes.T @ np.linalg.solve(case.covariance(), case.raw_residual(case.applied))
    assert jacobian.T @ residual == pytest.approx(gradient, rel=1e-8, abs=1e-8)


def case_residuals(case):
    return [trace.measured - trace.sample(case.applied) for trace in case.traces]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_bounded_jacobian_is_the_same_where_nothing_is_at_its_bound(seed):
    case = Case(seed, size=3.0)
    bounded = case.likelihood.jacobian(case.numbers, case.x)
    assert bounded == pytest.approx(case.likelihood.jacobian(case.numbers, case.x, bounded=False), abs=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_tangents_of_a_linear_effect_are_its_slopes(seed):
    case = Case(seed)
    for without, kept in (((), [0, 1, 2]), ((0,), [1, 2]), ((1,), [0])):
        tangents = case.likelihood.tangents(case.numbers, case.x, without)
        expected = case.raw_slopes()[:, kept]
        assert np.concatenate([flat(each) for each in tangents]) == pytest.approx(expected, abs=1e-10)


# The fast view


@pytest.mark.parametrize("seed", SEEDS)
def test_inner_products_of_the_fast_view_are_those_of_the_dense_covariance(seed):
    case = Case(seed, size=3.0)
    columns = np.column_stack([case.raw_residual(case.applied), case.raw_slopes(), case.raw_signatures()])
    expected = columns.T @ np.linalg.solve(case.covariance(), columns)
    assert case.gram().marginal == pytest.approx(expected, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize(("size", "loud"), [(3.0, 1.0), (0.2, 20.0)])
@pytest.mark.parametrize("seed", SEEDS)
def test_gains_are_likelihood_ratios_of_the_bounded_fit(seed, size, loud):
    case = Case(seed, size)
    for trace in case.traces:
        trace.measured *= loud
    gram = case.gram()
    slopes, signatures = case.raw_slopes(), case.raw_signatures()
    without, _, _ = case.bounded(slopes)
    assert gram.chi2 == pytest.approx(without, rel=1e-8)
    for columns in ([0], [2], [1, 3], [0, 1, 2, 3]):
        free = np.column_stack([slopes, signatures[:, columns]])
        precision = np.r_[np.zeros(3), np.full(len(columns), PRIOR**-2)]
        with_them, coefficients, _ = case.bounded(free, precision)
        gain, found = gram.gain(np.array(columns))
        assert gain == pytest.approx(without - with_them, rel=1e-8, abs=1e-8 * without)
        assert found == pytest.approx(coefficients[3:], abs=1e-7 * max(1.0, np.abs(coefficients).max()))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_observable_share_is_the_power_that_nuisance_leaves(seed):
    case = Case(seed, size=3.0)
    root, signatures = case.inverse_root(), case.raw_signatures()
    left = np.diag(signatures.T @ np.linalg.solve(case.covariance(), signatures))
    whole = np.sum((root @ signatures) ** 2, axis=0)
    for columns in ([1], [0, 3]):
        share, power = case.gram().observable(np.array(columns))
        assert share == pytest.approx(min(left[columns] / whole[columns]), rel=1e-8)
        assert power == pytest.approx(min(left[columns]), rel=1e-8)


def brute_force_clusters(case):
    """Return the number of the stretch of each value: run by run, whole seconds, all components."""
    numbers = []
    for trace in case.traces:
        for _ in NOISE:
            numbers += [(trace.run_number, int(t)) for t in trace.time_s]
    return numbers


@pytest.mark.parametrize("seed", SEEDS)
def test_inflation_is_whites_estimator_of_the_linear_fit(seed):
    """Signatures projected off tangents and nuisance row by row; scores summed in plain loops."""
    case = Case(seed, size=3.0)
    root, n = case.inverse_root(), case.raw_nuisance()
    r, s = root @ case.raw_residual(case.applied), root @ case.raw_signatures()
    others = np.column_stack([root @ case.raw_slopes(), root @ n])
    prior = np.diag(np.r_[np.zeros(3), np.ones(9)])  # b has unit variance, tangents are free
    explained = np.linalg.solve(others.T @ others + prior, others.T @ np.column_stack([r, s]))
    rest, projected = r - others @ explained[:, 0], s - others @ explained[:, 1:]
    for columns in ([2], [0, 3]):
        x = projected[:, columns]
        information = s[:, columns].T @ x
        coefficients = np.linalg.solve(information, s[:, columns].T @ rest)
        left = rest - x @ coefficients
        sums = {}
        for row, cluster in enumerate(brute_force_clusters(case)):
            sums[cluster] = sums.get(cluster, 0.0) + x[row] * left[row]
        meat = sum(np.outer(u, u) for u in sums.values())
        grown = np.trace(np.linalg.inv(information) @ meat) / len(columns)
        expected = max(1.0, grown * len(sums) / (len(sums) - len(columns) - 1))
        assert case.gram().inflation(np.array(columns)) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_inflation_holds_nuisance_that_is_at_its_bounds(seed):
    """With b held, the score of a signature is that of the bounded fit without it."""
    case = Case(seed, size=0.2)
    for trace in case.traces:
        trace.measured *= 20.0
    gram = case.gram(with_tangents=False)
    _, _, b = case.bounded()
    held = np.abs(b) > MOST - 1e-9
    assert held.any()
    root, n = case.inverse_root(), case.inverse_root() @ case.raw_nuisance()
    r = root @ case.raw_residual(case.applied) - n[:, held] @ b[held]
    s, free = root @ case.raw_signatures()[:, [1]], n[:, ~held]
    normal = free.T @ free + np.eye(free.shape[1])
    project = np.eye(len(r)) - free @ np.linalg.solve(normal, free.T)
    rest, x = project @ r, project @ s
    left = rest - x @ np.linalg.solve(s.T @ x, s.T @ rest)
    clusters = brute_force_clusters(case)
    sums = dict.fromkeys(clusters, 0.0)
    for row, name in enumerate(clusters):
        sums[name] = sums[name] + x[row, 0] * left[row]
    grown = sum(u * u for u in sums.values()) / float((s.T @ x)[0, 0])
    expected = max(1.0, grown * len(sums) / (len(sums) - 2))
    assert gram.inflation(np.array([1])) == pytest.approx(expected, rel=1e-6)


# White's estimator and the solvers


def test_whites_estimator_is_that_of_plain_loops():
    generator = np.random.default_rng(3)
    jacobian, residual = generator.standard_normal((60, 3)), generator.standard_normal(60)
    clusters = generator.integers(0, 12, 60) * 7
    scores = cluster_scores(jacobian, residual, clusters)
    loops = {}
    for row in range(60):
        loops[clusters[row]] = loops.get(clusters[row], 0.0) + jacobian[row] * residual[row]
    assert scores == pytest.approx(np.array([loops[name] for name in sorted(loops)]))
    inverse = np.linalg.inv(jacobian.T @ jacobian)
    meat = sum(np.outer(u, u) for u in loops.values())
    g = len(loops)
    for small_sample, factor in ((False, 1.0), (True, g / (g - 1.0))):
        sandwich = factor * inverse @ meat @ inverse
        widened = clustered_covariance(inverse, scores, small_sample)
        for i in range(3):
            assert widened[i, i] == pytest.approx(max(inverse[i, i], sandwich[i, i]))
        correlation = inverse / np.sqrt(np.outer(np.diag(inverse), np.diag(inverse)))
        deviation = np.sqrt(np.diag(widened))
        assert widened == pytest.approx(correlation * np.outer(deviation, deviation))
    expected = np.trace(inverse @ meat) / 3 * g / (g - 3)
    assert gain_inflation(inverse, 4.0 * scores, fitted=3) == pytest.approx(max(1.0, 16.0 * expected))


def test_inflation_of_one_sided_model_errors_grows_with_the_length_of_stretches():
    """Rows that err together count as one: c equal rows of a cluster make the variance c times as large."""
    generator = np.random.default_rng(5)
    rows, length = 4000, 20
    noise = np.repeat(generator.standard_normal(rows // length), length)
    x = np.ones((rows, 1))
    inverse = np.linalg.inv(x.T @ x)
    scores = cluster_scores(x, noise, np.repeat(np.arange(rows // length), length))
    assert gain_inflation(inverse, scores, fitted=1) == pytest.approx(length, rel=0.25)


def test_differences_step_away_from_a_bound_and_from_what_cannot_be_simulated():
    seen = []

    def function(x):
        seen.append(x.copy())
        if x[1] > 2.0:
            raise NotUnderstoodError([])
        return np.array([3.0 * x[0], x[0] * x[0], 5.0 * x[1]])

    box = Box(np.array([-1.0, -9.0]), np.array([1.0, 9.0]), np.array([10.0, 10.0]))
    x = np.array([1.0, 2.0])
    r = function(x)
    slopes = derivative(function, x, r, box.steps(x, 0.01))
    assert slopes == pytest.approx(np.array([[3.0, 0.0], [1.9, 0.0], [0.0, 5.0]]))
    assert [point[0] for point in seen[1:2]] == [pytest.approx(0.9)]
    blind = derivative(lambda x: raising(x), x, r, box.steps(x, 0.01))
    assert not blind.any()


def raising(_x):
    raise NotUnderstoodError([])


@pytest.mark.parametrize("control", [Damped, Shortened])
def test_gauss_newton_finds_the_least_of_a_curved_residual(control):
    """A decay with a known size and rate."""
    t = np.linspace(0.0, 4.0, 30)

    def function(x):
        return x[0] * np.exp(-x[1] * t) - 1.7 * np.exp(-0.8 * t)

    def settled(before, after):
        return before - after < 1e-16

    box = Box(np.array([0.0, 0.0]), np.array([5.0, 5.0]), np.ones(2))
    least = gauss_newton(
        function, np.array([1.0, 0.3]), box, control(box), settled, most_steps=60, step_share=1e-5
    )
    assert least.x == pytest.approx([1.7, 0.8], abs=1e-4)
    assert least.chi2 < 1e-9


def test_gauss_newton_stays_in_its_box():
    target = np.array([3.0, -0.5])
    narrow = Box(np.array([-1.0, -1.0]), np.array([1.0, 1.0]), np.ones(2))
    least = gauss_newton(
        lambda x: x - target,
        np.zeros(2),
        narrow,
        Damped(narrow),
        lambda a, b: a - b < 1e-12,
        most_steps=50,
        step_share=1e-4,
    )
    assert least.x == pytest.approx([1.0, -0.5], abs=1e-6)


def test_pattern_search_finds_the_least_of_a_staircase():
    """Whole cycles: the function is flat between steps, so that differences say nothing."""
    box = Box(np.array([-5.0, -5.0]), np.array([5.0, 5.0]), np.ones(2))
    tread = 0.01

    def stairs(x):
        y = np.round((x - np.array([1.3, -2.1])) / tread) * tread
        return float(y @ y + 0.8 * y[0] * y[1])

    least = pattern_search(stairs, np.zeros(2), box, 0.3)
    assert least == pytest.approx([1.3, -2.1], abs=2 * tread)
