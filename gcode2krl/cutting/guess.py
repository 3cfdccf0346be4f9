"""The raw part that a program seems to expect, where the cell states none.

In the plane it is the box of the feed moves, widened by the tool's radius; its underside is the lowest feed
point. Its top follows from what the feed moves cut and from where they are entered; a rapid at cutting depth
never lowers it, because that rapid may be the mistake that the stock is to reveal:

- The *cutting height* is the height below which 95 % of the feed travel across the tool axis runs, without
  the descents that a feed run begins with, the rises it ends with, and travel at the highest entry's height.
- Zero is the top where cuts lie below it, ignoring skimming at zero itself: posts put Z0 on top of the stock
or
  on its underside. (Not where the cut would be deeper than the edges are long: that zero lies elsewhere.)
- Otherwise the top is the highest entry, where a feed run begins after a rapid, or the height of most level
  rapids if that is lower; but the first pass is assumed to be no deeper than the step from the highest level
  of the cuts to the next, or, where all have one level, than the largest tool is wide.

A program at zero or above that never rises above its cutting height moves in the air: no stock is left then.
All of it is an assumption, so its findings are warnings.
"""

from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.compiled.inputs import distinct
from gcode2krl.tables import Toolpath

FLAT_MM = 1e-6
"""Shorter rises and travels are rounding of the G-code's numbers."""
_MOST = 0.95
_SAME_LEVEL = 0.02
"""Least difference of two levels, as a fraction of the largest tool's radius."""
_SOME = 0.1
"""Fraction of the feed travel that must remain without entries and exits; else all of it counts."""


@dataclass(frozen=True)
class _Feed:
    """The feed moves of a program (f rows) in the frame of the field."""

    start_mm: Floats
    end_mm: Floats
    entry: Bools
    """(f,) True where a rapid, or nothing, comes before."""
    exit: Bools
    """(f,) True where a rapid, or nothing, follows."""

    @property
    def across_mm(self) -> Floats:
        """Travel (f,) normal to the tool axis."""
        x, y = (self.end_mm - self.start_mm)[:, :2].T
        return np.asarray(np.sqrt(x * x + y * y))

    @property
    def rise_mm(self) -> Floats:
        return np.asarray(self.end_mm[:, 2] - self.start_mm[:, 2])


def guessed_box(toolpath: Toolpath, to_field: Floats, radius_mm: float, deepest_mm: float = np.inf) -> Floats:
    """Return the low and the high corner (2, 3) in mm of the stock that the program seems to expect.

    Parameters
    ----------
    to_field : (3, 3) rotation from ``$BASE`` to the field, whose z is the tool axis.
    radius_mm : of the largest tool.
    deepest_mm : length of its edges: no sound cut is deeper.
    """
    known = toolpath.is_position()
    position = toolpath.position_mm @ to_field.T
    feed = _feed_moves(toolpath, position, known)
    if not len(feed.end_mm):
        start = position[known][:1] if known.any() else np.zeros((1, 3))
        return np.array([start[0] - radius_mm, start[0] + [radius_mm, radius_mm, 0.0]])
    ways = list(zip(feed.start_mm.T[:2], feed.end_mm.T[:2], strict=True))  # numpy is slow along pairs
    low = np.array([min(start.min(), end.min()) for start, end in ways]) - radius_mm
    high = np.array([max(start.max(), end.max()) for start, end in ways]) + radius_mm
    bottom = float(feed.end_mm[:, 2].min())
    deepest_mm = (
        deepest_mm if np.allclose(to_field, np.eye(3)) else -np.inf
    )  # zero has no meaning along a tilted axis
    rapids = _level_rapids(toolpath, position)
    highest = float(position[known & ~toolpath.machine, 2].max())
    top = max(_top(feed, rapids, highest, radius_mm, deepest_mm), bottom)
    return np.array([[*low, bottom], [*high, top]])


def _feed_moves(toolpath: Toolpath, position: Floats, known: Bools) -> _Feed:
    feed = known & ~toolpath.rapid & np.isfinite(toolpath.feed_mm_s) & ~toolpath.machine
    feed[0] = False
    feed[1:] &= known[:-1]
    rows = np.flatnonzero(feed)
    before = np.concatenate([[False], feed[:-1]])
    behind = np.concatenate([feed[1:], [False]])
    return _Feed(position[rows - 1], position[rows], ~before[rows], ~behind[rows])


