"""Findings from the raw part: entered by the approach, never touched, cut through, holder below its top.

Findings about a stated raw part are errors, about a guessed one warnings.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell.sections import Stock, Tool
from gcode2krl.cutting.cutter import outline, shape_of
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.outlook import Outlook
from gcode2krl.errors import Issue

_CONTACT_MM = 0.01
"""Less contact is rounding of path and cells."""
_CHORDS_RAD = np.array([0.17, 0.48, 0.79, 1.09, 1.40])
"""Corners, in the first quadrant, of the rectangles that represent a circle; none extends beyond it."""


@dataclass(frozen=True)
class Work:
    """What is known of some samples (m rows) that follow each other, in the frame of the field."""

    position_mm: Floats
    tool: Ints32
    """(m,) row of the tools."""
    source_line: Ints32
    feed: Bools
    """True on feed moves."""
    engaged: Bools
    """True in material."""


class StockChecks:
    """What is found of the material ``before`` the first cut, on samples that come some at a time.

    Unless it ``is_raw``, a program may end without touching it.
    """

    def __init__(
        self,
        tools: Sequence[Tool],
        outlook: Outlook,
        stock: Stock | None,
        before: HeightField,
        is_raw: bool = True,
    ) -> None:
        """Take the tools in the order of their numbers in the outlook, and what the cell states."""
        self._tools, self._numbers = tools, outlook.numbers
        self._stock, self._before = stock, before
        self._approach: list[Issue] | None = None
        self._touches = not is_raw
        self._first_feed: int | None = None
        self._above = [self._above_edges(row, outlook.lowest_mm[row]) for row in range(len(tools))]
        self._below = [self._underside(row) for row in range(len(tools))]

    def take(self, work: Work) -> None:
        """Judge the next samples."""
        if not len(work.tool):
            return
        if self._approach is None:
            self._approach = list(self._approached(work))
        if self._first_feed is None and work.feed.any():
            self._first_feed = int(work.source_line[np.argmax(work.feed)])
        self._touches |= bool((work.engaged & work.feed).any())
        for row, (above, below) in enumerate(zip(self._above, self._below, strict=True)):
            with_tool = work.tool == row
            for depth, rows in ((above, with_tool), (below, with_tool & work.feed)):
                if depth is not None:
                    depth.take(work, rows)

    def issues(self) -> Iterator[Issue]:
        """Yield the findings."""
        yield from self._approach or ()
        yield from self._holders_below_top()
        if self._before.guessed or self._stock is None:
            return
        if not self._touches and self._first_feed is not None:
            yield _untouched(self._first_feed)
        yield from self._undersides(self._stock)

    def _approached(self, work: Work) -> Iterator[Issue]:
        """Yield an error if the approach, a rapid from the clearance plane, ends in material."""
        depth_mm = standing_mm(self._before, work.position_mm[0], self._tools[work.tool[0]])
        if depth_mm > _CONTACT_MM:
            yield Issue(
                _severity(self._before),
                "rapid-in-stock",
                int(work.source_line[0]),
                f"the approach to the first position is a rapid move into material, {depth_mm:.2f} mm deep",
                "program the first position above the stock, then go down with G1",
            )

    def _above_edges(self, row: int, lowest_mm: float) -> "_Depth | None":
        """Return where the holder or the spindle's nose may go below the top and its width is not known."""
        tool, before = self._tools[row], self._before
        if tool.stick_out_mm is not None and tool.holder_diameter_mm is not None:
            return None  # the removal of material checks whether it touches
        reach_mm = tool.stick_out_mm if tool.stick_out_mm is not None else tool.length_mm
        top_mm = float(before.height_mm.max(initial=-np.inf))
        if reach_mm is None or not top_mm - (lowest_mm + reach_mm) > _CONTACT_MM:
            return None
        footprint = Footprint(before, before.height_mm > lowest_mm + reach_mm)
        return _Depth(footprint, top_mm, reach_mm, tool.diameter_mm / 2.0)

    def _underside(self, row: int) -> "_Depth | None":
        if self._before.guessed or self._stock is None:
            return None
        before, radius_mm = self._before, self._tools[row].diameter_mm / 2.0
        allowed_mm = before.bottom_mm - self._stock.through_mm
        return _Depth(Footprint(before, before.height_mm > before.bottom_mm), allowed_mm, 0.0, radius_mm)

    def _holders_below_top(self) -> Iterator[Issue]:
        for tool, number, depth in zip(self._tools, self._numbers, self._above, strict=True):
            if depth is not None and depth.line is not None:
                what = "holder" if tool.stick_out_mm is not None else "spindle nose"
                yield Issue(
                    "warning",
                    "holder-below-top",
                    depth.line,
                    f"the {what} of T{number} goes {depth.worst_mm:.2f} mm below the top of the stock, and "
                    "its width is not known",
                    f"give tool.{number}.stick_out_mm and holder_diameter_mm, or use a longer tool",
                )

    def _undersides(self, stock: Stock) -> Iterator[Issue]:
        for number, depth in zip(self._numbers, self._below, strict=True):
            if depth is not None and depth.line is not None:
                yield _cut_through(number, depth.line, depth.worst_mm, stock)


