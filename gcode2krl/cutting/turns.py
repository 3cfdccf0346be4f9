"""The path between two samples where it turns: points that shape the sweep, so that it is not cut short.

A chord across a corner leaves material standing that the tool has cut, and takes some that it has not, the
more the farther samples lie apart. The path turns between two samples as the controller blends: along the
tangent of the first, a parabola about the vertex of both tangents, along the tangent of the second.
"""

import math
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints

LEAST_TURN_RAD = math.radians(3.0)
"""Turn between two samples below which the chord serves: 25 mm/s at 12 ms leave it by 4 µm."""
_PER_POINT_RAD = math.radians(10.0)
"""Turn of a parabola from point to point."""
_BACK = -0.999
"""Cosine of a turn that leads back along the same line, whose vertex is where it ends."""
_NO_LENGTH_MM = 1e-6


class Shaped(NamedTuple):
    """A path (k) of samples and the points between them."""

    position_mm: Floats
    """(k, 3)"""
    sample: Ints
    """(k,) the sample that the sweep which ends here leads to."""
    read: Bools
    """(k,) True at samples."""

    def gathered(self, values: Floats) -> Floats:
        """Return the largest value (m, ...) on the way to each sample."""
        return np.maximum.reduceat(values, np.flatnonzero(np.append(True, self.read[:-1])), axis=0)


def shaped(position_mm: Floats, direction: Floats, path_mm: Floats, joined: Bools) -> Shaped:
    """Return the path of samples (m) with points where it turns between two of them.

    Parameters
    ----------
    direction : (m, 3) unit tangents; zero where there is none.
    path_mm : (m,) arc length, which tells how far before the vertex the blend begins.
    joined : (m,) True where a sweep leads from the sample before.
    """
    count = len(position_mm)
    cosine = (direction[1:] * direction[:-1]).sum(axis=1)
    moves = np.abs(direction).max(axis=1, initial=0.0) > 0.0
    turns = (cosine < math.cos(LEAST_TURN_RAD)) & moves[1:] & moves[:-1] & joined[1:]
    after = np.flatnonzero(turns) + 1
    way_mm = np.diff(path_mm)[after - 1]
    between, owner = _between(position_mm, direction, after, way_mm, cosine[after - 1])
    sample = np.concatenate([np.arange(count), owner])
    order = np.lexsort((np.arange(len(sample)) < count, sample))  # a sample comes after the points before it
    every = np.concatenate([position_mm, between])[order]
    return Shaped(every, sample[order], order < count)


def _between(
    position_mm: Floats, direction: Floats, after: Ints, way_mm: Floats, cosine: Floats
) -> tuple[Floats, Ints]:
    """Return the points before the samples ``after`` and the samples that they belong to."""
    start, end, u, w = position_mm[after - 1], position_mm[after], direction[after - 1], direction[after]
    to_vertex, from_vertex = _legs(end - start, u, w, way_mm, cosine)
    meets = (
        (to_vertex >= 0.0) & (from_vertex >= 0.0) & (to_vertex + from_vertex < 2.0 * way_mm + _NO_LENGTH_MM)
    )
    after, start, u, w = after[meets], start[meets], u[meets], w[meets]
    to_vertex, from_vertex, way_mm, cosine = (
        each[meets] for each in (to_vertex, from_vertex, way_mm, cosine)
    )
    vertex = start + to_vertex[:, None] * u
    saved = 2.0 - _parabola_length(cosine)
    blend = np.clip((to_vertex + from_vertex - way_mm) / np.maximum(saved, 1e-9), 0.0, None)
    blend = np.where(cosine < _BACK, 0.0, np.minimum(blend, np.minimum(to_vertex, from_vertex)))
    turn = np.arccos(np.clip(cosine, -1.0, 1.0))
    pieces = np.where(blend > _NO_LENGTH_MM, np.ceil(turn / _PER_POINT_RAD), 0.0).astype(np.int64)
    row = np.repeat(np.arange(len(after)), pieces + 1)
    number = np.arange(len(row)) - np.repeat(np.cumsum(pieces + 1) - pieces - 1, pieces + 1)
    tau = (number / np.maximum(pieces[row], 1))[:, None]
    points = vertex[row] + blend[row, None] * (tau**2 * w[row] - (1.0 - tau) ** 2 * u[row])
    return points, after[row]


def _legs(step: Floats, u: Floats, w: Floats, way_mm: Floats, cosine: Floats) -> tuple[Floats, Floats]:
    """Return the distances from the first sample along u, and along w to the second, of the vertex."""
    along, onward = (step * u).sum(axis=1), (step * w).sum(axis=1)
    sine2 = np.maximum(1.0 - cosine**2, 1e-12)
    to_vertex, from_vertex = (along - cosine * onward) / sine2, (onward - cosine * along) / sine2
    back = cosine < _BACK
    out = 0.5 * (way_mm + along)
    return np.where(back, out, to_vertex), np.where(back, way_mm - out, from_vertex)


def _parabola_length(cosine: Floats) -> Floats:
    """Return the length of a parabola from tangent to tangent, in units of its distance to the vertex.

    The closed form of ``|(1 - t)·u + t·w|`` integrated from 0 to 1, twice.
    """
    half = np.sqrt(np.clip(0.5 * (1.0 - cosine), 1e-12, 1.0))  # sine of half the turn
    low = np.sqrt(np.clip(1.0 - half**2, 1e-12, 1.0))
    return 1.0 + low**2 / half * np.arctanh(np.minimum(half, 1.0 - 1e-12))
