"""Stretches of samples at which something is wrong, found in samples that come some at a time."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cutting.records import followed, taken
from gcode2krl.errors import MOST_PLACES

if TYPE_CHECKING:
    from gcode2krl.cutting.findings import Cut

CONTACT_MM = 0.01
"""Thinner material that rapid, shank or holder meet is rounding of path and cells."""
_GRAZE_MM = 3.0
"""Longest way, a little more than that of a sample at 0.2 m/s, on which a rapid may meet material that a
rounded corner has left."""
_THIN_MM = 0.3
"""Thicker material is never ignored as the rest of a rounded corner."""


class Stretch(NamedTuple):
    """Where a stretch begins, with which tool, and its largest value (0 where it has none)."""

    line: int
    tool: int
    worst: float


class Stretches:
    """The first `MOST_PLACES` stretches at which something is wrong."""

    def __init__(self) -> None:
        """Begin in front of the first sample."""
        self.found: list[Stretch] = []
        self._goes_on = False
        self._is_listed = False

    def take(self, wrong: Bools, line: Ints32, tool: Ints32, values: Floats | None = None) -> None:
        """Judge the next samples (m, at least one) from whether they are wrong, line, tool and value."""
        if self._goes_on and self._is_listed and wrong[0] and values is not None:
            worst = float(values[: _end(wrong, 0)].max())
            self.found[-1] = self.found[-1]._replace(worst=max(self.found[-1].worst, worst))
        begins = np.flatnonzero(wrong & ~np.concatenate([[self._goes_on], wrong[:-1]]))
        room = MOST_PLACES - len(self.found)
        for row in begins[:room].tolist():
            worst = float(values[row : _end(wrong, row)].max()) if values is not None else 0.0
            self.found.append(Stretch(int(line[row]), int(tool[row]), worst))
        if len(begins):
            self._is_listed = len(begins) <= room
        self._goes_on = bool(wrong[-1])


def _end(wrong: Bools, start: int) -> int:
    """Return the row after a stretch."""
    length = int(np.argmin(wrong[start:]))  # stops at the first False
    return start + length if not wrong[start + length] else len(wrong)


class _Rows(NamedTuple):
    """Samples of rapids."""

    row: Ints
    line: Ints32
    tool: Ints32
    step_mm: Floats
    descent_mm: Floats
    depth_mm: Floats


class RapidContacts:
    """Rapids through material. What one has cut off is known only some samples later."""

    def __init__(self, blend_mm: float) -> None:
        """Take the largest CDIS, see `findings.Findings`."""
        self._blend_mm = blend_mm
        self._count = 0
        none, zero = np.zeros(0, dtype=np.int32), np.zeros(0)
        self._rows = _Rows(np.zeros(0, dtype=np.int64), none, none, zero, zero, zero)

    def take(self, cut: "Cut", tool: Ints32) -> None:
        """Add the next samples."""
        rows = np.flatnonzero(cut.rapid)
        columns = (cut.source_line[rows], tool[rows], cut.step_mm[rows], cut.descent_mm[rows])
        added = _Rows(self._count + rows, *columns, np.zeros(len(rows)))
        self._rows = followed(self._rows, added)
        self._count += len(tool)

    def met(self, row: Ints, depth_mm: Floats, settled: int) -> None:
        """Note how deep (r,) rapids were at samples (r,); nothing more comes of those before ``settled``."""
        known = self._rows
        np.maximum.at(known.depth_mm, np.searchsorted(known.row, row), depth_mm)
        kept = (known.row >= settled) | (known.depth_mm > CONTACT_MM)
        self._rows = taken(known, kept)

    def found(self) -> list[Stretch]:
        """Return the stretches in which a rapid meets more than the rest of a rounded corner."""
        met = self._rows.depth_mm > CONTACT_MM
        rows = taken(self._rows, met)
        if not len(rows.row):
            return []
        begins = np.flatnonzero(np.diff(rows.row, prepend=-2) > 1)
        stretch = np.repeat(np.arange(len(begins)), np.diff(begins, append=len(rows.row)))
        depth_mm = self._below_surface(rows, begins[stretch])
        way_mm, deepest_mm = np.bincount(stretch, rows.step_mm), np.zeros(len(begins))
        np.maximum.at(deepest_mm, stretch, depth_mm)
        grazes = (way_mm <= _GRAZE_MM) & (deepest_mm <= min(self._blend_mm, _THIN_MM) + CONTACT_MM)
        return [
            Stretch(int(rows.line[begins[k]]), int(rows.tool[begins[k]]), float(deepest_mm[k]))
            for k in np.flatnonzero(~grazes)[:MOST_PLACES]
        ]

    @staticmethod
    def _below_surface(rows: _Rows, first: Ints) -> Floats:
        """Return how far (m,) rapids are below the surface that they met in the ``first`` row of a stretch.

        Material that one sample has cut off is missing for the next, so the descent is added.
        """
        down_mm = np.cumsum(rows.descent_mm)
        return np.asarray(np.maximum(rows.depth_mm, rows.depth_mm[first] + down_mm - down_mm[first]))
