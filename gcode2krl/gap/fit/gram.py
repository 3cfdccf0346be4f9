"""What the data say of every block at once: Gram matrices of whitened data, signatures and nuisance.

With y the whitened residual, S the signatures and N the nuisance columns (each times its standard deviation)
the covariance of y is I + N·Nᵀ, and inner products under its inverse are
<a, b> = aᵀb - aᵀN·(NᵀN + I)⁻¹·Nᵀb (Woodbury). Everything the selection needs is such products, so the rows of
the data are touched once.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.gap.beside.holdout import STRETCH_S
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.box import MOST, boxed
from gcode2krl.gap.fit.noise import Noise
from gcode2krl.gap.fit.nuisance import Nuisance

PRIOR = 3.0
"""A size is expected within so many typical ones."""


@dataclass(frozen=True, eq=False)
class Rows:
    """One part's signatures and nuisance, whitened, component after component."""

    trace: Trace
    whitened: Floats
    """(k·n, s + shared + own)"""
    stretch: Ints
    """(k·n,) number of the stretch of time each row belongs to."""
    noise: tuple[Noise, ...]
    signatures: int
    shared: int

    def white(self, columns: Floats) -> Floats:
        """Return columns (k, n, c) through the trace's filters, (k·n, c)."""
        return whitened(columns, self.trace, self.noise)


def whitened(columns: Floats, trace: Trace, noise: Sequence[Noise]) -> Floats:
    """Return columns (k, n, c) through one filter a component, one component after the other: (k·n, c)."""
    return np.concatenate([noise[j].whiten(columns[j], trace.segments) for j in range(len(columns))])


def stretches_of(trace: Trace) -> Ints:
    """Return the number (n,) of the stretch of time each row of a trace belongs to."""
    number: Ints = ((trace.time_s - trace.inputs.time_s[0]) / STRETCH_S).astype(np.int64)
    return number


def stretches_of_all(traces: Sequence[Trace]) -> Ints:
    """Return the number of the stretch of time of each value of all traces, in the order of `whiten`.

    No two runs have a number in common, however long they are.
    """
    numbers, first = [], 0
    for trace in traces:
        own = stretches_of(trace)
        own -= own.min(initial=0)  # a table may begin before its model
        numbers.append(np.tile(first + own, trace.shape[1]))
        first += int(own.max(initial=-1)) + 1
    return np.concatenate(numbers)


def rows_of(trace: Trace, signatures: Floats, nuisance: Sequence[Nuisance], noise: Sequence[Noise]) -> Rows:
    """Return signatures (k, n, s) and nuisance of a trace through its filters."""
    shared = [each.columns for each in nuisance if each.shared]
    own = [each.columns for each in nuisance if not each.shared]
    stacked = np.concatenate([signatures, *shared, *own], axis=2)
    return Rows(
        trace,
        whitened(stacked, trace, noise),
        np.tile(stretches_of(trace), len(stacked)),
        tuple(noise),
        signatures.shape[2],
        sum(each.shape[2] for each in shared),
    )


@dataclass(frozen=True, eq=False)
class Evidence:
    """Gram matrix (1 + s, 1 + s) of data and signatures, nuisance taken out; and the number of rows."""

    gram: Floats
    rows: int

    @property
    def chi2(self) -> float:
        """Return the squared length of the whitened data after nuisance."""
        return float(self.gram[0, 0])


def solve(a: Floats, b: Floats) -> Floats:
    """Return a⁻¹·b for a positive semidefinite a; directions that hold nothing stay zero."""
    scale = np.sqrt(np.maximum(np.diag(a), 1e-300))
    values, vectors = np.linalg.eigh(a / np.outer(scale, scale))
    good = values > 1e-9 * max(float(values[-1]), 1e-30) if len(values) else values > 0
    inverse = vectors[:, good] / values[good] @ vectors[:, good].T
    found: Floats = (inverse @ (b / scale[:, None])) / scale[:, None]
    return found