def _level_rapids(toolpath: Toolpath, position: Floats) -> Floats:
    """Return the heights of the rapids that stay at their height; X and Y need not be known."""
    known = toolpath.known[:, 2]
    rapid = known & toolpath.rapid & ~toolpath.machine
    rapid[1:] &= known[:-1]
    rows = np.flatnonzero(rapid[1:]) + 1
    step = position[rows] - position[rows - 1]
    level = (np.abs(step[:, 2]) <= FLAT_MM) & (np.linalg.norm(step[:, :2], axis=1) > FLAT_MM)
    return np.asarray(position[rows[level], 2])


def _top(feed: _Feed, rapids: Floats, highest_mm: float, radius_mm: float, deepest_mm: float) -> float:
    highest_entry = float(feed.start_mm[feed.entry, 2].max())
    cuts = _Cuts.of(feed, highest_entry)
    skims = abs(cuts.height_mm) <= FLAT_MM and cuts.middle_mm < 0.0
    if (cuts.height_mm < 0.0 or skims) and -cuts.height_mm <= deepest_mm:
        return 0.0
    if highest_mm <= cuts.height_mm + FLAT_MM:
        return cuts.height_mm
    tops = [cuts.height_mm + cuts.first_pass_mm(radius_mm)]
    if highest_entry > cuts.height_mm + FLAT_MM:
        tops.append(highest_entry)
    sound = np.sort(rapids[rapids > cuts.height_mm + FLAT_MM])
    if len(sound):
        tops.append(float(sound[len(sound) // 2]))
    top = min(tops)
    return top if np.isfinite(top) else highest_mm  # holes alone, and no way above them


@dataclass(frozen=True)
class _Cuts:
    """Where the feed moves cut."""

    height_mm: float
    """95 % of the travel is below."""
    middle_mm: float
    """Half of the travel is below."""
    levels_mm: Floats
    """Heights of the level cuts, from below."""
    across: bool = True
    """False if there are only holes."""

    @classmethod
    def of(cls, feed: _Feed, highest_entry: float) -> "_Cuts":
        across, middle = feed.across_mm, 0.5 * (feed.start_mm[:, 2] + feed.end_mm[:, 2])
        if not (across > FLAT_MM).any():  # holes only
            ends = feed.end_mm[feed.rise_mm < -FLAT_MM, 2]
            ends = ends if len(ends) else feed.end_mm[:, 2]
            return cls(float(ends.max()), float(np.median(ends)), np.zeros(0), across=False)
        cuts = across > FLAT_MM
        below = cuts & (np.maximum(feed.start_mm[:, 2], feed.end_mm[:, 2]) < highest_entry - FLAT_MM)
        for narrower in (below, below & ~_entries_and_exits(feed)):
            if across[narrower].sum() > _SOME * across[cuts].sum():
                cuts = narrower
        order = np.argsort(middle[cuts])
        height, travel = middle[cuts][order], np.cumsum(across[cuts][order])
        most, half = (
            float(height[min(np.searchsorted(travel, share * travel[-1]), len(height) - 1)])
            for share in (_MOST, 0.5)
        )
        level = cuts & (np.abs(feed.rise_mm) <= FLAT_MM) & (middle <= most + FLAT_MM)
        return cls(most, half, distinct(middle[level]))

    def first_pass_mm(self, radius_mm: float) -> float:
        """Return how deep the first pass may be; infinite if there are only holes."""
        if not self.across:
            return np.inf
        steps = self.levels_mm[-1:] - self.levels_mm
        return float(steps[steps >= _SAME_LEVEL * radius_mm].min(initial=2.0 * radius_mm))


def _entries_and_exits(feed: _Feed) -> Bools:
    """Return (f,) True for the descents that a feed run begins with and the rises it ends with."""
    return (
        _leading(feed.rise_mm < -FLAT_MM, feed.entry)
        | _leading(feed.rise_mm[::-1] > FLAT_MM, feed.exit[::-1])[::-1]
    )


def _leading(wanted: Bools, first: Bools) -> Bools:
    """Return True for the wanted rows at the beginning of each run, up to the first that is not."""
    row = np.arange(len(wanted))
    begin = np.maximum.accumulate(np.where(first, row, -1))
    other = np.maximum.accumulate(np.where(wanted, -1, row))
    result: Bools = wanted & (other < begin)
    return result
