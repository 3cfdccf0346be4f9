"""Places of external axes, how good they are, and what moving between them costs."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints

Quality = Callable[[Ints, Floats], Floats]
"""Rows (r,) of the targets and E1 to E6 (r, 6) to the quality (r, 8) of each branch there: 1 = far from
limits, singularities and obstacles, 0 = at one, below 0 = hits something, -1 = impossible."""

Bending = Callable[[Ints, Floats], Floats]
"""Rows (r,) of the targets and E1 to E6 (r, 6) to how far each branch (r, 8) bends under a load, NaN where
impossible."""

GOOD = 0.3
"""Quality (1 = 30 degrees from limits and singularities) from which a place is as good as any better one."""
LEAST = 0.05
"""Quality below which a place is not taken."""
STEPS = 49
"""Places that are tried on an axis, so that a rail of 5 m has one every 100 mm."""
REACHED = -0.99
"""Quality above which a place is reached, if only to hit something: that is a finding of its own."""
_MOST_PLACES = 1000
_AT_ONCE = 20_000
"""Rows at places that are judged in one call."""
MOST_THAT_BEND = 100_000
"""Rows at places whose bending is found, 5 to 50 us each."""
AS_STIFF = 0.05
"""Places that bend by so much more than the stiffest one count as equally stiff."""
_HITS_COST = 50.0
"""What a place costs at which something is hit, or nearly out of reach."""
_BENDS = 0.5
"""What a place costs at which the robot bends twice as far as at the best one there; at most that."""
_MOVES = 0.5
"""What a way over the whole range between two passes costs, against a place of no quality at all."""
_STARTS = 0.05
"""What any way between two passes costs, so that there are few."""
_WHOLE = 5.0
"""Places that are farther from each other are whole numbers, where the limits are."""
_DECIMALS = 3
"""Those of the program's text."""


@dataclass(frozen=True)
class Range:
    """A free axis: its column in E1 to E6, and its limits."""

    column: int
    low: float
    high: float

    @property
    def share(self) -> float:
        """Return the share of the range that a millimetre or degree is, 0 where there is no range."""
        return 1.0 / (self.high - self.low) if self.high > self.low else 0.0

    def places(self, steps: int) -> Floats:
        """Return places evenly over the range."""
        step = (self.high - self.low) / max(steps - 1, 1)
        places = np.round(np.linspace(self.low, self.high, steps), 0 if step > _WHOLE else _DECIMALS)
        return np.clip(places, self.low, self.high)


def tried_places(ranges: list[Range], start: Floats) -> Floats:
    """Return the places (k, 6) that are tried: a grid over all free axes."""
    steps = STEPS
    while steps ** len(ranges) > _MOST_PLACES:
        steps -= 2
    grids = [axis.places(steps) for axis in ranges]
    places = np.tile(start, (int(np.prod([len(grid) for grid in grids])), 1))
    for axis, column in zip(ranges, np.array(list(itertools.product(*grids))).T, strict=True):
        places[:, axis.column] = column
    return places


def widest(ranges: list[Range]) -> Range:
    """Return the axis that moves where one moves along; the others only help."""
    return max(ranges, key=lambda axis: axis.high - axis.low)


def with_others_best(table: Floats, places: Floats, ranges: list[Range]) -> Ints:
    """Return the places at which all axes but the widest are where the most rows can be reached.

    ``table`` (rows, places, branches) is the quality of rows.
    """
    others = [axis.column for axis in ranges if axis is not widest(ranges)]
    choices = np.unique(places[:, others], axis=0) if others else np.zeros((1, 0))

    def of(choice: Floats) -> Ints:
        return np.flatnonzero((places[:, others] == choice).all(axis=1))

    def reached(rows: Ints) -> int:
        return int((table[:, rows].max(axis=1) >= LEAST).sum(axis=0).max())

    return max((of(choice) for choice in choices), key=reached)


def quality_table(quality: Quality, rows: Ints, places: Floats) -> Floats:
    """Return the quality (n, k, branches) of rows (n,) at places (k, 6)."""
    step = max(1, _AT_ONCE // max(len(rows), 1))
    parts = [
        quality(np.tile(rows, len(some)), np.repeat(some, len(rows), axis=0))
        for some in (places[first : first + step] for first in range(0, len(places), step))
    ]
    table = np.concatenate(parts)
    return np.asarray(np.moveaxis(table.reshape(len(places), len(rows), -1), 1, 0))


def cost_of_places(worst: Floats) -> Floats:
    """Return what places cost whose quality for each pass is (n, k)."""
    poor = np.where(worst > REACHED, _HITS_COST - worst, 1e3)
    return np.where(worst >= LEAST, 1.0 - np.minimum(worst, GOOD) / GOOD, poor)


def bent_at(bending: Bending, branch: int, rows: Ints, places: Floats, wanted: Bools) -> Floats:
    """Return how far rows (n,) bend at places (k, 6), where wanted (n, k) and possible; inf elsewhere."""
    bent = np.full(wanted.shape, np.inf)
    row, place = np.nonzero(wanted)
    if len(row):
        found = bending(rows[row], places[place])[:, branch]
        bent[row, place] = np.where(np.isnan(found), np.inf, found)
    return bent


def cost_of_bending(bent: Floats) -> Floats:
    """Return what it costs (n, k) to bend so far at places; the least of a row costs nothing.

    Where it is not known (inf) this costs nothing either: what is out of reach costs as a place.
    """
    least = np.min(bent, axis=1, keepdims=True)
    excess = np.where(np.isfinite(bent), bent, 0.0) / np.where(np.isfinite(least), least, 1.0) - 1.0
    return np.asarray(_BENDS * np.clip(excess, 0.0, 1.0))


def cost_of_moves(leaves: Floats, enters: Floats, ranges: list[Range]) -> Floats:
    """Return what it costs (e, l) to stop, and to go to places from places."""
    ways = cost_of_ways(leaves, enters, ranges)
    return np.asarray(np.where(ways > 0.0, _STARTS + ways, 0.0))


def cost_of_ways(leaves: Floats, enters: Floats, ranges: list[Range]) -> Floats:
    """Return what the ways cost (e, l) to places from places."""
    far = np.zeros((len(enters), len(leaves)))
    for axis in ranges:
        far += axis.share * np.abs(enters[:, axis.column, None] - leaves[None, :, axis.column])
    return _MOVES * far


def cheapest_track(cost: Floats, moves: Callable[[int], Floats]) -> Ints:
    """Return the place of each row (n,) that is cheapest over all.

    ``cost`` (n, k) is that of places, ``moves(row)`` (k, k) that of coming to places from those before.
    """
    total, came_from = cost[0], np.zeros(cost.shape, dtype=np.int64)
    for row in range(1, len(cost)):
        through = total[None, :] + moves(row)
        came_from[row] = np.argmin(through, axis=1)
        total = through[np.arange(len(total)), came_from[row]] + cost[row]
    track = np.empty(len(cost), dtype=np.int64)
    track[-1] = int(np.argmin(total))
    for row in range(len(cost) - 1, 0, -1):
        track[row - 1] = came_from[row, track[row]]
    return track
