"""The corner where the path misses its programmed vertex most, and the curve between samples."""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.tables import Motion, Targets


class Corner(NamedTuple):
    """An approximated corner and how far the path stays from its programmed vertex."""

    target: int
    """Row of Targets that ends in the vertex."""
    line: int
    distance_mm: float
    reach_mm: float
    """How far from the vertex the path leaves the line: min(CDIS, L1/2, L2/2)."""
    sampled: bool
    """True where the distance is that of the samples, False where they are too far apart to tell and it is
    that of the parabola."""
    nearest_mm: Floats
    """(3,) the point of the path nearest to the vertex."""
    along: Floats
    """(3,) unit vector of the incoming line."""
    across: Floats
    """(3,) unit vector in the corner's plane, at right angles to it, on the outgoing side."""


def worst_corner(targets: Targets, motion: Motion) -> Corner | None:
    """Return the corner whose vertex the path misses most, or None where no corner is approximated.

    With three samples or more in a corner the path between them is the parabola through them, which is
    what the controller drives (Bigliardi et al. 2022, eq. 4); with fewer it is the parabola that leaves the
    lines at d = min(CDIS, L1/2, L2/2), with the error d·cos(alpha/2)/2 (their eq. 3).
    """
    if len(targets) < 3 or not len(motion):
        return None
    position = targets.position_mm
    step = np.diff(position, axis=0)
    length = np.linalg.norm(step, axis=1)
    unit = step / np.maximum(length, 1e-12)[:, None]
    cosine = np.einsum("ij,ij->i", unit[:-1], unit[1:])
    reach = np.zeros(len(targets))
    reach[1:-1] = np.minimum(targets.cdis_mm[1:-1], np.minimum(length[:-1], length[1:]) / 2.0)
    lin = ~(targets.ptp | targets.home)
    reach[1:-1][~(lin[1:-1] & lin[2:]) | (cosine < -1.0 + 1e-9)] = 0.0  # a reversal is an exact stop
    error = np.zeros(len(targets))
    error[1:-1] = reach[1:-1] * np.sqrt(np.clip(1.0 - cosine, 0.0, 2.0) / 2.0) / 2.0

    row_of = np.full(int(max(targets.move.max(), motion.move.max())) + 1, -1)
    planned = np.flatnonzero(targets.move >= 0)
    row_of[targets.move[planned]] = planned
    rows = row_of[motion.move[motion.move >= 0]]
    if not (rows >= 0).any():
        return None
    error[: rows[rows >= 0].min()] = 0.0
    error[rows.max() :] = 0.0

    nearest, resolved = _nearest_samples(targets, motion, row_of, reach)
    row = int(np.argmax(np.where(resolved, 0.0, error)))
    point = position[row] + reach[row] * (unit[row] - unit[row - 1]) / 4.0
    distance = 0.0 if resolved[row] else float(error[row])
    measured = np.flatnonzero(resolved & (error > 0.0))
    bound = np.linalg.norm(motion.position_mm[nearest[measured]] - position[measured], axis=1)
    order = np.argsort(-bound, kind="stable")
    for some in np.array_split(order, max(len(order) // 5000, 1)):
        if not len(some) or bound[some[0]] <= distance:
            break
        points = _between_samples(motion.position_mm, nearest[measured[some]], position[measured[some]])
        missed = np.linalg.norm(points - position[measured[some]], axis=1)
        if missed.max() > distance:
            row, point, distance = measured[some[missed.argmax()]], points[missed.argmax()], missed.max()
    if distance <= 1e-9:
        return None
    across = unit[row] - cosine[row - 1] * unit[row - 1]
    across /= np.linalg.norm(across)
    line, sampled = int(targets.source_line[row]), bool(resolved[row])
    return Corner(int(row), line, float(distance), float(reach[row]), sampled, point, unit[row - 1], across)


def _nearest_samples(targets: Targets, motion: Motion, row_of: Ints, reach: Floats) -> tuple[Ints, Bools]:
    """Return (p,) the corner sample nearest to each vertex, and whether it and both its neighbours are in
    that corner."""
    nearest = np.zeros(len(targets), dtype=np.int64)
    resolved = np.zeros(len(targets), dtype=np.bool_)
    sample = np.flatnonzero(motion.corner & (motion.move >= 0))
    sample = sample[row_of[motion.move[sample]] > 0]
    if not len(sample):
        return nearest, resolved
    end = row_of[motion.move[sample]]
    point = motion.position_mm[sample]
    to_end = np.linalg.norm(point - targets.position_mm[end], axis=1)
    to_start = np.linalg.norm(point - targets.position_mm[end - 1], axis=1)
    vertex = np.where(to_end <= to_start, end, end - 1)
    distance = np.minimum(to_end, to_start)
    order = np.lexsort((distance, vertex))
    corners, first = np.unique(vertex[order], return_index=True)
    nearest[corners] = sample[order[first]]
    of = np.full(len(motion) + 2, -1)  # one spare at each end
    inside = distance <= 1.001 * reach[vertex] + 1e-9
    of[sample[inside] + 1] = vertex[inside]
    at = nearest[corners] + 1
    resolved[corners] = (of[at] == corners) & (of[at - 1] == corners) & (of[at + 1] == corners)
    return nearest, resolved


def _between_samples(path_mm: Floats, nearest: Ints, vertex: Floats) -> Floats:
    """Return (k, 3) the points nearest to the vertices on the parabolas through three samples each."""
    before, middle, after = (path_mm[nearest + step] for step in (-1, 0, 1))
    s = np.linspace(-1.0, 1.0, 201)[:, None, None]
    points = middle + s * (after - before) / 2.0 + s**2 * (after - 2.0 * middle + before) / 2.0
    pick = np.linalg.norm(points - vertex, axis=2).argmin(axis=0)
    nearest_points: Floats = points[pick, np.arange(len(pick))]
    return nearest_points


def smooth(samples: Floats) -> Floats:
    """Return samples at equal times with the curve between them, exact where that is a parabola.

    Between two samples it is the blend of the parabolas through three on either side (Catmull and Rom).
    """
    if not 3 <= len(samples) <= 500:
        return samples
    padded = np.concatenate([2 * samples[:1] - samples[1:2], samples, 2 * samples[-1:] - samples[-2:-1]])
    a, b, c, d = (padded[first : len(padded) - 3 + first, None] for first in range(4))
    s = np.linspace(0.0, 1.0, 11)[:-1, None]
    curve = (
        b
        + s * (c - a) / 2.0
        + s**2 * (a - 2.5 * b + 2.0 * c - d / 2.0)
        + s**3 * (1.5 * (b - c) + (d - a) / 2.0)
    )
    return np.concatenate([curve.reshape(-1, samples.shape[1]), samples[-1:]])