class TurnedStockChecks:
    """The same of a tool whose axis turns: whether it touches the stock, and how far it goes below it."""

    def __init__(
        self,
        tools: Sequence[Tool],
        numbers: Sequence[int],
        stock: Stock | None,
        low_mm: Floats,
        high_mm: Floats,
        is_raw: bool,
    ) -> None:
        """Take the tools, what the cell states (None: a guess), and the corners (3,) of the stock.

        What is left of a raw part need not be touched.
        """
        self._shapes, self._numbers = [shape_of(tool) for tool in tools], numbers
        self._stock, self._low_mm, self._high_mm = stock, low_mm, high_mm
        self._touches = not is_raw
        self._first_feed: int | None = None
        self._worst: dict[int, tuple[int, float]] = {}
        """By number of the tool: the first line below the underside, and the largest depth."""

    def pass_by(self, position_mm: Floats, axis: Floats, tool: Ints32, line: Ints32, feed: Bools) -> None:
        """Judge the next samples (m) by where the lowest point of the edge is."""
        if self._stock is None:
            return
        aside = np.sqrt(np.maximum(1.0 - axis[:, 2] ** 2, 0.0))
        for row, (shape, number) in enumerate(zip(self._shapes, self._numbers, strict=True)):
            edge_mm = shape.bottom_mm * aside + shape.corner_mm * (1.0 - axis[:, 2])
            depth_mm = self._low_mm[2] - self._stock.through_mm - (position_mm[:, 2] - edge_mm)
            margin_mm = shape.radius_mm
            over = (position_mm[:, :2] > self._low_mm[:2] - margin_mm).all(axis=1)
            over &= (position_mm[:, :2] < self._high_mm[:2] + margin_mm).all(axis=1)
            low = np.flatnonzero(over & feed & (tool == row) & (depth_mm > _CONTACT_MM))
            if len(low):
                first, worst = self._worst.get(number, (int(line[low[0]]), 0.0))
                self._worst[number] = first, max(worst, float(depth_mm[low].max()))

    def take(self, work: Work) -> None:
        """Note whether the next samples touch the stock."""
        if self._first_feed is None and work.feed.any():
            self._first_feed = int(work.source_line[np.argmax(work.feed)])
        self._touches |= bool((work.engaged & work.feed).any())

    def issues(self) -> Iterator[Issue]:
        """Yield the findings."""
        if self._stock is None:
            return
        if not self._touches and self._first_feed is not None:
            yield _untouched(self._first_feed)
        for number, (line, depth_mm) in sorted(self._worst.items()):
            yield _cut_through(number, line, depth_mm, self._stock)


def _untouched(line: int) -> Issue:
    sentence = "no feed move touches the stock that the cell states"
    remedy = "check the work offset (G54 to G59), the zero point and [stock]"
    return Issue("error", "stock-untouched", line, sentence, remedy)


def _cut_through(number: int, line: int, worst_mm: float, stock: Stock) -> Issue:
    through = f" and {stock.through_mm:g} mm are allowed" if stock.through_mm else ""
    depth_mm = worst_mm + stock.through_mm
    return Issue(
        "error",
        "stock-underside",
        line,
        f"T{number} cuts up to {depth_mm:.2f} mm below the stock's underside{through}",
        f"check Z; [stock] through_mm = {np.ceil(depth_mm * 10.0) / 10.0:g} allows it above a "
        "sacrificial board",
    )


class _Depth:
    """How far a tool, or what is above it, goes below a level where there is stock."""

    def __init__(self, footprint: "Footprint", level_mm: float, reach_mm: float, radius_mm: float) -> None:
        self._footprint, self._level_mm, self._reach_mm = footprint, level_mm, reach_mm
        self._radius_mm = radius_mm
        self.line: int | None = None
        """G-code line of the first sample below; None without any."""
        self.worst_mm = 0.0

    def take(self, work: Work, rows: Bools) -> None:
        depth_mm = self._level_mm - (work.position_mm[:, 2] + self._reach_mm)
        low = np.flatnonzero(rows & (depth_mm > _CONTACT_MM))
        low = low[self._footprint.below(work.position_mm[low], self._radius_mm)]
        if len(low):
            self.line = int(work.source_line[low[0]]) if self.line is None else self.line
            self.worst_mm = max(self.worst_mm, float(depth_mm[low].max()))


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


class Footprint:
    """Tells whether a cutter is over marked cells of a field, from sums over rectangles."""

    def __init__(self, field: HeightField, mask: Bools) -> None:
        self.field, self.mask = field, mask

    @cached_property
    def sums(self) -> Ints32:
        """Return the marked cells before each row and column; few programs go deep enough to need them."""
        rows, columns = self.mask.shape
        sums = np.zeros((rows + 1, columns + 1), dtype=np.int32)
        np.cumsum(np.cumsum(self.mask, axis=0, dtype=np.int32), axis=1, out=sums[1:, 1:])
        return sums

    def below(self, position_mm: Floats, radius_mm: float) -> Bools:
        """Return (n,) True where marked cells lie within the radius of a position (n, 3), seen from above."""
        is_over = np.zeros(len(position_mm), dtype=np.bool_)
        if not len(position_mm):
            return is_over
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
