"""Signals between their samples."""

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


def interpolate(signals: Signals, name: str, times_s: Floats) -> Floats:
    """Return a signal at other times: the commanded path in it by cubics, what deviates from it by lines.

    A line between samples 12 ms apart is off by a·dt²/8, 0.04 mm at 2 m/s²; a cubic is not.
    """
    values = values_of(signals, name)
    path = getattr(signals.inputs, _PATHS[name], None) if name in _PATHS else None
    if path is None:
        return linear(times_s, signals.time_s, values)
    return cubic(times_s, signals.time_s, path) + linear(times_s, signals.time_s, values - path)


def linear(times_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return the columns (m, c) at other times, linearly; the ends are held."""
    row, share = _place(times_s, own_s)
    found: Floats = values[row] + share[:, None] * (values[row + 1] - values[row])
    return found


def cubic(times_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return the columns (m, c) at other times by cubic Hermite pieces with central slopes; ends are held."""
    row, u = _place(times_s, own_s)
    slope = np.gradient(values, own_s, axis=0)
    width, u = (own_s[row + 1] - own_s[row])[:, None], u[:, None]
    a, b = values[row], values[row + 1]
    da, db = slope[row] * width, slope[row + 1] * width
    found: Floats = a + u * (da + u * (3.0 * (b - a) - 2.0 * da - db + u * (2.0 * (a - b) + da + db)))
    return found


def nearest_rows(own_s: Floats, times_s: Floats) -> Ints:
    """Return the row (n,) of the sample nearest to each time."""
    row, share = _place(times_s, own_s)
    return row + (share > 0.5)


def _place(times_s: Floats, own_s: Floats) -> tuple[Ints, Floats]:
    row = np.clip(np.searchsorted(own_s, times_s, side="right") - 1, 0, len(own_s) - 2)
    share = np.clip((times_s - own_s[row]) / (own_s[row + 1] - own_s[row]), 0.0, 1.0)
    return row, share
