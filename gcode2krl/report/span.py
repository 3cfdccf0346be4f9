"""What a panel's axis covers: not a single spike that would flatten everything else."""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.report.columns import TimeColumns

_IN_COLUMN = 0.995
"""Quantile of a column's samples that counts as its largest: what is rarer is a spike in every column."""
_USUAL_PERCENT = 95.0
"""Percentile of the columns, of those that are not zero."""
_SPIKE = 4.0
"""A largest value of more than this times the usual one is left out of the axis."""
_ROOM = 1.25
"""Where the axis ends beyond the usual largest value."""


class Span(NamedTuple):
    """Range of an axis. Values beyond it exist where ``cut_high`` or ``cut_low`` says so."""

    low: float
    high: float
    cut_low: bool
    cut_high: bool

    @property
    def height(self) -> float:
        """What the axis covers."""
        return self.high - self.low

    def beyond(self, values: Floats) -> Bools:
        """Return (m,) where values lie outside."""
        outside: Bools = (values > self.high) | (values < self.low)
        return outside


def span_of(columns: TimeColumns, values: Floats, keep: Floats | float = 0.0) -> Span:
    """Return the range in which the values (m,) are drawn.

    A side ends at its largest value. Where that is more than 4 times the usual one, it ends at 1.25 times the
    usual one: the 95th percentile of what 99.5 % of a column's samples do not exceed. ``keep`` holds values
    that must be inside.
    """
    low, high = columns.quantiles(values, (1.0 - _IN_COLUMN, _IN_COLUMN))
    present = values[np.isfinite(values)]
    kept = np.atleast_1d(np.asarray(keep, dtype=np.float64))
    kept = kept[np.isfinite(kept)] if np.isfinite(kept).any() else np.zeros(1)
    top, cut_high = _side(high, float(present.max(initial=0.0)), float(kept.max()))
    bottom, cut_low = _side(-low, float(-present.min(initial=0.0)), float(-kept.min()))
    pad = 0.05 * (top + bottom) or 0.5
    top += 0.0 if cut_high else pad
    bottom += 0.0 if cut_low or bottom == 0.0 else pad
    return Span(-bottom, top, cut_low, cut_high)


def _side(peaks: Floats, largest: float, keep: float) -> tuple[float, bool]:
    """Return where one side of the axis ends, and whether values lie beyond it."""
    peaks = peaks[np.isfinite(peaks)]
    largest = max(largest, keep, 0.0)
    counted = peaks[peaks > 1e-9 * largest]
    if not len(counted):
        return largest, False
    usual = max(float(np.percentile(counted, _USUAL_PERCENT)), keep)
    if largest <= _SPIKE * usual:
        return largest, False
    return _ROOM * usual, True
