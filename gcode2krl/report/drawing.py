"""What the figures share: colours, thinning of long lines without loss of peaks, ticks, the worst corner."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from matplotlib import style

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.tables import Motion, Targets, Toolpath

# Okabe and Ito's palette, told apart with every kind of colour vision
BLACK, GREY, PALE = "#000000", "#6E6E6E", "#BDBDBD"
BLUE, SKY, ORANGE, VERMILION, GREEN = "#0072B2", "#56B4E9", "#E69F00", "#D55E00", "#009E73"

MOST_POINTS = 6000
"""No line is drawn with more points than this."""
MOST_BARS = 1500
"""No figure is shaded with more intervals than this: about one for each pixel column."""

_LOOK = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "figure.titlesize": 11.0,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.linewidth": 0.8,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-3, 5),
    "axes.formatter.use_mathtext": True,
    "lines.solid_joinstyle": "round",
}


@contextmanager
def look() -> Iterator[None]:
    """Draw in the project's style whatever the user's matplotlibrc says: the same data, the same bytes."""
    with style.context(["default", _LOOK]):
        yield


def thin(time_s: Floats, values: Floats, most: int = MOST_POINTS) -> tuple[Floats, Floats]:
    """Return time and values with at most ``most`` points that look the same drawn.

    In each stretch the lowest, the highest and the first missing sample are kept, so that neither a peak
    nor a gap is lost.

    Parameters
    ----------
    time_s : (m,) array
        Any non-decreasing abscissa.
    values : (m,) array
        Values that are not finite are gaps and returned as NaN.
    most : int
        The largest number of points, at least 8.
    """
    values = np.where(np.isfinite(values), values, np.nan)
    kept = _kept([values], len(values), most)
    return time_s[kept], values[kept]


def thin_path(points_mm: Floats, most: int = MOST_POINTS) -> Floats:
    """Return (k, 2) points of a plane path, at most ``most``, that keep its outermost ones and its gaps."""
    return points_mm[_kept([points_mm[:, 0], points_mm[:, 1]], len(points_mm), most)]


def thin_dots(points_mm: Floats, most: int = MOST_POINTS) -> Floats:
    """Return (k, 2) of the points, at most ``most``, one for each pixel."""
    if len(points_mm) <= most:
        return points_mm
    low = points_mm.min(axis=0)
    pixel = max(float(np.ptp(points_mm, axis=0).max()), 1e-9) / 1000.0
    cells = np.floor((points_mm - low) / pixel).astype(np.int64)
    _, first = np.unique(cells[:, 0] * 2000 + cells[:, 1], return_index=True)
    dots = points_mm[np.sort(first)]
    return dots[:: -(-len(dots) // most)]


def _kept(columns: list[Floats], rows: int, most: int) -> Ints:
    """Return the row numbers that stay when ``rows`` rows are thinned to at most ``most``."""
    if rows <= most:
        return np.arange(rows)
    bins = (most - 2) // (2 * len(columns) + 1)
    width = -(-rows // bins)
    starts = np.arange(bins) * width
    kept = [np.array([0, rows - 1])]
    padded = np.empty(bins * width)
    for column in columns:
        present = np.isfinite(column)
        for fill, pick in ((np.inf, np.argmin), (-np.inf, np.argmax)):
            padded[:] = fill
            np.copyto(padded[:rows], column, where=present)
            kept.append(starts + pick(padded.reshape(bins, width), axis=1))
    padded[:] = 0.0
    padded[:rows] = ~np.isfinite(columns[0])
    missing = padded.reshape(bins, width)
    kept.append((starts + missing.argmax(axis=1))[missing.any(axis=1)])
    return np.unique(np.minimum(np.concatenate(kept), rows - 1))


def intervals(time_s: Floats, mask: Bools, most: int = MOST_BARS) -> tuple[list[tuple[float, float]], float]:
    """Return (start, width) of the stretches where ``mask`` holds, and the gap below which two were joined.

    A stretch reaches half a sample beyond its samples. Stretches are joined only where there are more than
    ``most``; the gap is 0 where none were.
    """
    if not mask.any():
        return [], 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    middle = np.concatenate([time_s[:1], (time_s[1:] + time_s[:-1]) / 2.0, time_s[-1:]])
    start, end = middle[edges[::2]], middle[edges[1::2]]
    gap = 0.0
    if len(start) > most:
        gap = float(time_s[-1] - time_s[0]) / most
        gaps = np.flatnonzero(start[1:] - end[:-1] > gap)
        start, end = start[np.append(0, gaps + 1)], end[np.append(gaps, len(end) - 1)]
    return list(zip(start.tolist(), (end - start).tolist(), strict=True)), gap


def line_ticks(time_s: Floats, line: Ints32, most: int = 14) -> tuple[list[float], list[str]]:
    """Return times at which a G-code line begins and their labels, in order and at most ``most`` + 1.

    Of the lines that begin too close together to label each, the one that lasts longest is labelled. Line 0,
    motion without a G-code line, has no label.
    """
    begins = np.flatnonzero(np.diff(line, prepend=line[0] - 1))
    lasts = np.diff(time_s[begins], append=time_s[-1])
    begins, lasts = begins[line[begins] > 0], lasts[line[begins] > 0]
    room = max(float(time_s[-1] - time_s[0]) / most, 1e-9)
    slot = ((time_s[begins] - time_s[0]) / room).astype(np.int64)
    order = np.lexsort((-lasts, slot))
    _, first = np.unique(slot[order], return_index=True)
    times: list[float] = []
    labels: list[str] = []
    for row in begins[order[first]]:
        if not times or time_s[row] - times[-1] > 0.75 * room:
            times.append(float(time_s[row]))
            labels.append(str(line[row]))
    return times, labels


def lines_of(toolpath: Toolpath, motion: Motion) -> Ints32:
    """Return (m,) the G-code line of each sample, 0 where it has none."""
    row = np.clip(motion.move, 0, len(toolpath) - 1)
    return np.where(motion.move >= 0, toolpath.source_line[row], 0).astype(np.int32)


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
    found, first = np.unique(vertex[order], return_index=True)
    nearest[found] = sample[order[first]]
    of = np.full(len(motion) + 2, -1)  # one spare at each end
    inside = distance <= 1.001 * reach[vertex] + 1e-9
    of[sample[inside] + 1] = vertex[inside]
    at = nearest[found] + 1
    resolved[found] = (of[at] == found) & (of[at - 1] == found) & (of[at + 1] == found)
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
