"""Findings from the raw part: entered by the approach, never touched, cut through, holder below its top.

Findings about a stated raw part are errors, about a guessed one warnings.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell.sections import Stock, Tool
from gcode2krl.cutting.cutter import outline
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.errors import Issue

_CONTACT_MM = 0.01
"""Less contact is rounding of path and cells."""
_CHORDS_RAD = np.array([0.17, 0.48, 0.79, 1.09, 1.40])
"""Corners, in the first quadrant, of the rectangles that represent a circle; none extends beyond it."""


@dataclass(frozen=True)
class Work:
    """What is known of each sample (m rows), in the frame of the field."""

    position_mm: Floats
    tool: Ints32
    """(m,) row of ``tools``."""
    tools: tuple[Tool, ...]
    numbers: tuple[int, ...]
    """The tools' numbers."""
    source_line: Ints32
    feed: Bools
    """True on feed moves."""


def stock_findings(
    work: Work, stock: Stock | None, before: HeightField, engaged: Bools, is_raw: bool = True
) -> Iterator[Issue]:
    """Yield the findings from the material ``before`` the first cut; ``engaged`` (m,) is True in material.

    Unless it ``is_raw``, a program may end without touching it.
    """
    yield from _approach(work, before)
    yield from _above_edges(work, before)
    if before.guessed or stock is None:
        return
    if is_raw and not engaged.any() and work.feed.any():
        yield Issue(
            "error",
            "stock-untouched",
            int(work.source_line[np.argmax(work.feed)]),
            "no feed move touches the stock that the cell states",
            "check the work offset (G54 to G59), the zero point and [stock]",
        )
    yield from _underside(work, stock, before)


def _approach(work: Work, before: HeightField) -> Iterator[Issue]:
    """Yield an error if the approach, a rapid from the clearance plane, ends in material."""
    if not len(work.position_mm):
        return
    depth_mm = standing_mm(before, work.position_mm[0], work.tools[work.tool[0]])
    if depth_mm > _CONTACT_MM:
        yield Issue(
            _severity(before),
            "rapid-in-stock",
            int(work.source_line[0]),
            f"the approach to the first position is a rapid move into material, {depth_mm:.2f} mm deep",
            "program the first position above the stock, then go down with G1",
        )


def standing_mm(field: HeightField, tip_mm: Floats, tool: Tool) -> float:
    """Return how far a tool at a tip position (3,) is in the material of a field, 0 in air."""
    radii, heights = outline(tool)
    reach = float(radii[-1])
    (j0, j1), (i0, i1) = (field.cells(axis, tip_mm[axis] - reach, tip_mm[axis] + reach) for axis in (0, 1))
    part = field.height_mm[i0 : i1 + 1, j0 : j1 + 1]
    x = field.origin_mm[0] + (np.arange(part.shape[1]) + j0 + 0.5) * field.cell_mm[0] - tip_mm[0]
    y = field.origin_mm[1] + (np.arange(part.shape[0]) + i0 + 0.5) * field.cell_mm[1] - tip_mm[1]
    r = np.hypot(x, y[:, None])
    inside = (r < reach) & (part > field.bottom_mm)
    if not inside.any():
        return 0.0
    return max(0.0, float((part[inside] - tip_mm[2] - np.interp(r[inside], radii, heights)).max()))


def _above_edges(work: Work, before: HeightField) -> Iterator[Issue]:
    """Yield where the holder or the spindle's nose goes below the top and its width is not known."""
    top_mm = float(before.height_mm.max(initial=-np.inf))
    for row, (tool, number) in enumerate(zip(work.tools, work.numbers, strict=True)):
        if tool.stick_out_mm is not None and tool.holder_diameter_mm is not None:
            continue  # the removal of material checks whether it touches
        reach_mm = tool.stick_out_mm if tool.stick_out_mm is not None else tool.length_mm
        if reach_mm is None:
            continue
        depth_mm = top_mm - (work.position_mm[:, 2] + reach_mm)
        low = np.flatnonzero((work.tool == row) & (depth_mm > _CONTACT_MM))
        if not len(low):
            continue
        mask = before.height_mm > float((work.position_mm[low, 2] + reach_mm).min())
        low = low[Footprint(before, mask).below(work.position_mm[low], tool.diameter_mm / 2.0)]
        if len(low):
            worst = low[np.argmax(depth_mm[low])]
            what = "holder" if tool.stick_out_mm is not None else "spindle nose"
            yield Issue(
                "warning",
                "holder-below-top",
                int(work.source_line[low[0]]),
                f"the {what} of T{number} goes {depth_mm[worst]:.2f} mm below the top of the stock, and its "
                "width is not known",
                f"give tool.{number}.stick_out_mm and holder_diameter_mm, or use a longer tool",
            )


def _underside(work: Work, stock: Stock, before: HeightField) -> Iterator[Issue]:
    allowed_mm = before.bottom_mm - stock.through_mm
    below_mm = allowed_mm - work.position_mm[:, 2]
    for row, tool in enumerate(work.tools):
        low = np.flatnonzero(work.feed & (work.tool == row) & (below_mm > _CONTACT_MM))
        if not len(low):
            continue
        footprint = Footprint(before, before.height_mm > before.bottom_mm)
        low = low[footprint.below(work.position_mm[low], tool.diameter_mm / 2.0)]
        if len(low):
            worst = low[np.argmax(below_mm[low])]
            through = f" and {stock.through_mm:g} mm are allowed" if stock.through_mm else ""
            depth_mm = float(below_mm[worst]) + stock.through_mm
            yield Issue(
                "error",
                "stock-underside",
                int(work.source_line[low[0]]),
                f"T{work.numbers[row]} cuts up to {depth_mm:.2f} mm below the stock's underside{through}",
                f"check Z; [stock] through_mm = {np.ceil(depth_mm * 10.0) / 10.0:g} allows it above a "
                "sacrificial board",
            )


class Footprint:
    """Tells whether a cutter is over marked cells of a field, from sums over rectangles."""

    def __init__(self, field: HeightField, mask: Bools) -> None:
        self.field = field
        self.sums = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1), dtype=np.int32)
        np.cumsum(np.cumsum(mask, axis=0, dtype=np.int32), axis=1, out=self.sums[1:, 1:])

    def below(self, position_mm: Floats, radius_mm: float) -> Bools:
        """Return (n,) True where marked cells lie within the radius of a position (n, 3), seen from above."""
        is_over = np.zeros(len(position_mm), dtype=np.bool_)
        for angle in _CHORDS_RAD:
            half = radius_mm * np.array([np.cos(angle), np.sin(angle)])
            (j0, j1), (i0, i1) = (self._cells(position_mm[:, k], half[k], k) for k in (0, 1))
            s = self.sums
            is_over |= s[i1, j1] - s[i0, j1] - s[i1, j0] + s[i0, j0] > 0
        return is_over

    def _cells(
        self, middle_mm: Floats, half_mm: float, axis: int
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the first cell whose middle is within ``half_mm`` and the one after the last, (n,) each."""
        origin, size = self.field.origin_mm[axis], self.field.cell_mm[axis]
        count = self.sums.shape[1 - axis] - 1
        first = np.clip(np.ceil((middle_mm - half_mm - origin) / size - 0.5), 0, count)
        behind = np.clip(np.floor((middle_mm + half_mm - origin) / size - 0.5) + 1, 0, count)
        return first.astype(np.intp), np.maximum(behind, first).astype(np.intp)


def _severity(field: HeightField) -> Literal["error", "warning"]:
    return "warning" if field.guessed else "error"
