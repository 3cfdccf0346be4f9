"""Columns of which each run and component has some: nuisance of one run is zero in all others."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.gap.fit.gram import UsedColumns


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

    def __rmatmul__(self, left: Floats | csr_array) -> Floats:
        """Return the product (…, t + m) of values (…, v), dense or sparse, with the columns."""
        by_row = left if isinstance(left, np.ndarray) else left.tocsc()  # its columns are cut out
        sums = np.zeros((*left.shape[:-1], self.width + 1))
        for part in self.parts:
            sums[..., part.at] += by_row[..., part.rows] @ part.values
        product: Floats = np.concatenate([left @ self.whole, sums[..., :-1]], axis=-1)
        return product

    @cached_property
    def gram(self) -> Floats:
        """(t + m) squared: inner products."""
        t, above = self.whole.shape[1], self.whole.T @ self
        return np.concatenate([above, np.concatenate([above[:, t:].T, self.gram_in()], axis=1)])

    def gram_in(self, rows: Bools | None = None) -> Floats:
        """Return inner products (m, m), over some rows (v,), of those that are not of all rows."""
        gram = np.zeros((self.width + 1, self.width + 1))
        for part in self.parts:
            own = part.values if rows is None else part.values[rows[part.rows]]
            gram[np.ix_(part.at, part.at)] += own.T @ own
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
        own = (UsedColumns(part.values, places[part.at]) for part in self._within(rows))
        return SplitColumns.of_parts(own, count)

    def _within(self, rows: Bools) -> Iterator[Part]:
        return (part for part in self.parts if len(part.values) and rows[part.first])
