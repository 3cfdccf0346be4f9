"""The path of a part seen from above, small enough for a line of text."""

from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Floats, Ints

if TYPE_CHECKING:
    from gcode2krl.tables import Toolpath

MOST_POINTS = 200
_DIGITS = 2


def thumbnail_of(toolpath: "Toolpath") -> list[list[float]] | None:
    """Return the feed moves seen from above, mm: at most `MOST_POINTS` points of their course, None if none.

    The points are those where the polyline turns most: the farthest from the chord between its neighbours is
    added first (Douglas and Peucker 1973, with a number of points in the place of a tolerance).
    """
    ends = np.flatnonzero(~toolpath.rapid & ~toolpath.machine)
    ends = ends[ends > 0]
    rows = np.union1d(ends - 1, ends)
    points_mm = np.asarray(toolpath.position_mm)[rows, :2]
    points_mm = points_mm[np.isfinite(points_mm).all(axis=1)]
    if len(points_mm) < 2:
        return None
    return np.round(points_mm[_most_telling(points_mm, MOST_POINTS)], _DIGITS).tolist()  # type: ignore[no-any-return]  # numpy's tolist


def _most_telling(points_mm: Floats, most: int) -> Ints:
    """Return the sorted rows of the points to keep."""
    kept = {0, len(points_mm) - 1}
    waiting = [_farthest(points_mm, 0, len(points_mm) - 1)]
    while waiting and len(kept) < most:
        waiting.sort()
        distance_mm, first, row, last = waiting.pop()
        if distance_mm <= 0.0:
            break
        kept.add(row)
        waiting += [_farthest(points_mm, first, row), _farthest(points_mm, row, last)]
    return np.array(sorted(kept))


def _farthest(points_mm: Floats, first: int, last: int) -> tuple[float, int, int, int]:
    """Return distance (mm) and row of the point between two rows that is farthest from their chord."""
    between_mm = points_mm[first + 1 : last] - points_mm[first]
    if len(between_mm) == 0:
        return 0.0, first, first, last
    chord_mm = points_mm[last] - points_mm[first]
    length2 = float(chord_mm @ chord_mm)
    along = between_mm @ chord_mm / length2 if length2 > 0.0 else np.zeros(len(between_mm))
    off_mm = between_mm - np.clip(along, 0.0, 1.0)[:, None] * chord_mm
    distances_mm = np.hypot(off_mm[:, 0], off_mm[:, 1])
    row = int(distances_mm.argmax())
    return float(distances_mm[row]), first, first + 1 + row, last
