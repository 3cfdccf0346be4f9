"""One part, from G-code to the bytes of its files: what a worker carries out, on this machine or another."""

import hashlib
import os
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.translation import Attempt, Order, carry_out

Record = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """A part as a worker gets it; where the files go is not the worker's business."""

    order: Order
    page: str = ""
    """The name of the page to write, empty for none."""


@dataclass(frozen=True)
class Made:
    """What a worker made of a part."""

    record: Record
    """Its ``files`` are names without a folder."""
    files: dict[str, bytes]


def make(task: Task) -> Made:
    """Translate a part in a folder of its own and return its record and files."""
    with tempfile.TemporaryDirectory(prefix="gcode2krl-", ignore_cleanup_errors=True) as folder:
        place = Path(folder)
        page = place / task.page if task.page else None
        attempt = carry_out(replace(task.order, output=place, report=page))
        files = {file.name: file.read_bytes() for file in _files_of(attempt)}
        return Made(_record_of(attempt, files, place), files)


def _files_of(attempt: Attempt) -> list[Path]:
    written = list(attempt.written.files) if attempt.written is not None else []
    return [*written, attempt.page] if attempt.page is not None else written


def _record_of(attempt: Attempt, files: dict[str, bytes], place: Path) -> Record:
    """Return the record with names in the place of paths, and the path of the part seen from above."""
    record: Record = dict(attempt.record)
    record["files"] = list(files)
    record["sha256"] = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    record["options"] = {
        name: Path(value).name if name == "report" else value for name, value in record["options"].items()
    }
    record["issues"] = [
        issue | {"message": issue["message"].replace(f"{place}{os.sep}", "")} for issue in record["issues"]
    ]
    record["thumbnail"] = thumbnail_of(attempt.toolpath) if attempt.toolpath is not None else None
    return record


# the path seen from above -----------------------------------------------------------------------------------


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
