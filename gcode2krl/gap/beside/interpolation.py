"""Signals between their samples."""

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.compiled.core import FLOATS, INTS, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.effects import Signals

_fill_place = core_function("gap_place", FLOATS, FLOATS, OUT_INTS, OUT_FLOATS)
_fill_lines = core_function("gap_lines", INTS, FLOATS, FLOATS, OUT_FLOATS)
_fill_cubics = core_function("gap_cubics", INTS, FLOATS, FLOATS, FLOATS, OUT_FLOATS)

_PATHS = {
    "tcp_base_mm": "position_mm",
    "q_cmd_rad": "q_cmd_rad",
    "q_act_rad": "q_cmd_rad",
    "q_load_rad": "q_cmd_rad",
}
"""Signals that follow the commanded path closely: the path is interpolated by cubics, the rest by lines."""


def follows_path(name: str) -> bool:
    """Tell whether a signal follows the commanded path closely."""
    return name in _PATHS


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
    found = np.empty((len(row), values.shape[1]))
    _fill_lines(row, share, np.ascontiguousarray(values, dtype=np.float64), found)
    return found


def cubic(times_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return the columns (m, c) at other times by cubic Hermite pieces with central slopes; ends are held."""
    if len(own_s) < 2:
        raise ValueError("a cubic needs two samples at least")
    row, share = _place(times_s, own_s)
    own_s, values = (np.ascontiguousarray(each, dtype=np.float64) for each in (own_s, values))
    found = np.empty((len(row), values.shape[1]))
    _fill_cubics(row, share, own_s, values, found)
    return found


def nearest_rows(own_s: Floats, times_s: Floats) -> Ints:
    """Return the row (n,) of the sample nearest to each time."""
    row, share = _place(times_s, own_s)
    return row + (share > 0.5)


def _place(times_s: Floats, own_s: Floats) -> tuple[Ints, Floats]:
    """Return the row (n,) before each time, the last but one at most, and the share (n,) of the way on."""
    times_s, own_s = (np.ascontiguousarray(each, dtype=np.float64) for each in (times_s, own_s))
    row, share = np.empty(len(times_s), dtype=np.int64), np.empty(len(times_s))
    _fill_place(times_s, own_s, row, share)
    return row, share
