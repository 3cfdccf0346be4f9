"""The path of a motion as it grows: its corners and nodes, as far as they are certain.

Between two corners a path is straight. Whether a point is one, or a sample a node, depends on the points
behind it. What is not certain yet waits for them, so that how many are given at a time changes nothing.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cutting.reading import mark_corners, mark_nodes
from gcode2krl.cutting.records import copied, followed, taken
from gcode2krl.cutting.sweep import Path, Samples
from gcode2krl.tables import lengths

_FEW_CORNERS = 200_000
"""Corners of a path, 46 bytes each, up to which all are kept."""


class Points(NamedTuple):
    """The path of the tip (k), in the order of time: samples, and points that only shape it."""

    position_mm: Floats
    """(k, 3) tips in the frame of the field, whose z is the tool axis."""
    direction: Floats
    """(k, 3) unit tangents; zero where the tool stands."""
    tool: Ints32
    """(k,) row of the tools; no sweep joins two points of different tools."""
    rapid: Bools
    """(k,) True where the sweep that leads to the point must not meet material."""
    f_z_mm: Floats
    """(k,) feed per tooth along the path."""
    wanted: Bools
    """(k,) True at samples."""


class _Waiting(NamedTuple):
    """Points (k) from the last corner or the last node on, whichever is the earlier."""

    points: Points
    way_mm: Floats
    first: Bools
    """(k,) True where no sweep leads to the point."""
    point: Ints
    """(k,) the last corner that is not after the point; not known behind the last certain corner."""

    def extended(self, points: Points) -> "_Waiting":
        """Return these and the points that follow."""
        old = self.points
        position = np.ascontiguousarray(points.position_mm, dtype=np.float64)
        before = old.position_mm[-1:] if len(old.tool) else position[:1]
        steps_mm = lengths(np.diff(position, axis=0, prepend=before))
        last_mm = self.way_mm[-1:] if len(old.tool) else np.zeros(1)
        tools = np.concatenate([old.tool[-1:] if len(old.tool) else [-1], points.tool])
        return _Waiting(
            followed(old, points._replace(position_mm=position)),
            np.concatenate([self.way_mm, np.cumsum(np.concatenate([last_mm, steps_mm]))[1:]]),
            np.concatenate([self.first, tools[1:] != tools[:-1]]),
            np.concatenate([self.point, np.zeros(len(position), dtype=np.int64)]),
        )

    def since(self, row: int) -> "_Waiting":
        """Return those from a row on."""
        points = copied(self.points, slice(row, None))
        return _Waiting(points, self.way_mm[row:].copy(), self.first[row:].copy(), self.point[row:].copy())


class Way:
    """A path: its corners so far, and the points that wait."""

    def __init__(self, longest_mm: Floats, is_short: Bools) -> None:
        """Take the longest sweep of each tool (t,), and whether its sweeps along a slope have to be short."""
        self._longest_mm, self._is_short = longest_mm, is_short
        nothing = np.zeros(0, dtype=np.bool_)
        points = Points(
            np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.int32), nothing, np.zeros(0), nothing
        )
        self._waiting = _Waiting(points, np.zeros(0), nothing, np.zeros(0, dtype=np.int64))
        self._corners = _Corners()
        self._corner, self._node = 0, -1
        """Rows of `_waiting`: the last certain corner, and the last node at which samples were divided."""
        self._known = 0
        """Rows of which it is certain whether they are corners."""
        self._settled_mm = -np.inf
        self._sample = 0
        """Number of the first sample that waits, in the whole motion."""

    def extend(self, points: Points, ends: bool) -> None:
        """Add points; the motion ``ends`` with them."""
        self._waiting = waiting = self._waiting.extended(points)
        here = slice(self._corner, None)
        columns = (waiting.points.position_mm[here], waiting.way_mm[here], waiting.first[here])
        corner = np.empty(len(columns[1]), dtype=np.bool_)
        rapid, tool = waiting.points.rapid[here], waiting.points.tool[here]
        mark_corners(*columns, rapid, tool, self._longest_mm, self._is_short, corner)
        if not ends:
            corner = corner[:-1]  # it depends on the next point
        goes_on = int(len(self._corners) > 0)
        known = self._corner + np.arange(len(corner))
        if not len(known):
            return
        waiting.point[known] = len(self._corners) - 1 + np.cumsum(corner) - goes_on
        rows = known[corner][goes_on:]
        samples_before: Ints = np.cumsum(waiting.points.wanted) - waiting.points.wanted
        self._corners.extend(waiting, rows, self._sample + samples_before[rows])
        self._corner = int(known[corner][-1])
        self._known = int(known[-1]) + 1

    def samples(self, apart_mm: Floats, new_mm: Floats, ends: bool) -> tuple[Samples, int]:
        """Return the samples up to the last node at which they can be divided, and how many were returned
        before: none or one."""
        waiting, begins = self._waiting, int(self._node >= 0)
        start = max(self._node, 0)
        rows = start + np.flatnonzero(waiting.points.wanted[start : self._known])
        points = waiting.points
        samples = Samples(
            points.position_mm[rows],
            np.ascontiguousarray(points.direction[rows], dtype=np.float64),
            waiting.way_mm[rows],
            np.ascontiguousarray(points.f_z_mm[rows], dtype=np.float64),
            points.tool[rows],
            waiting.point[rows],
            np.empty(len(rows), dtype=np.bool_),
        )
        settled_mm = np.full(len(rows), self._settled_mm)
        if len(rows):
            mark_nodes(samples, points.rapid[rows], apart_mm, new_mm, ends, samples.node, settled_mm)
        last = len(rows) - 1
        if not ends:
            # where a tooth advances, so that peaks between two nodes need no third
            able = np.flatnonzero(~np.isnan(settled_mm) & (samples.f_z_mm > 0.0) & ~points.rapid[rows])
            last = int(able[-1]) if len(able) else 0
        if not len(rows) or last < begins:
            return taken(samples, slice(0, 0)), 0
        self._settled_mm, self._node = float(settled_mm[last]), int(rows[last])
        return taken(samples, slice(0, last + 1)), begins

    def path(self, outlines: Floats) -> Path:
        """Return the corners that are certain."""
        return self._corners.path(outlines)

    def owner(self, corner: Ints) -> Ints:
        """Return the samples, in the whole motion, to which the sweeps to corners lead."""
        return self._corners.owner(corner)

    def forget(self) -> None:
        """Forget the points behind which corner and node are certain."""
        row = min(self._corner, self._node)
        wanted = self._waiting.points.wanted[:row]
        self._sample += int(np.count_nonzero(wanted))
        self._waiting = self._waiting.since(row)
        self._corner, self._node = self._corner - row, self._node - row
        self._known -= row

    @property
    def is_long(self) -> bool:
        """True where it is time to drop the corners that nothing refers to."""
        return len(self._corners) > self._corners.limit

    def renumber(self, kept: Bools) -> Ints32:
        """Drop corners; return the new numbers (p,) of those that are kept: the last ones have to be."""
        number = np.cumsum(kept, dtype=np.int32) - np.int32(1)
        self._corners.keep(kept)
        known = self._waiting.point[: self._known]
        known[:] = number[known]
        return number


class _Corners:
    """The corners of a path, in arrays with room for more."""

    def __init__(self) -> None:
        self.limit = _FEW_CORNERS
        self._count = 0
        self._columns: dict[str, NDArray[Any]] = {
            "position_mm": np.empty((0, 3)),
            "way_mm": np.empty(0),
            "tool": np.empty(0, dtype=np.int32),
            "rapid": np.empty(0, dtype=np.bool_),
            "first": np.empty(0, dtype=np.bool_),
            "sample": np.empty(0, dtype=np.int64),
        }

    def __len__(self) -> int:
        return self._count

    def extend(self, waiting: _Waiting, rows: Ints, sample: Ints) -> None:
        """Add corners from rows of the points, which lead to samples of the motion."""
        points, count = waiting.points, self._count + len(rows)
        added: dict[str, NDArray[Any]] = {
            "position_mm": points.position_mm[rows],
            "way_mm": waiting.way_mm[rows],
            "tool": points.tool[rows],
            "rapid": points.rapid[rows],
            "first": waiting.first[rows],
            "sample": sample,
        }
        for name, new in added.items():
            column = self._columns[name]
            if count > len(column):
                larger = np.empty((max(count, len(column) * 5 // 4), *column.shape[1:]), column.dtype)
                larger[: self._count] = column[: self._count]
                self._columns[name] = column = larger
            column[self._count : count] = new
        self._count = count

    def keep(self, kept: Bools) -> None:
        for name, column in self._columns.items():
            self._columns[name] = column[: self._count][kept]
        self._count = int(np.count_nonzero(kept))
        self.limit = max(_FEW_CORNERS, 2 * self._count)

    def path(self, outlines: Floats) -> Path:
        rows = {name: column[: self._count] for name, column in self._columns.items()}
        del rows["sample"]
        return Path(**rows, outlines=outlines)

    def owner(self, corner: Ints) -> Ints:
        return np.asarray(self._columns["sample"][corner])
