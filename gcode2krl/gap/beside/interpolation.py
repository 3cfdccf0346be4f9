"""Signals between their samples."""

import numba
import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Signals

_PATHS = {
    "tcp_base_mm": "position_mm",
    "q_cmd_rad": "q_cmd_rad",
    "q_act_rad": "q_cmd_rad",
    "q_load_rad": "q_cmd_rad",
}
"""Signals that follow the commanded path closely: the path is interpolated by cubics, the rest by lines."""


def values_of(signals: Signals, name: str) -> Floats:
    """Return a signal (m, c); the motor side is the measured one where the inputs have it."""
    if name == "q_act_rad" and signals.inputs.q_act_rad is not None:
        return signals.inputs.q_act_rad
    values: Floats = getattr(signals, name)
    return values


class LastPath:
    """The commanded path at the times at which it was last asked for: that of hundreds of simulations."""

    def __init__(self) -> None:
        self._asked: tuple[Floats, Floats, Floats] | None = None
        self._found: Floats = np.zeros((0, 0))

    def at(self, times_s: Floats, own_s: Floats, path: Floats) -> Floats:
        """Return the path (m, c) at other times, as `cubic`."""
        if self._asked is None or not _is_same((times_s, own_s, path), self._asked):
            self._asked, self._found = (times_s, own_s, path), cubic(times_s, own_s, path)
        return self._found


def _is_same(asked: tuple[Floats, Floats, Floats], before: tuple[Floats, Floats, Floats]) -> bool:
    if asked[1] is not before[1] or asked[2] is not before[2]:
        return False
    return asked[0] is before[0] or np.array_equal(asked[0], before[0])


def interpolate(signals: Signals, name: str, times_s: Floats, last: LastPath | None = None) -> Floats:
    """Return a signal at other times: the commanded path in it by cubics, what deviates from it by lines.

    A line between samples 12 ms apart is off by a·dt²/8, 0.04 mm at 2 m/s²; a cubic is not. ``last`` keeps
    the path between calls.
    """
    last = last or LastPath()
    values = values_of(signals, name)
    path = getattr(signals.inputs, _PATHS[name], None) if name in _PATHS else None
    if path is None:
        return linear(times_s, signals.time_s, values)
    if values is path:
        return last.at(times_s, signals.time_s, path).copy()
    return last.at(times_s, signals.time_s, path) + linear(times_s, signals.time_s, values - path)


def linear(times_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return the columns (m, c) at other times, linearly; the ends are held."""
    row, share = _place(times_s, own_s)
    found: Floats = _lines(row, share, np.ascontiguousarray(values, dtype=np.float64))
    return found


def cubic(times_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return the columns (m, c) at other times by cubic Hermite pieces with central slopes; ends are held."""
    if len(own_s) < 2:
        raise ValueError("a cubic needs two samples at least")
    row, share = _place(times_s, own_s)
    own_s, values = (np.ascontiguousarray(each, dtype=np.float64) for each in (own_s, values))
    found: Floats = _cubics(row, share, own_s, values)
    return found


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _lines(row: Ints, share: Floats, values: Floats) -> Floats:
    found = np.empty((len(row), values.shape[1]))
    for i in range(len(row)):
        for c in range(values.shape[1]):
            a, b = values[row[i], c], values[row[i] + 1, c]
            found[i, c] = a + share[i] * (b - a)
    return found


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _cubics(row: Ints, share: Floats, own_s: Floats, values: Floats) -> Floats:
    found = np.empty((len(row), values.shape[1]))
    for i in range(len(row)):
        at, u = row[i], share[i]
        width = own_s[at + 1] - own_s[at]
        for c in range(values.shape[1]):
            a, b = values[at, c], values[at + 1, c]
            da, db = _slope(own_s, values, at, c) * width, _slope(own_s, values, at + 1, c) * width
            bend = 3.0 * (b - a) - 2.0 * da - db + u * (2.0 * (a - b) + da + db)
            found[i, c] = a + u * (da + u * bend)
    return found


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _slope(own_s: Floats, values: Floats, at: int, c: int) -> float:
    """Return the slope at a row to second order in uneven steps, that of the only step at an end."""
    last = len(own_s) - 1
    if at in (0, last):
        low = 0 if at == 0 else last - 1
        return float((values[low + 1, c] - values[low, c]) / (own_s[low + 1] - own_s[low]))
    before, after = own_s[at] - own_s[at - 1], own_s[at + 1] - own_s[at]
    to, off = values[at + 1, c] - values[at, c], values[at, c] - values[at - 1, c]
    return float((before / after * to + after / before * off) / (before + after))


def nearest_rows(own_s: Floats, times_s: Floats) -> Ints:
    """Return the row (n,) of the sample nearest to each time."""
    row, share = _place(times_s, own_s)
    return row + (share > 0.5)


def _place(times_s: Floats, own_s: Floats) -> tuple[Ints, Floats]:
    """Return the row (n,) before each time, the last but one at most, and the share (n,) of the way on."""
    times_s, own_s = (np.ascontiguousarray(each, dtype=np.float64) for each in (times_s, own_s))
    place: tuple[Ints, Floats] = _placed(times_s, own_s)
    return place


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _placed(times_s: Floats, own_s: Floats) -> tuple[Ints, Floats]:
    rows, shares = np.empty(len(times_s), dtype=np.int64), np.empty(len(times_s))
    row, last = 0, len(own_s) - 2
    for i in range(len(times_s)):
        if own_s[row] > times_s[i] or (row < last and own_s[min(row + 8, last)] <= times_s[i]):
            row = min(max(np.searchsorted(own_s, times_s[i], side="right") - 1, 0), last)
        while row < last and own_s[row + 1] <= times_s[i]:  # times mostly follow each other
            row += 1
        share = (times_s[i] - own_s[row]) / (own_s[row + 1] - own_s[row])
        rows[i], shares[i] = row, min(max(share, 0.0), 1.0)
    return rows, shares
