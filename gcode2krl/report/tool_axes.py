"""The tool along a path: from tip towards holder, at places evenly along the feed moves."""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.tables import Toolpath

_TOOLS = 120
_LENGTH = 0.14
"""Length of a drawn tool, as a fraction of the largest extent of the feed moves."""


class ToolAxes(NamedTuple):
    """Tools that are drawn, and which rows of the Toolpath have a place and cut."""

    rows: Ints
    """(k,) of the Toolpath."""
    ends_mm: Floats
    """(k, 2, 3) tip, and a point towards the holder."""
    has_place: Bools
    is_feed: Bools


def drawn_tools(toolpath: Toolpath) -> ToolAxes:
    """Return the tools that a picture of a Toolpath shows, ``(k, 2, 3)`` in mm in the frame of its tips."""
    place = toolpath.known.all(axis=1) & ~toolpath.machine
    place[0] = False
    feed = place & ~toolpath.rapid
    shown = feed if feed.any() else place
    tips = toolpath.position_mm
    extent_mm = max(float(np.ptp(tips[shown], axis=0).max()), 1.0) if shown.any() else 1.0
    rows = _evenly(tips, shown)
    ends = np.stack([tips[rows], tips[rows] + _LENGTH * extent_mm * toolpath.axis[rows]], axis=1)
    return ToolAxes(rows, ends, place, feed)


def _evenly(tips: Floats, shown: Bools) -> Ints:
    """Return rows that are evenly spread along the way of those that are shown."""
    rows = np.flatnonzero(shown)
    if len(rows) <= _TOOLS:
        return rows
    way_mm = np.cumsum(np.linalg.norm(np.diff(tips[rows], axis=0, prepend=tips[rows[:1]]), axis=1))
    return np.unique(rows[np.searchsorted(way_mm, np.linspace(0.0, way_mm[-1], _TOOLS))])