def marginal(gram: Floats, keep: int) -> Floats:
    """Return the Gram matrix of the first ``keep`` columns with the rest as nuisance of unit variance."""
    rest = gram[keep:, keep:] + np.eye(len(gram) - keep)
    cross = gram[:keep, keep:]
    result: Floats = gram[:keep, :keep] - cross @ np.linalg.solve(rest, cross.T)
    return result


def _bounded(total: Floats, kept: int, free: Ints, pull: Floats) -> tuple[Floats, Floats, float]:
    """Return signatures' coefficients, pulled to zero by ``pull``, nuisance within its bounds (m,), and chi2.

    chi2 is that of both; what the pull costs is in it.
    """
    here = np.r_[0, np.arange(kept, len(total))]
    gram, cross = total[np.ix_(here, here)], total[np.ix_(free, here)]
    half = solve(total[np.ix_(free, free)] + np.diag(pull), cross)
    gram = gram - cross.T @ half
    cost = gram[1:, 1:] + np.eye(len(here) - 1)
    b = boxed(cost, gram[1:, 0])
    coefficients = half[:, 0] - half[:, 1:] @ b
    return coefficients, b, float(gram[0, 0] - 2.0 * b @ gram[1:, 0] + b @ cost @ b)


def _less(total: Floats, held: Floats) -> Floats:
    """Return the Gram matrix with held columns, at their values, taken off the data and out of the rest."""
    found = total.copy()
    at = np.flatnonzero(held)
    if len(at):
        off = total[:, at] @ held[at]
        found[0] -= off
        found[:, 0] -= off
        found[0, 0] += held[at] @ total[np.ix_(at, at)] @ held[at]
        found[at], found[:, at] = 0.0, 0.0
    return found


