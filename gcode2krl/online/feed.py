"""Direction of feed, from the commanded positions."""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell.sections.online import Online
from gcode2krl.compiled.core import FLOATS, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.compiled.inputs import shaped

WINDOW_S = 0.020
"""Positions have few decimals: over this time the direction is accurate to 1° at 25 mm/s and 0.01 mm."""
LEAST_MM = 0.02
"""A shorter movement within the window is a standstill, which has no direction: the last one is kept, so that
stopping does not itself move the tool."""

_feed = core_function("online_feed", FLOATS, OUT_FLOATS, OUT_INTS, OUT_FLOATS, OUT_FLOATS)


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
    values = shaped("position_mm", position_mm, -1, 3)
    after = FeedState(state.positions.copy(), state.counts.copy(), state.direction.copy())
    out = np.empty(values.shape)
    _feed(values, *after, out)
    return after, out
