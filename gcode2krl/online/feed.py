"""Direction of feed, from the commanded positions."""

from typing import NamedTuple

import numba
import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell.sections.online import Online
from gcode2krl.compiled.inputs import read_only

WINDOW_S = 0.020
"""Positions have few decimals: over this time the direction is accurate to 1° at 25 mm/s and 0.01 mm."""
LEAST_MM = 0.02
"""A shorter movement within the window is a standstill, which has no direction: the last one is kept, so that
stopping does not itself move the tool."""


class FeedState(NamedTuple):
    """State of the direction."""

    positions: Floats
    """(k, 3) the last commanded positions in mm."""
    counts: Ints
    """(1,) samples so far."""
    direction: Floats
    """(3,) the last direction; zero before the first movement."""


def feed_start(settings: Online) -> FeedState:
    """Return the state before the first sample."""
    length = max(1, round(WINDOW_S / settings.cycle_s))
    return FeedState(np.zeros((length, 3)), np.zeros(1, dtype=np.int64), np.zeros(3))


def feed_of(state: FeedState, position_mm: Floats) -> tuple[FeedState, Floats]:
    """Return the feed (n, 3) of commanded positions (n, 3): how far the tool came within the window."""
    values = read_only("position_mm", position_mm, -1, 3)
    after = FeedState(state.positions.copy(), state.counts.copy(), state.direction.copy())
    out = np.empty(values.shape)
    _feed(values, *after, out)
    return after, out


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _feed(position: Floats, ring: Floats, count: Ints, direction: Floats, out: Floats) -> None:
    length = ring.shape[0]
    for i in range(len(position)):
        if count[0] == 0:
            for k in range(length):
                ring[k] = position[i]
        at = count[0] % length
        moved = 0.0
        for c in range(3):
            moved += (position[i, c] - ring[at, c]) ** 2
        if moved >= LEAST_MM * LEAST_MM:
            for c in range(3):
                direction[c] = position[i, c] - ring[at, c]
        ring[at] = position[i]
        count[0] += 1
        out[i] = direction