class Ledger:
    """Gram matrices by run and stretch of time; any choice of them is evidence."""

    def __init__(self, rows: Sequence[Rows]) -> None:
        self.rows = list(rows)
        self._members = [
            {int(number): np.flatnonzero(each.stretch == number) for number in np.unique(each.stretch)}
            for each in rows
        ]
        self._fixed = [
            {number: each.whitened[at].T @ each.whitened[at] for number, at in members.items()}
            for each, members in zip(self.rows, self._members, strict=True)
        ]
        self._grams: list[dict[int, tuple[Floats, int]]] = []
        self._held, self._chi2, self._total = np.zeros(0), 0.0, np.zeros((0, 0))
        self.given = 0

    def set_data(self, residuals: Sequence[Floats], tangents: Sequence[Floats]) -> None:
        """Take residuals (n, k) of all traces and tangents (k, n, t) of the accepted effects."""
        self._grams = []
        for number, each in enumerate(self.rows):
            new = each.white(np.concatenate([residuals[number].T[:, :, None], tangents[number]], axis=2))
            self.given = new.shape[1] - 1
            found = {}
            for stretch, at in self._members[number].items():
                mine, fixed = new[at], each.whitened[at]
                cross = mine.T @ fixed
                found[stretch] = (
                    np.block([[mine.T @ mine, cross], [cross.T, self._fixed[number][stretch]]]), len(at)
                )  # fmt: skip
            self._grams.append(found)

    def evidence(self) -> Evidence:
        """Return what all data together say; tangents come first.

        Nuisance that the data drive to its bounds, with the tangents alone, is held there and taken off.
        """
        kept = 1 + self.given + self.rows[0].signatures
        places = self._places(np.arange(kept))
        size = 1 + max(int(into.max(initial=-1)) for _, into in places)
        total, count = np.zeros((size, size)), 0
        for grams, (at, into) in zip(self._grams, places, strict=True):
            whole = np.sum([gram for gram, _ in grams.values()], axis=0)
            total[np.ix_(into, into)] += whole[np.ix_(at, at)]
            count += sum(rows for _, rows in grams.values())
        free = np.arange(1, 1 + self.given)
        _, b, self._chi2 = _bounded(total, kept, free, np.zeros(len(free)))
        self._held = np.zeros(len(total))
        self._held[kept:] = np.where(np.abs(b) >= MOST, b, 0.0)
        self._total = total
        return Evidence(marginal(_less(total, self._held), kept), count)

    def bounded_gain(self, columns: Ints) -> tuple[float, Floats]:
        """Return by how much chi2 of the last evidence falls with some signatures, and their coefficients.

        Nuisance is fitted anew within its bounds. A combination that the data hardly see stays small.
        """
        kept = 1 + self.given + self.rows[0].signatures
        free = np.r_[np.arange(1, 1 + self.given), np.asarray(columns, dtype=int) + 1]
        pull = np.r_[np.zeros(self.given), np.full(len(columns), PRIOR**-2)]
        coefficients, _, chi2 = _bounded(self._total, kept, free, pull)
        return self._chi2 - chi2, coefficients[self.given :]

    def seen(self, evidence: Evidence, columns: Ints) -> tuple[float, float]:
        """Return the least share of signatures' power that nuisance leaves, and the least power left."""
        at = np.asarray(columns, dtype=int) + 1
        left, whole = np.diag(evidence.gram)[at], np.diag(self._total)[at]
        return float(np.min(left / np.maximum(whole, 1e-300))), float(np.min(left))

    def inflation(self, columns: Ints) -> float:
        """Return by how much the gain of signatures varies more than white noise lets it, at least 1.

        From the scores of each stretch of time beside the best fit of these signatures, the given ones and
        nuisance (White 1980, by clusters): what a model is off by here and there, of either sign, makes the
        noise of a gain larger than the noise of a sample says.
        """
        chosen = np.r_[0, np.asarray(columns, dtype=int) + 1]
        given = np.arange(1, 1 + self.given)
        places = self._places(given)
        held = self._held[1 + self.given + self.rows[0].signatures :]
        size = 1 + max(int(into.max(initial=-1)) for _, into in places)
        normal, right = np.zeros((size, size)), np.zeros((size, len(chosen)))
        total = np.zeros((len(chosen), len(chosen)))
        for grams, (at, into) in zip(self._grams, places, strict=True):
            whole = np.sum([gram for gram, _ in grams.values()], axis=0)
            normal[np.ix_(into, into)] += whole[np.ix_(at, at)]
            right[into] += whole[np.ix_(at, chosen)]
            total += whole[np.ix_(chosen, chosen)]
        normal[range(len(given), size), range(len(given), size)] += 1.0
        at_bound = np.r_[np.zeros(len(given)), held]
        free = at_bound == 0.0
        score = total[1:, 0] - right[:, 1:].T @ at_bound
        right[:, 0] -= normal @ at_bound
        taken = np.zeros_like(right)
        taken[free] = solve(normal[np.ix_(free, free)], right[free])
        info = total[1:, 1:] - right[:, 1:].T @ taken[:, 1:]
        fitted = solve(info, (score - right[free, 1:].T @ taken[free, 0])[:, None])[:, 0]
        taken[:, 0] += at_bound
        rest = np.r_[1.0, -fitted]
        scores = []
        for grams, (at, into) in zip(self._grams, places, strict=True):
            rows = np.r_[chosen, at]
            basis = np.vstack([np.eye(len(chosen)), -taken[into]])
            for gram, _ in grams.values():
                scores.append(basis[:, 1:].T @ gram[np.ix_(rows, rows)] @ (basis @ rest))
        u = np.array(scores)
        grown = np.trace(solve(info, u.T @ u)) / (len(chosen) - 1)
        return float(max(1.0, grown * len(u) / max(len(u) - len(chosen), 1)))

    def _places(self, given: Ints) -> list[tuple[Ints, Ints]]:
        """Return for each trace where given signatures and nuisance stand in its Gram, and in that of all."""
        found, own = [], 0
        first = 1 + self.given + self.rows[0].signatures
        for rows in self.rows:
            width = rows.whitened.shape[1] - rows.signatures
            common = len(given) + rows.shared
            start = common + own
            into = np.r_[np.arange(common), np.arange(start, start + width - rows.shared)]
            found.append((np.r_[given, np.arange(first, first + width)], into))
            own += width - rows.shared
        return found
