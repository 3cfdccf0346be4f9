"""Points of long moves, so that what is judged at targets is judged on the way between them as well."""

from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints, Ints32

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
        found = self.of(values)
        if found.strides[0] == 0 or len(found) == len(values):
            return found
        length = np.linalg.norm(found, axis=1, keepdims=True)
        has_none = length < _NO_DIRECTION
        return np.asarray(np.where(has_none, values[self.before], found / np.where(has_none, 1.0, length)))

    def rotations(self, values: Floats) -> Floats:
        """Return the quaternions (d, 4) of the points, those (p, 4) of the targets as `of`."""
        if values.strides[0] != 0:
            turns_over = np.einsum("ij,ij->i", values[1:], values[:-1]) < 0.0
            values = values * np.where(np.cumsum(np.append(False, turns_over)) % 2, -1.0, 1.0)[:, None]
        return self.directions(values)


def straight(ptp: Bools, home: Bools, tool: Ints32) -> Bools:
    """Mark the targets (p,) to which a straight line leads from the one before, with the same tool."""
    lines = np.zeros(len(ptp), dtype=np.bool_)
    lines[1:] = ~ptp[1:] & ~home[:-1] & (tool[1:] == tool[:-1])
    return lines


def between(position_mm: Floats, joined: Bools, seen_mm: Floats | None = None) -> Between:
    """Return the points of moves that are longer than `STEP_MM`, in ``$BASE`` or as the robot sees them.

    ``position_mm`` (p, 3) of targets in ``$BASE``, ``joined`` (p,) where a straight move leads to one from
    that before it, ``seen_mm`` (p, 3) the positions as seen with the external axes at rest.
    """
    way = _way_mm(position_mm)
    if seen_mm is not None:
        way = np.maximum(way, _way_mm(seen_mm))
    way = np.where(joined[1:] & (way > STEP_MM), way, 0.0)
    step = max(STEP_MM, float(way.sum()) / _MOST_POINTS)
    count = np.append(np.maximum(np.ceil(way / step - 1e-9), 1.0).astype(np.int64), 1)[: len(position_mm)]
    before = np.repeat(np.arange(len(position_mm)), count)
    number = np.arange(len(before)) - np.repeat(np.cumsum(count) - count, count)
    return Between(before, number / count[before])


def _way_mm(position_mm: Floats) -> Floats:
    """Return the lengths (p - 1,) of the ways between positions (p, 3)."""
    return np.asarray(np.linalg.norm(np.diff(position_mm, axis=0), axis=1))
