"""The fast view of the likelihood: inner products of data, tangents, signatures and nuisance.

The symbols are those of `gcode2krl.gap.posterior`. Gains, observable shares and inflations of hundreds of
candidates need only aᵀ·b of whitened columns, summed over stretches of time; so the rows of the data are
touched once. A candidate's gain is the likelihood ratio of its linear model, r - T·δ - S·c - N·b, with T the
tangents of the accepted effects. Nuisance of one run is zero in all others, and stored so.

**Bounds.** Normal mismatch may be as large as its bounds, and no larger. `scipy.optimize.lsq_linear` (method
"bvls") finds the same numbers and is the reference of the tests. On the recorded calls of a diagnosis it
takes 40 times as long, and it wants columns where the fast view has their Gram matrix.

**Clusters.** How much more a fit varies than independent noise lets it. With H the information, J_i the
derivative of residual r_i and clusters g of rows that share what the model is off by, the covariance of the
fitted numbers is H⁻¹·B·H⁻¹ with B = Σ_g u_g·u_gᵀ and the scores u_g = Σ_{i in g} J_i·r_i (White 1980; by
clusters: Liang & Zeger 1986). Valid for many clusters, each with a small part of the information.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv
from scipy.sparse import csr_array

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.gap.thresholds import THRESHOLDS

MOST = 3.0**0.5
"""A uniform draw within bounds stays within sqrt(3) of its standard deviation."""
_GUESSES = 3
"""Three fits in five need no more, and for the others a descent costs less than further guesses."""
_STEPS_A_COLUMN = 20
"""Bounds the time whatever the data are; fits of a diagnosis end after a fraction of one."""
_ROUNDING = 1e-12
"""A slope below this share of the sums that it is the difference of is none."""


def boxed(a: Floats, right: Floats, most: float = MOST) -> Floats:
    """Return b (m,) of least bᵀ·a·b/2 - rightᵀ·b with abs(b) <= ``most``, for a positive definite ``a``.

    Which numbers are at their bounds is guessed first, all at once. Where columns are correlated guesses may
    run in circles; what they leave open is settled by a descent.
    """
    scale = 1.0 / np.sqrt(np.diag(a))  # so that columns of any unit are of one size
    fit = _Fit(a * np.outer(scale, scale), right * scale, most / scale)
    b = _solved(fit.a, fit.right)
    if np.any(np.abs(b) >= fit.most):
        b = fit.descended(fit.guessed(b))
    # exactly at the bound: callers ask which numbers are there
    return np.where(np.abs(b) >= fit.most, np.copysign(most, b), np.clip(b * scale, -most, most))


class _Fit:
    """A fit whose numbers b (m,) stay within ±``most`` (m,)."""

    def __init__(self, a: Floats, right: Floats, most: Floats) -> None:
        self.a, self.right, self.most = a, right, most
        self._noise = _ROUNDING * (np.abs(a) @ most + np.abs(right))

    def free_fit(self, b: Floats, held: Bools) -> Floats:
        """Return b with the numbers that are not held at their best beside those that are."""
        free, fitted = np.flatnonzero(~held), b.copy()
        rows = self.a[free]
        fitted[free] = _solved(rows[:, free], self.right[free] - rows[:, held] @ b[held])
        return fitted

    def pulled_back(self, b: Floats, held: Bools) -> Bools:
        """Return which of the held numbers (m,) would make the fit better within their bounds."""
        return held & ((self.right - self.a @ b) * np.sign(b) < -self._noise)

    def guessed(self, b: Floats) -> Floats:
        """Return b where all numbers beyond their bounds are held there, and all pulled back are let go.

        It begins at the fit without bounds.
        """
        held = np.zeros(len(self.most), dtype=bool)
        for _ in range(_GUESSES):
            beyond = np.abs(b) > self.most
            b = np.clip(b, -self.most, self.most)
            back = self.pulled_back(b, held)
            if not beyond.any() and not back.any():
                break
            held = (held | beyond) & ~back
            b = self.free_fit(b, held)
        return np.clip(b, -self.most, self.most)

    def descended(self, b: Floats) -> Floats:
        """Return the least fit, reached from b by steps that never make it worse.

        An active set as in Stark & Parker 1995 (bounded-variable least squares): a step towards the best fit
        of the free numbers ends where one of them meets its bound and is held; at that best fit those which
        are pulled back are let go. It ends where none is: the conditions of Karush, Kuhn and Tucker.
        """
        held = np.abs(b) >= self.most
        for _ in range(_STEPS_A_COLUMN * len(b)):
            best = self.free_fit(b, held)
            beyond = np.abs(best) > self.most
            if beyond.any():
                bound = np.copysign(self.most, best)
                share = np.full(len(b), np.inf)
                share[beyond] = (bound - b)[beyond] / (best - b)[beyond]
                b = b + share.min() * (best - b)
                met = share == share.min()
                b[met] = bound[met]
                held |= met
                continue
            b = best
            back = self.pulled_back(b, held)
            if not back.any():
                break
            held &= ~back
        return b


def _solved(a: Floats, right: Floats) -> Floats:
    """Return a⁻¹·right by Cholesky; of columns that are equal to the last bit, shares of equal size."""
    if not len(right):
        return right
    _, solved, failed = dposv(a, right)
    if not failed:
        return np.asarray(solved, dtype=float)
    try:
        return np.asarray(np.linalg.solve(a, right), dtype=float)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(a, right, rcond=None)[0], dtype=float)


def cluster_scores(jacobian: Floats, residual: Floats, clusters: Ints) -> Floats:
    """Return the scores u (g, p) of jacobian (n, p) and residual (n,), one row a cluster (n,), 0 or more."""
    used = np.bincount(clusters) > 0
    at = (np.cumsum(used) - 1)[clusters]
    sums = [np.bincount(at, column * residual, int(used.sum())) for column in jacobian.T]
    return np.stack(sums, axis=1) if sums else np.zeros((int(used.sum()), 0))


def clustered_covariance(inverse: Floats, scores: Floats, small_sample: bool = False) -> Floats:
    """Return the inverse information (p, p), each deviation widened to that of H⁻¹·B·H⁻¹, never narrowed.

    ``small_sample`` multiplies B by g/(g - 1).
    """
    meat = scores.T @ scores
    if small_sample:
        meat = meat * len(scores) / (len(scores) - 1.0)
    robust = np.diag(inverse @ meat @ inverse)
    wider = np.sqrt(np.maximum(robust / np.maximum(np.diag(inverse), 1e-300), 1.0))
    widened: Floats = inverse * np.outer(wider, wider)
    return widened


def gain_inflation(inverse: Floats, scores: Floats, fitted: int) -> float:
    """Return by how much the likelihood ratio of p numbers varies more than white noise lets it, at least 1.

    trace(H⁻¹·B)/p, times g/(g - ``fitted``) for the numbers fitted to the g clusters. A model that is off
    here and there, by either sign, makes the noise of a gain larger than the noise of a sample says.
    """
    clusters, width = scores.shape
    grown = float(np.trace(inverse @ (scores.T @ scores))) / width
    return float(max(1.0, grown * clusters / max(clusters - fitted, 1)))


_PRIOR = THRESHOLDS.posterior.prior_sizes
_RANK = 1e-9
"""Eigenvalues below this share of the largest hold rounding errors only."""


class UsedColumns(NamedTuple):
    """Those of some whitened columns of one trace that are not zero in a component."""

    values: Floats
    """(n, u)"""
    at: Ints
    """(u,) where they stand among all."""


class SignatureGram:
    """Gram matrices of whitened signatures and nuisance, a stretch of time at a time."""

    def __init__(
        self,
        columns: Sequence[Sequence[UsedColumns]],
        nuisance: Sequence[Sequence[UsedColumns]],
        signatures: int,
        places: Sequence[Ints],
        stretches: Sequence[Ints],
    ) -> None:
        """Take the whitened columns of each trace and component: signatures, and nuisance.

        So many ``signatures`` stand first; nuisance stands in b at ``places`` (w,), and behind them here;
        ``stretches`` (n,) number each row's stretch of time.
        """
        self.signatures, self.places = signatures, places
        self._columns = [
            [
                (columns_, UsedColumns(used.values, signatures + np.searchsorted(at, used.at)))
                for columns_, used in zip(of_trace, of_nuisance, strict=True)
            ]
            for of_trace, of_nuisance, at in zip(columns, nuisance, places, strict=True)
        ]
        self._rows = [[np.flatnonzero(each == number) for number in np.unique(each)] for each in stretches]
        self._fixed = [
            [self._inner(number, rows) for rows in members] for number, members in enumerate(self._rows)
        ]

    def _inner(self, number: int, rows: Ints) -> Floats:
        """Return inner products (s + w, s + w) of some rows of a trace."""
        width = self.signatures + len(self.places[number])
        gram = np.zeros((width, width))
        for both in self._columns[number]:
            values = np.column_stack([used.values[rows] for used in both])
            at = np.concatenate([used.at for used in both])
            gram[np.ix_(at, at)] += values.T @ values  # of one array BLAS makes half of the products
        return gram

    def _cross(self, number: int, rows: Ints, new: Floats) -> Floats:
        """Return inner products (1 + t, s + w) of some rows of a trace with other columns (k, n, 1 + t)."""
        cross = np.zeros((new.shape[2], self.signatures + len(self.places[number])))
        for component, both in zip(new, self._columns[number], strict=True):
            for used in both:
                cross[:, used.at] += component[rows].T @ used.values[rows]
        return cross

    @classmethod
    def none(cls) -> "SignatureGram":
        """Return that of no trace."""
        return cls([], [], 0, [], [])

    @cached_property
    def totals(self) -> list[Floats]:
        """Inner products (s + w, s + w) of signatures and nuisance of each trace."""
        return [np.sum(stretches, axis=0) for stretches in self._fixed]

    def beside(self, data: Sequence[Floats]) -> "Gram":
        """Return the view with whitened data (k·n, 1 + t) of each trace: residual r and tangents T."""
        traces = []
        for number, (new, rows) in enumerate(zip(data, self._rows, strict=True)):
            by_component = new.reshape(len(self._columns[number]), -1, new.shape[1])
            stretches = []
            for at, fixed in zip(rows, self._fixed[number], strict=True):
                columns = by_component[:, at].reshape(-1, new.shape[1])
                stretches.append(_Joined(columns.T @ columns, self._cross(number, at, by_component), fixed))
            inner, cross = (np.sum([each[i] for each in stretches], axis=0) for i in range(2))
            total = np.block([[inner, cross], [cross.T, self.totals[number]]])
            traces.append(TraceGram(tuple(stretches), total, self.places[number]))
        values = sum(len(new) for new in data)
        return Gram(tuple(traces), data[0].shape[1] - 1, self.signatures, values)


class _Joined(NamedTuple):
    """The Gram matrix (c, c) of columns [r, T, S, N] by blocks: that of [S, N], the largest, is shared."""

    inner: Floats
    """(1 + t, 1 + t) of [r, T]"""
    cross: Floats
    """(1 + t, s + w) of both"""
    fixed: Floats
    """(s + w, s + w) of [S, N]"""

    def of(self, columns: Ints) -> Floats:
        """Return the Gram matrix of some columns (c',)."""
        is_new = columns < len(self.inner)
        new, fixed = columns[is_new], columns[~is_new] - len(self.inner)
        blocks = [
            [self.inner[np.ix_(new, new)], self.cross[np.ix_(new, fixed)]],
            [self.cross[np.ix_(new, fixed)].T, self.fixed[np.ix_(fixed, fixed)]],
        ]
        back = np.argsort(np.argsort(~is_new, kind="stable"))
        return np.block(blocks)[np.ix_(back, back)]


@dataclass(frozen=True, eq=False)
class TraceGram:
    """Gram matrices of one trace, columns [r, T, S, N]."""

    stretches: tuple[_Joined, ...]
    """One of each stretch of time."""
    total: Floats
    """(c, c)"""
    places: Ints
    """(w,) of its nuisance in b"""


@dataclass(frozen=True, eq=False)
class Gram:
    """Inner products of all data; columns are numbered as those of the signatures."""

    traces: tuple[TraceGram, ...]
    tangents: int
    signatures: int
    values: int
    """Number of data."""

    @property
    def _kept(self) -> int:
        return 1 + self.tangents + self.signatures

    def _at(self, columns: Ints) -> Ints:
        """Return where signatures stand."""
        return 1 + self.tangents + np.asarray(columns, dtype=int)

    @cached_property
    def total(self) -> Floats:
        """(1 + t + s + m) squared: the Gram matrix of [r, T, S, N] over all traces."""
        return self._summed(np.arange(self._kept))

    def _summed(self, kept: Ints) -> Floats:
        """Return the Gram matrix over all traces of some columns and of all nuisance, in the order of b."""
        size = len(kept) + 1 + max(int(each.places.max(initial=-1)) for each in self.traces)
        summed = np.zeros((size, size))
        for trace in self.traces:
            at = np.r_[kept, np.arange(self._kept, len(trace.total))]
            into = np.r_[np.arange(len(kept)), len(kept) + trace.places]
            summed[np.ix_(into, into)] += trace.total[np.ix_(at, at)]
        return summed

    @cached_property
    def _free_fit(self) -> tuple[Floats, Floats, float]:
        """Tangents' coefficients, b and chi2 without any signature."""
        return self._fit(np.arange(1, 1 + self.tangents), np.zeros(self.tangents))

    @property
    def chi2(self) -> float:
        """Return chi2 with the best tangents and nuisance within its bounds."""
        return self._free_fit[2]

    @cached_property
    def _given(self) -> tuple[Floats, Ints]:
        """(1 + m) squared: the Gram matrix of [r, N], and where these columns are."""
        here = np.r_[0, np.arange(self._kept, len(self.total))]
        return self.total[np.ix_(here, here)], here

    @cached_property
    def _held(self) -> Floats:
        """Nuisance (m,) that stands at its bounds without any signature; 0 for the rest of it."""
        b = self._free_fit[1]
        return np.where(np.abs(b) >= MOST, b, 0.0)

    def _fit(self, free: Ints, precision: Floats) -> tuple[Floats, Floats, float]:
        """Return the coefficients of free columns, b within its bounds, and chi2.

        The free ones have a normal prior about 0 of this precision, whose cost is part of chi2.
        """
        rows, (given, here) = self.total[free], self._given
        cross = rows[:, here]
        half = solve(rows[:, free] + np.diag(precision), cross)
        gram = given - cross.T @ half
        cost = gram[1:, 1:] + np.eye(len(here) - 1)
        b = boxed(cost, gram[1:, 0])
        chi2 = float(gram[0, 0] - 2.0 * b @ gram[1:, 0] + b @ cost @ b)
        return half[:, 0] - half[:, 1:] @ b, b, chi2

    def gain(self, columns: Ints) -> tuple[float, Floats]:
        """Return the likelihood ratio of signatures as a fall of chi2, and their coefficients.

        Tangents and nuisance, within its bounds, are fitted anew. The prior of `prior_sizes` keeps small what
        the data hardly see.
        """
        free = np.r_[np.arange(1, 1 + self.tangents), self._at(columns)]
        precision = np.r_[np.zeros(self.tangents), np.full(len(columns), _PRIOR**-2)]
        coefficients, _, chi2 = self._fit(free, precision)
        return self.chi2 - chi2, coefficients[self.tangents :]

    def fitted(self, columns: Ints, sizes: float) -> tuple[float, float, Floats]:
        """Return chi2 with signatures, what all numbers cost as in `Fitted.occam`, and the coefficients.

        ``sizes`` is the standard deviation of the coefficients' prior.
        """
        free = np.r_[np.arange(1, 1 + self.tangents), self._at(columns)]
        precision = np.r_[np.zeros(self.tangents), np.full(len(columns), sizes**-2)]
        coefficients, b, chi2 = self._fit(free, precision)
        at = np.r_[free, self._kept + np.flatnonzero(np.abs(b) < MOST)]
        prior = np.r_[np.full(self.tangents, _PRIOR), np.full(len(columns), sizes)]
        narrowed = marginal(self.total[np.ix_(at, at)], len(free)) * np.outer(prior, prior)
        cost = float(np.linalg.slogdet(np.eye(len(free)) + narrowed)[1])
        return chi2, cost + THRESHOLDS.posterior.number_cost * len(free), coefficients[self.tangents :]

    @cached_property
    def marginal(self) -> Floats:
        """(1 + t + s) squared: inner products under the inverse of I + N·Nᵀ, by Woodbury.

        Nuisance at its bounds is taken off the data at its value, and is not free to explain more.
        """
        total, kept = self.total.copy(), self._kept
        at = kept + np.flatnonzero(self._held)
        if len(at):
            held = self._held[at - kept]
            off = total[:, at] @ held
            inner = held @ total[np.ix_(at, at)] @ held
            total[0] -= off
            total[:, 0] -= off
            total[0, 0] += inner
            total[at], total[:, at] = 0.0, 0.0
        return marginal(total, kept)

    def observable(self, columns: Ints) -> tuple[float, float]:
        """Return the least share of signatures' power that nuisance leaves, and the least power left."""
        at = self._at(columns)
        power_left, whole = np.diag(self.marginal)[at], np.diag(self.total)[at]
        return float(np.min(power_left / np.maximum(whole, 1e-300))), float(np.min(power_left))

    def inflation(self, columns: Ints) -> float:
        """Return by how much the gain of signatures varies more than white noise lets it, at least 1.

        White's estimator over stretches of time, at the best fit of these signatures, the tangents and
        nuisance; b stays at the bounds where it is held.
        """
        chosen = np.r_[0, self._at(columns)]
        given = np.arange(1, 1 + self.tangents)
        coefficients, inverse, explained = self._linear_fit(chosen, given)
        weights = np.r_[1.0, -coefficients]
        scores = []
        for trace in self.traces:
            nuisance = np.arange(self._kept, len(trace.total))
            rows = np.r_[chosen, given, nuisance]
            # columns of the projected residual and signatures, in those of the Gram matrix
            into = np.r_[np.arange(len(given)), len(given) + trace.places]
            basis = np.vstack([np.eye(len(chosen)), -explained[into]])
            for gram in trace.stretches:
                scores.append(basis[:, 1:].T @ gram.of(rows) @ (basis @ weights))
        return gain_inflation(inverse, np.array(scores), fitted=len(chosen))

    def _linear_fit(self, chosen: Ints, given: Ints) -> tuple[Floats, Floats, Floats]:
        """Return coefficients (c,) of signatures, their inverse information, and what explains [r, S].

        ``chosen`` are the columns [r, S]; the last result (t + m, 1 + c) are the tangents' and the nuisance's
        coefficients for each of them.
        """
        t, c = len(given), len(chosen)
        summed = self._summed(np.r_[chosen, given])
        normal, right = summed[c:, c:].copy(), summed[c:, :c].copy()
        normal[range(t, len(normal)), range(t, len(normal))] += 1.0
        at_bound = np.r_[np.zeros(t), self._held]
        free = at_bound == 0.0
        score = summed[1:c, 0] - right[:, 1:].T @ at_bound
        right[:, 0] -= normal @ at_bound
        explained = np.zeros_like(right)
        explained[free] = solve(normal[np.ix_(free, free)], right[free])
        information = summed[1:c, 1:c] - right[:, 1:].T @ explained[:, 1:]
        inverse = solve(information, np.eye(c - 1))
        coefficients = inverse @ (score - right[free, 1:].T @ explained[free, 0])
        explained[:, 0] += at_bound
        return coefficients, inverse, explained


def solve(a: Floats, b: Floats) -> Floats:
    """Return a⁻¹·b for a positive semidefinite a; directions that hold nothing stay zero."""
    scale = np.sqrt(np.maximum(np.diag(a), 1e-300))
    values, vectors = np.linalg.eigh(a / np.outer(scale, scale))
    good = values > _RANK * max(float(values[-1]), 1e-30) if len(values) else values > 0
    inverse = vectors[:, good] / values[good] @ vectors[:, good].T
    solved: Floats = (inverse @ (b / scale[:, None])) / scale[:, None]
    return solved


def marginal(gram: Floats, keep: int) -> Floats:
    """Return the Gram matrix of the first ``keep`` columns with the rest as nuisance of unit variance."""
    fixed = gram[keep:, keep:] + np.eye(len(gram) - keep)
    cross = gram[:keep, keep:]
    return gram[:keep, :keep] - cross @ np.linalg.solve(fixed, cross.T)


class Part(NamedTuple):
    """Rows of one run and component, and the columns that are not zero there."""

    first: int
    values: Floats
    """(r, u)"""
    at: Ints
    """(u,) where they stand among all; those behind all are left out, without a copy of the rest."""

    @property
    def rows(self) -> slice:
        """Return its rows among all."""
        return slice(self.first, self.first + len(self.values))


@dataclass(frozen=True, eq=False)
class SplitColumns:
    """Columns (v, t + m): t of all rows, and m that are zero but in parts of the rows; made for products."""

    whole: Floats
    """(v, t)"""
    parts: tuple[Part, ...]
    """Their rows follow each other and are (v,) together."""
    width: int
    """m"""

    __array_ufunc__ = None  # so that a product with an array on the left is that of this class

    @classmethod
    def of_parts(cls, columns: Iterable[UsedColumns], width: int) -> "SplitColumns":
        """Return the columns of parts that follow each other; values are shared."""
        parts, first = [], 0
        for used in columns:
            parts.append(Part(first, used.values, used.at))
            first += len(used.values)
        return cls(np.zeros((first, 0)), tuple(parts), width)

    @property
    def shape(self) -> tuple[int, int]:
        """Return rows and columns."""
        return len(self.whole), self.whole.shape[1] + self.width

    @property
    def dense(self) -> Floats:
        """Return them as one array."""
        return self @ np.eye(self.shape[1])

    def __matmul__(self, right: Floats) -> Floats:
        """Return the product (v, …) with weights (t + m, …)."""
        t = self.whole.shape[1]
        weights = np.concatenate([right[t:], np.zeros((1, *right.shape[1:]))])
        product: Floats = self.whole @ right[:t]
        for part in self.parts:
            product[part.rows] += part.values @ weights[part.at]
        return product

    def __rmatmul__(self, factor: Floats | csr_array) -> Floats:
        """Return the product (…, t + m) of values (…, v), dense or sparse, with the columns."""
        by_row = factor if isinstance(factor, np.ndarray) else factor.tocsc()  # its columns are cut out
        sums = np.zeros((*factor.shape[:-1], self.width + 1))
        for part in self.parts:
            sums[..., part.at] += by_row[..., part.rows] @ part.values
        return np.concatenate([factor @ self.whole, sums[..., :-1]], axis=-1)

    @cached_property
    def gram(self) -> Floats:
        """(t + m) squared: inner products."""
        t, above = self.whole.shape[1], self.whole.T @ self
        return np.concatenate([above, np.concatenate([above[:, t:].T, self.gram_in()], axis=1)])

    def gram_in(self, rows: Bools | None = None) -> Floats:
        """Return inner products (m, m), over some rows (v,), of those that are not of all rows."""
        gram = np.zeros((self.width + 1, self.width + 1))
        for part in self.parts:
            values = part.values if rows is None else part.values[rows[part.rows]]
            gram[np.ix_(part.at, part.at)] += values.T @ values
        return gram[:-1, :-1]

    def used(self, rows: Bools) -> Bools:
        """Return which columns (t + m,) are not zero in some rows (v,), whole parts."""
        used = np.zeros(self.width + 1, dtype=bool)
        for part in self._within(rows):
            used[part.at] = True
        return np.concatenate([self.whole[rows].any(axis=0), used[:-1]])

    def of(self, rows: Bools, columns: Bools) -> "SplitColumns":
        """Return some rows (v,), whole parts, of some columns (m,); values are shared."""
        count = int(columns.sum())
        places = np.append(np.where(columns, np.cumsum(columns) - 1, count), count)
        parts = (UsedColumns(part.values, places[part.at]) for part in self._within(rows))
        return SplitColumns.of_parts(parts, count)

    def _within(self, rows: Bools) -> Iterator[Part]:
        return (part for part in self.parts if len(part.values) and rows[part.first])
