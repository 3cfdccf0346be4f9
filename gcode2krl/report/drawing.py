"""What the figures share: colours, thinning of long lines without loss of peaks, ticks, numbers in words."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from matplotlib import style

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.tables import Motion, Toolpath

# Okabe and Ito's palette, told apart with every kind of colour vision
BLACK, GREY, PALE = "#000000", "#6E6E6E", "#BDBDBD"
BLUE, SKY, ORANGE, VERMILION, GREEN = "#0072B2", "#56B4E9", "#E69F00", "#D55E00", "#009E73"

MOST_POINTS = 6000
"""No line is drawn with more points than this."""
_PIXELS = 3000
"""Half a pixel across a picture of 11 inches."""
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
    "agg.path.chunksize": 20_000,
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
    kept = _kept(values, most)
    return time_s[kept], values[kept]


def thin_path(points_mm: Floats) -> Floats:
    """Return (k, 2) points of a plane path without those that lie in the pixel of the one before.

    The line through them is less than a pixel off the path's; gaps (NaN), ends and outermost pixels stay.
    """
    present: Bools = np.isfinite(points_mm[:, 0]) & np.isfinite(points_mm[:, 1])
    if len(points_mm) <= MOST_POINTS or not present.any():
        return points_mm
    low, high = points_mm[present].min(axis=0), points_mm[present].max(axis=0)
    cell = np.full(points_mm.shape, -1, dtype=np.int64)
    cell[present] = (points_mm[present] - low) / (max(float((high - low).max()), 1e-9) / _PIXELS)
    kept = np.ones(len(points_mm), dtype=np.bool_)
    kept[1:] = (np.diff(cell, axis=0) != 0).any(axis=1)
    kept[:-1] |= kept[1:] & ~present[1:]  # the last point before a gap
    kept[-1] = True
    shown: Floats = points_mm[kept]
    return shown


def _kept(values: Floats, most: int) -> Ints:
    """Return the row numbers that stay when the rows are thinned to at most ``most``."""
    rows = len(values)
    if rows <= most:
        return np.arange(rows)
    bins = (most - 2) // 3
    width = -(-rows // bins)
    starts = np.arange(bins) * width
    kept = [np.array([0, rows - 1])]
    padded = np.empty(bins * width)
    present = np.isfinite(values)
    for fill, pick in ((np.inf, np.argmin), (-np.inf, np.argmax)):
        padded[:] = fill
        np.copyto(padded[:rows], values, where=present)
        kept.append(starts + pick(padded.reshape(bins, width), axis=1))
    padded[:] = 0.0
    padded[:rows] = ~present
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


def need_samples(motion: Motion) -> None:
    """Raise ValueError where the motion has no sample."""
    if not len(motion):
        raise ValueError("the motion has no sample: nothing to draw")


def title(what: str, toolpath: Toolpath) -> str:
    """Return a figure's title with the name of the program."""
    return f"{what}: {Path(toolpath.source).name}" if toolpath.source else what


def number(value: float) -> str:
    """Return a value in words: four digits, thousands apart."""
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def length(value_mm: float) -> str:
    """Return a length in mm in words."""
    return f"{value_mm:.4f}" if value_mm < 0.01 else f"{value_mm:.3f}"
