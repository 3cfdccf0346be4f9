"""A program's path as it is judged: points on its long moves, rows that stand for all, the cheapest choices.

What is judged at targets is judged on the long ways between them as well.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints

STEP_MM = 50.0
"""Way between points that are judged."""
_MOST_POINTS = 2000
"""With more on all long moves together the step grows."""
_NO_DIRECTION = 1e-6


@dataclass(frozen=True)
class Between:
    """Targets (p) and the points between them, (d) in all."""

    before: Ints
    """(d,) the target that a point is at, or behind."""
    share: Floats
    """(d,) of the way to the next one, 0 at targets."""

    def of(self, values: Floats) -> Floats:
        """Return values (d, k) of the points, those (p, k) of the targets in proportion to the way."""
        if values.strides[0] == 0:
            return np.broadcast_to(values[0], (len(self.before), *values.shape[1:]))
        if len(self.before) == len(values):
            return values
        first, share = values[self.before], self.share[:, None]
        after: Floats = values[np.minimum(self.before + 1, len(values) - 1)]
        return np.asarray(np.where(share > 0.0, first + share * (after - first), first))

    def directions(self, values: Floats) -> Floats:
        """Return unit vectors (d, k) of the points, those (p, k) of the targets as `of`.

        Where two targets have opposite ones, nothing is between: the first one counts.
        """
        vectors = self.of(values)
        if vectors.strides[0] == 0 or len(vectors) == len(values):
            return vectors
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        has_none = length < _NO_DIRECTION
        return np.asarray(np.where(has_none, values[self.before], vectors / np.where(has_none, 1.0, length)))

    def rotations(self, values: Floats) -> Floats:
        """Return the quaternions (d, 4) of the points, those (p, 4) of the targets as `of`."""
        if values.strides[0] != 0:
            turns_over = np.einsum("ij,ij->i", values[1:], values[:-1]) < 0.0
            values = values * np.where(np.cumsum(np.append(False, turns_over)) % 2, -1.0, 1.0)[:, None]
        return self.directions(values)


def between(position_mm: Floats, joined: Bools, seen_mm: Floats | None = None) -> Between:
    """Return the points of moves that are longer than `STEP_MM`, in ``$BASE`` or as the robot sees them.

    ``position_mm`` (p, 3) of targets in ``$BASE``, ``joined`` (p,) where a straight move leads to one from
    that before it, ``seen_mm`` (p, 3) the positions as seen with the external axes at rest.
    """
    way = _steps_mm(position_mm)
    if seen_mm is not None:
        way = np.maximum(way, _steps_mm(seen_mm))
    way = np.where(joined[1:] & (way > STEP_MM), way, 0.0)
    step = max(STEP_MM, float(way.sum()) / _MOST_POINTS)
    count = np.append(np.maximum(np.ceil(way / step - 1e-9), 1.0).astype(np.int64), 1)[: len(position_mm)]
    before = np.repeat(np.arange(len(position_mm)), count)
    number = np.arange(len(before)) - np.repeat(np.cumsum(count) - count, count)
    return Between(before, number / count[before])


def _steps_mm(position_mm: Floats) -> Floats:
    """Return the lengths (p - 1,) of the ways between positions (p, 3)."""
    return np.asarray(np.linalg.norm(np.diff(position_mm, axis=0), axis=1))


def way_mm(position_mm: Floats) -> Floats:
    """Return the way (p,) from the first position to each (p, 3)."""
    return np.concatenate([[0.0], np.cumsum(_steps_mm(position_mm))])


def is_one(values: Floats) -> bool:
    """Tell whether all rows (n, k) are alike."""
    return values.strides[0] == 0 or bool((values == values[0]).all())


def spread(rows: Ints, position_mm: Floats, most: int) -> Ints:
    """Return at most so many rows spread over a run, its outermost points among them where there is room."""
    if len(rows) <= most:
        return rows
    outermost = extremes(position_mm[rows])
    evenly = np.linspace(0, len(rows) - 1, max(most - len(outermost), 2)).astype(np.int64)
    chosen = np.unique(np.concatenate([evenly, outermost]))
    picked = np.linspace(0, len(chosen) - 1, min(most, len(chosen))).astype(np.int64)
    return np.asarray(rows[chosen[picked]])


def extremes(vectors: Floats) -> list[int]:
    """Return the rows of vectors (n, 3) with the smallest and largest of each component."""
    return [int(extreme(vectors[:, k])) for k in range(3) for extreme in (np.argmin, np.argmax)]


def cheapest_track(cost: Floats, arrive: Callable[[int, Floats], Floats]) -> tuple[float, Ints]:
    """Return the cost and the choice of each row (n,) that are cheapest over all, by dynamic programming.

    ``cost`` (n, k) is that of choices, ``arrive(row, total)`` (k, k) that of coming to choices from those
    before, which have cost ``total`` (k,) so far.
    """
    total, came_from = cost[0], np.zeros(cost.shape, dtype=np.int64)
    for row in range(1, len(cost)):
        through = arrive(row, total)
        came_from[row] = np.argmin(through, axis=1)
        total = through[np.arange(len(total)), came_from[row]] + cost[row]
    track = np.empty(len(cost), dtype=np.int64)
    track[-1] = int(np.argmin(total))
    for row in range(len(cost) - 1, 0, -1):
        track[row - 1] = came_from[row, track[row]]
    return float(total.min()), track
