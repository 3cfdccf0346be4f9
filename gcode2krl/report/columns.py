"""Samples over time sorted into the columns of a picture, so that a million of them cost no more than a line.

A column holds every sample of its stretch of time: its lowest and highest value are those of the samples.
"""

from typing import NamedTuple, Self

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints

COLUMNS = 700
"""Columns across a picture of 11 inches: about two pixels each."""
_TURNS = 3.0
"""A line that goes up and down more often than this within a column fills it."""
_TALL = 0.04
"""Share of the panel's height below which this is not seen."""
_FILLED = 0.05
"""Share of filled columns above which a line says nothing."""


class TimeColumns(NamedTuple):
    """Which rows lie in which column: c columns of equal time."""

    edge_s: Floats
    """(c + 1,)"""
    held: Ints
    """(k,) numbers of the columns that hold a sample, rising."""
    start: Ints
    """(k,) the first row of each of them."""
    rows: int

    @classmethod
    def of(cls, time_s: Floats, count: int = COLUMNS) -> Self:
        """Sort non-decreasing times (m,) into columns; at most ``count``."""
        first, last = float(time_s[0]), float(time_s[-1])
        edge_s = np.linspace(first, last if last > first else first + 1.0, count + 1)
        column = np.minimum(np.searchsorted(edge_s, time_s, side="right") - 1, count - 1)
        held, start = np.unique(column, return_index=True)
        return cls(edge_s, held, start.astype(np.int64), len(time_s))

    @property
    def middle_s(self) -> Floats:
        """(c,) middle of each column."""
        middle: Floats = (self.edge_s[1:] + self.edge_s[:-1]) / 2.0
        return middle

    def extremes(self, values: Floats) -> tuple[Floats, Floats]:
        """Return (c,) lowest and (c,) highest value of each column, NaN where no sample has a value."""
        present = np.isfinite(values)
        low = np.minimum.reduceat(np.where(present, values, np.inf), self.start)
        high = np.maximum.reduceat(np.where(present, values, -np.inf), self.start)
        low[~np.isfinite(low)] = np.nan
        high[~np.isfinite(high)] = np.nan
        return self._spread(low), self._spread(high)

    def quantiles(self, values: Floats, shares: tuple[float, ...]) -> Floats:
        """Return (len(shares), c) quantiles of the values in each column: the nearest sample below."""
        columns = np.full((len(shares), len(self.edge_s) - 1), np.nan)
        present = np.where(np.isfinite(values), values, np.nan)
        ends = np.append(self.start[1:], self.rows)
        for column, start, end in zip(self.held.tolist(), self.start.tolist(), ends.tolist(), strict=True):
            ordered = np.sort(present[start:end])  # NaN last
            count = end - start - int(np.count_nonzero(np.isnan(ordered)))
            if count:
                columns[:, column] = ordered[[round(share * (count - 1)) for share in shares]]
        return columns

    def mean(self, values: Floats | Bools) -> Floats:
        """Return (c,) the mean of the values of each column, NaN where it holds none."""
        present = np.isfinite(values)
        counts = np.add.reduceat(present.astype(np.int64), self.start)
        sums = np.add.reduceat(np.where(present, values, 0.0), self.start)
        return self._spread(np.where(counts > 0, sums / np.maximum(counts, 1), np.nan))

    def highest_rows(self, values: Floats) -> Ints:
        """Return (k,) the row of the largest value of each column that holds a sample."""
        known = np.where(np.isfinite(values), values, -np.inf)
        largest = np.maximum.reduceat(known, self.start)
        counts = np.diff(self.start, append=self.rows)
        is_largest = np.flatnonzero(known == np.repeat(largest, counts))
        rows: Ints = is_largest[np.searchsorted(is_largest, self.start)]
        return rows

    def is_hatch(self, values: Floats, height: float) -> bool:
        """Return whether a line through the values would fill columns of a panel ``height`` high.

        A step, a ramp or a few peaks stay a line however many samples they have.
        """
        if self.rows < 4 * len(self.held):
            return False
        low, high = (each[self.held] for each in self.extremes(values))
        extent = np.nan_to_num(high - low)
        present = np.where(np.isfinite(values), values, np.nan)
        step = np.nan_to_num(np.abs(np.diff(present, append=present[-1:])))
        way = np.add.reduceat(step, self.start)
        filled = (extent > _TALL * height) & (way > _TURNS * extent)
        return bool(np.count_nonzero(filled) > _FILLED * len(self.held))

    def _spread(self, values: Floats) -> Floats:
        """Return values of the columns that hold samples among all columns."""
        spread = np.full(len(self.edge_s) - 1, np.nan)
        spread[self.held] = values
        return spread
