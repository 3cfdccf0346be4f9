"""Which trigger announces a knot: the motion that carries it and its delay."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from gcode2krl.arrays import Floats, Rows
from gcode2krl.cell import Cell
from gcode2krl.krl.advance import view
from gcode2krl.krl.windows import Windows
from gcode2krl.units import MS_PER_S

_BEYOND = np.iinfo(np.int64).max // 2
_TINY_S = 1e-9
"""Instants closer than this are the same."""
_BETWEEN_S = 0.003
"""Added to the cycle between triggers of different motions: each motion's start, read from the samples of a
Motion, may be off by half of it. Delays within one motion are exact."""


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
    found = window >= 0
    fire_s = windows.begin_s[window] + delay / MS_PER_S
    return Triggers(
        row=np.where(found, windows.row[window], -1),
        order=np.where(found, windows.order[window], _BEYOND),
        delay_ms=delay,
        fire_s=np.where(found, fire_s, np.nan),
    )


@njit(cache=True, nogil=True)
def _place_latest(
    deadline: Floats,
    earliest: Floats,
    row: Rows,
    begin: Floats,
    end: Floats,
    cycle: float,
    most: int,
    in_view: int,
    window: Rows,
    delay: Rows,
) -> None:
    """Write window and delay of the latest trigger for each deadline, the last first.

    Where that would be before the start of its section, the window stays -1.
    """
    count = len(deadline)
    limit, behind = np.inf, -1
    for j in range(count - 1, -1, -1):
        latest = min(deadline[j], limit)
        w = np.searchsorted(begin, latest + _TINY_S, side="right") - 1
        if w != behind:
            latest = min(latest, limit - _BETWEEN_S)
            w = np.searchsorted(begin, latest + _TINY_S, side="right") - 1
        other = window[j + most] if in_view > 0 and j + most < count else -1
        if other >= 0:  # they must not be in view at the same time
            w = min(w, np.searchsorted(row, row[other] - in_view, side="right") - 1)
            latest = min(latest, end[w], limit - (_BETWEEN_S if w != behind else 0.0)) if w >= 0 else -np.inf
        if w < 0 or latest < earliest[j] - _TINY_S:
            limit, behind = min(latest, earliest[j]) - cycle, -1
            continue
        ms = max(0, int(np.floor((min(latest, end[w]) - begin[w]) * MS_PER_S + 1e-6)))
        fire = begin[w] + ms / MS_PER_S
        if fire < earliest[j] - _TINY_S:
            limit, behind = earliest[j] - cycle, -1
            continue
        window[j], delay[j] = w, ms
        limit, behind = fire - cycle, w


@njit(cache=True, nogil=True)
def _delay_at_starts(
    earliest: Floats, begin: Floats, end: Floats, cycle: float, window: Rows, delay: Rows
) -> None:
    """Move triggers that are too early, or too close to the one before, to the next instant that is free.

    This happens at the start of a section. It ends at the first trigger for which no motion is left.
    """
    last = -np.inf
    for j in range(len(window)):
        fire = begin[window[j]] + delay[j] / MS_PER_S if window[j] >= 0 else -np.inf
        wanted = max(earliest[j], last + cycle)
        if fire < wanted - _TINY_S:
            w = np.searchsorted(end, wanted - _TINY_S, side="left")
            window[j] = -1
            while w < len(end) and window[j] < 0:
                ms = max(0, int(np.ceil((wanted - begin[w]) * MS_PER_S - 1e-6)))
                fire = begin[w] + ms / MS_PER_S
                if fire <= end[w] + _TINY_S:
                    window[j], delay[j] = w, ms
                w += 1
            if window[j] < 0:
                return
        last = fire
