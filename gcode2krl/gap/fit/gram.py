"""The fast view of the likelihood: inner products of data, tangents, signatures and nuisance.

The symbols are those of `gcode2krl.gap.fit`. Gains, observable shares and inflations of hundreds of
candidates need only aᵀ·b of whitened columns, summed over stretches of time; so the rows of the data are
touched once. A candidate's gain is the likelihood ratio of its linear model, r - T·δ - S·c - N·b, with T the
tangents of the accepted effects.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.gap.fit.box import MOST, boxed
from gcode2krl.gap.fit.clusters import gain_inflation
from gcode2krl.gap.thresholds import THRESHOLDS

_PRIOR = THRESHOLDS.fit.prior_sizes
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
                (own, UsedColumns(used.values, signatures + np.searchsorted(at, used.at)))
                for own, used in zip(of_trace, beside, strict=True)
            ]
            for of_trace, beside, at in zip(columns, nuisance, places, strict=True)
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
            own = np.column_stack([used.values[rows] for used in both])
            at = np.concatenate([used.at for used in both])
            gram[np.ix_(at, at)] += own.T @ own  # of one array BLAS makes half of the products
        return gram

    def _cross(self, number: int, rows: Ints, new: Floats) -> Floats:
        """Return inner products (1 + t, s + w) of some rows of a trace with other columns (k, n, 1 + t)."""
        cross = np.zeros((new.shape[2], self.signatures + len(self.places[number])))
        for own, both in zip(new, self._columns[number], strict=True):
            for used in both:
                cross[:, used.at] += own[rows].T @ used.values[rows]
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
            own = new.reshape(len(self._columns[number]), -1, new.shape[1])
            stretches = []
            for at, fixed in zip(rows, self._fixed[number], strict=True):
                columns = own[:, at].reshape(-1, new.shape[1])
                stretches.append(_Joined(columns.T @ columns, self._cross(number, at, own), fixed))
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
        gram: Floats = np.block(blocks)[np.ix_(back, back)]
        return gram


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
        for each in self.traces:
            at = np.r_[kept, np.arange(self._kept, len(each.total))]
            into = np.r_[np.arange(len(kept)), len(kept) + each.places]
            summed[np.ix_(into, into)] += each.total[np.ix_(at, at)]
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
        left, whole = np.diag(self.marginal)[at], np.diag(self.total)[at]
        return float(np.min(left / np.maximum(whole, 1e-300))), float(np.min(left))

    def inflation(self, columns: Ints) -> float:
        """Return by how much the gain of signatures varies more than white noise lets it, at least 1.

        White's estimator over stretches of time, at the best fit of these signatures, the tangents and
        nuisance; b stays at the bounds where it is held.
        """
        chosen = np.r_[0, self._at(columns)]
        given = np.arange(1, 1 + self.tangents)
        coefficients, inverse, explained = self._linear_fit(chosen, given)
        rest = np.r_[1.0, -coefficients]
        scores = []
        for each in self.traces:
            nuisance = np.arange(self._kept, len(each.total))
            rows = np.r_[chosen, given, nuisance]
            # columns of the projected residual and signatures, in those of the Gram matrix
            into = np.r_[np.arange(len(given)), len(given) + each.places]
            basis = np.vstack([np.eye(len(chosen)), -explained[into]])
            for gram in each.stretches:
                scores.append(basis[:, 1:].T @ gram.of(rows) @ (basis @ rest))
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
    rest = gram[keep:, keep:] + np.eye(len(gram) - keep)
    cross = gram[:keep, keep:]
    result: Floats = gram[:keep, :keep] - cross @ np.linalg.solve(rest, cross.T)
    return result
