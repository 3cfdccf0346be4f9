"""What the data say of every block at once: Gram matrices of whitened data, signatures and nuisance.

With y the whitened residual, S the signatures and N the nuisance columns (each times its standard deviation)
the covariance of y is I + N·Nᵀ, and inner products under its inverse are
<a, b> = aᵀb - aᵀN·(NᵀN + I)⁻¹·Nᵀb (Woodbury). Everything the selection needs is such products, so the rows of
the data are touched once.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcode2krl.gap.noise import Noise
from gcode2krl.gap.nuisance import Nuisance
from gcode2krl.gap.part import Part

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
STRETCH_S = 1.0
"""Longer than an instrument remembers; rows of one stretch are kept together in every split."""


@dataclass(frozen=True, eq=False)
class Rows:
    """One part's signatures and nuisance, whitened, component after component."""

    part: Part
    whitened: Floats
    """(k·n, s + shared + own)"""
    stretch: Ints
    """(k·n,) number of the stretch of time each row belongs to."""
    noise: tuple[Noise, ...]
    signatures: int
    shared: int

    def white(self, columns: Floats) -> Floats:
        """Return columns (k, n, c) through the part's filters, (k·n, c)."""
        return whitened(columns, self.part, self.noise)


def whitened(columns: Floats, part: Part, noise: Sequence[Noise]) -> Floats:
    """Return columns (k, n, c) through one filter a component, one component after the other: (k·n, c)."""
    return np.concatenate([noise[j].whiten(columns[j], part.segments) for j in range(len(columns))])


def stretches_of(part: Part) -> Ints:
    """Return the number (n,) of the stretch of time each row of a part belongs to."""
    number: Ints = ((part.time_s - part.inputs.time_s[0]) / STRETCH_S).astype(np.int64)
    return number


def rows_of(part: Part, signatures: Floats, nuisance: Sequence[Nuisance], noise: Sequence[Noise]) -> Rows:
    """Return signatures (k, n, s) and nuisance of a part through its filters."""
    shared = [each.columns for each in nuisance if each.shared]
    own = [each.columns for each in nuisance if not each.shared]
    stacked = np.concatenate([signatures, *shared, *own], axis=2)
    return Rows(
        part,
        whitened(stacked, part, noise),
        np.tile(stretches_of(part), len(stacked)),
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

    def gain(self, columns: Sequence[int] | Ints, given: Sequence[int] | Ints = ()) -> tuple[float, Floats]:
        """Return by how much chi2 falls with some signatures besides given ones, and their coefficients."""
        given_, new = np.asarray(given, dtype=int) + 1, np.asarray(columns, dtype=int) + 1
        g = self.gram
        a, b = g[np.ix_(new, new)], g[new, 0]
        if len(given_):
            half = solve(g[np.ix_(given_, given_)], g[np.ix_(given_, np.r_[0, new])])
            cross = g[np.ix_(new, given_)]
            b = b - cross @ half[:, 0]
            a = a - cross @ half[:, 1:]
        coefficients = solve(a, b[:, None])[:, 0]
        return float(max(b @ coefficients, 0.0)), coefficients


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
        self.given = 0

    def set_data(self, residuals: Sequence[Floats], tangents: Sequence[Floats]) -> None:
        """Take residuals (n, k) of all parts, and tangents (k, n, t) of what the model has beyond nominal."""
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

    def evidence(self, chosen: Sequence[tuple[int, int]] | None = None) -> Evidence:
        """Return the evidence of some (part, stretch) pairs, None = all; tangents come first."""
        wanted = None if chosen is None else set(chosen)
        total: Floats | None = None
        count, kept = 0, 1 + self.given + self.rows[0].signatures
        for number, grams in enumerate(self._grams):
            mine = [value for key, value in grams.items() if wanted is None or (number, key) in wanted]
            if mine:
                gram = marginal(np.sum([gram for gram, _ in mine], axis=0), kept + self.rows[number].shared)
                total = gram if total is None else total + gram
                count += sum(rows for _, rows in mine)
        if total is None:
            return Evidence(np.zeros((kept, kept)), 0)
        return Evidence(marginal(total, kept), count)

    def stretches(self) -> list[tuple[int, int]]:
        """Return all (part, stretch) pairs."""
        return [(number, key) for number, members in enumerate(self._members) for key in members]
