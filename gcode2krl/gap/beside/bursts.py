"""Bursts and outliers: rows in which a signal is far rougher than usual; `events` says whose they are.

Fourth differences of measured less model have nothing of drifts, effects and vibration of some tens of hertz,
and of a jump a few rows only; in a burst their median over a tenth of a second rises. A single row far from
its neighbours, which agree with each other, is an outlier. A component of which more than a small part would
go has neither: that is then how the instrument, or what it sees, is.
"""

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.gap.thresholds import THRESHOLDS

LIMITS = THRESHOLDS.beside
_WEIGHTS = (1.0, -4.0, 6.0, -4.0, 1.0)
_LEAST_WINDOW = 9
"""Rows, so that the differences around one jump are fewer than half of a window."""
_LEAST_SCALE = 1e-12


def loud_rows(time_s: Floats, values: Floats, segments: Ints, model: Floats | None = None) -> Bools:
    """Return which rows (n,) of values (n, k) are in a burst or outliers, in any component.

    Rows stay at which the ``model`` (n, k) itself is as rough as the values usually are: what is left there
    is the model's.
    """
    loud = np.zeros(len(values), dtype=bool)
    if len(values) < 2 * _LEAST_WINDOW:
        return loud
    window = max(_LEAST_WINDOW, round(LIMITS.burst_s / float(np.median(np.diff(time_s))))) | 1
    for j, column in enumerate(values.T):
        rough = np.abs(_fourth_differences(column, segments))
        usual = float(np.median(rough[np.isfinite(rough)])) if np.isfinite(rough).any() else 0.0
        if usual <= _LEAST_SCALE:  # the last decimal, or nothing, moves
            continue
        rows = _widened(_local(rough, usual, window) > LIMITS.burst_times * usual, window // 2)
        rows |= _outliers(column, segments, usual)
        if model is not None:
            rows &= ~_widened(np.abs(_fourth_differences(model[:, j], segments)) > usual, window)
        if np.mean(rows) <= LIMITS.bursts_most:
            loud |= rows
    return loud


def _local(rough: Floats, usual: float, window: int) -> Floats:
    """Return the median (n,) of a roughness around each row."""
    from scipy.ndimage import median_filter

    local: Floats = median_filter(np.where(np.isfinite(rough), rough, usual), size=window, mode="nearest")
    return local


def _fourth_differences(values: Floats, segments: Ints) -> Floats:
    """Return fourth differences (n,) around each row; not a number at two rows at each end of a segment."""
    found = np.full(len(values), np.nan)
    for first, last in segments:
        if last - first >= len(_WEIGHTS):
            found[first + 2 : last - 2] = np.convolve(values[first:last], _WEIGHTS, mode="valid")
    return found


def _outliers(values: Floats, segments: Ints, usual: float) -> Bools:
    """Return which rows (n,) are far from both neighbours, which agree with each other."""
    far = np.zeros(len(values), dtype=bool)
    for first, last in segments:
        x = values[first:last]
        if len(x) < 3:
            continue
        beside = 0.5 * (x[:-2] + x[2:])
        off = np.abs(x[1:-1] - beside)
        # of normal values the median fourth difference is 5.6 deviations
        least = LIMITS.outlier_deviations * usual / 5.6
        far[first + 1 : last - 1] = (off > least) & (np.abs(x[2:] - x[:-2]) < 0.5 * off)
    return far


def _widened(rows: Bools, by: int) -> Bools:
    """Return rows (n,) with this many on either side."""
    widened: Bools = np.convolve(rows, np.ones(2 * by + 1), mode="same") > 0.5
    return widened
