"""Which trigger announces a knot: the motion that carries it and its delay."""

from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats, Rows
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import FLOAT, FLOATS, INT, INTS, OUT_INTS, core_function
from gcode2krl.krl.advance import view
from gcode2krl.krl.windows import Windows
from gcode2krl.units import MS_PER_S

_BEYOND = np.iinfo(np.int64).max // 2

_place_latest = core_function(
    "krl_place_latest", FLOATS, FLOATS, INTS, FLOATS, FLOATS, FLOAT, INT, INT, OUT_INTS, OUT_INTS
)
_delay_at_starts = core_function("krl_delay_at_starts", FLOATS, FLOATS, FLOATS, FLOAT, OUT_INTS, OUT_INTS)


@dataclass(frozen=True)
class Triggers:
    """A row per knot (k): ``TRIGGER WHEN DISTANCE=0 DELAY=delay`` before the motion ``row``."""

    row: Rows
    """(k,) row of Targets; -1 where no motion is left that could carry the trigger."""
    order: Rows
    """(k,) that motion's number in the order in which the advance run reads; beyond all without a motion."""
    delay_ms: Rows
    fire_s: Floats
    """(k,) instant in the time of the Motion; NaN without a motion."""


def place_triggers(
    deadline_s: Floats, earliest_s: Floats, windows: Windows, cell: Cell, *, spread: bool = False
) -> Triggers:
    """Return the latest triggers at or before deadlines (k,), rising, a cycle apart and in whole ms.

    Each instant lies within the motion that carries it; one in a corner moves to the nearest earlier one
    that can be reached. Where that would be before ``earliest_s`` (k,), the start of a section, triggers
    follow each other from there as early as they can, and later than their deadline. ``spread`` moves
    triggers to earlier motions where too many would wait at the same time.
    """
    count = len(deadline_s)
    window = np.full(count, -1, dtype=np.int64)
    delay = np.zeros(count, dtype=np.int64)
    if len(windows.row) == 0:
        return Triggers(window, np.full(count, _BEYOND), delay, np.full(count, np.nan))
    begin_s, end_s, cycle_s = windows.begin_s, windows.end_s, cell.controller.cycle_s
    in_view = view(cell) if spread else 0
    most = cell.pilot.max_active
    _place_latest(
        deadline_s, earliest_s, windows.order, begin_s, end_s, cycle_s, most, in_view, window, delay
    )
    _delay_at_starts(earliest_s, begin_s, end_s, cycle_s, window, delay)
    has_window = window >= 0
    fire_s = windows.begin_s[window] + delay / MS_PER_S
    return Triggers(
        row=np.where(has_window, windows.row[window], -1),
        order=np.where(has_window, windows.order[window], _BEYOND),
        delay_ms=delay,
        fire_s=np.where(has_window, fire_s, np.nan),
    )
