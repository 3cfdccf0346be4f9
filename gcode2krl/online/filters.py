"""The quasi-static part of a sensor's signal: low-pass, moving average (Haehn & Weigold 2020, section 2.2).

A filter is one compiled loop over rows that carries its state from call to call, so that a whole stream and
the same stream sample by sample give the same bits.
"""

import math
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell.sections.online import Online
from gcode2krl.compiled.core import FLOAT, FLOATS, INT, OUT_BOOLS, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.compiled.inputs import shaped

WIDTH = 6
"""Force x, y, z in N and moment x, y, z in N·mm."""

_filter = core_function(
    "online_filter",
    *(FLOATS, OUT_FLOATS, OUT_FLOATS, OUT_INTS),
    *(FLOAT, INT, FLOAT),
    *(OUT_FLOATS, OUT_BOOLS),
)


class FilterState(NamedTuple):
    """State of the filter."""

    low: Floats
    """(6,) output of the low-pass."""
    window: Floats
    """(k, 6) the last k outputs of the low-pass."""
    counts: Ints
    """(2,) samples so far; samples in a row that were not numbers."""


def filter_start(settings: Online) -> FilterState:
    """Return the state before the first sample, which then fills it: no transient at the start."""
    length = max(1, round(settings.average_s / settings.cycle_s))
    return FilterState(np.zeros(WIDTH), np.zeros((length, WIDTH)), np.zeros(2, dtype=np.int64))


def filtered(state: FilterState, load: Floats, settings: Online) -> tuple[FilterState, Floats, Bools]:
    """Return the filtered loads (n, 6), and (n,) True where the sensor is lost.

    First-order low-pass, exact for an input that is held over a cycle, then the mean of the last
    ``average_s``. A sample that is not a number, or above ``most_force_N``, leaves the output unchanged;
    more of them in a row than ``sensor_hold_s`` mean a lost sensor, and so does, at once, a force that is too
    large for a cut.
    """
    values = shaped("load", load, -1, WIDTH)
    after = FilterState(state.low.copy(), state.window.copy(), state.counts.copy())
    out, lost = np.empty(values.shape), np.zeros(len(values), dtype=np.bool_)
    share = -math.expm1(-2.0 * math.pi * settings.lowpass_hz * settings.cycle_s)
    allowed = round(settings.sensor_hold_s / settings.cycle_s)
    _filter(values, after.low, after.window, after.counts, share, allowed, settings.most_force_N, out, lost)
    return after, out, lost
