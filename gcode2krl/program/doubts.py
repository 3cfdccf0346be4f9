"""Valid G-code that is hardly intended: warnings from the G-code and the cell alone."""

import math
import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from gcode2krl.arrays import Bools
from gcode2krl.cell import Cell
from gcode2krl.cell.layout import obstacle_box, stock_box
from gcode2krl.cell.sections import Material, Tool
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import Issue
from gcode2krl.tables import Event, Toolpath
from gcode2krl.units import MS_PER_S, RAD_PER_REV, S_PER_MIN

# Looking a word up in the G-code itself, for findings whose table knows only the move before it.

MOST_LINES = 1000


def line_with(source: str, pattern: str, first: int, last: int, *, from_end: bool = False) -> int | None:
    """Return the 1-based line between two lines (both included) whose code matches a pattern.

    ``pattern`` is compared with the text in capitals, without comments and blanks. None where no line does,
    or the file cannot be read again (standard input).
    """
    first = max(first, last - MOST_LINES if from_end else first, 1)
    try:
        with Path(source).open(encoding="latin-1") as file:
            lines = list(islice(file, first - 1, min(last, first + MOST_LINES)))
    except (OSError, ValueError):
        return None
    wanted = re.compile(pattern)
    matching = [k for k, text in enumerate(lines, start=first) if wanted.search(_code(text))]
    if not matching:
        return None
    return matching[-1] if from_end else matching[0]


def _code(text: str) -> str:
    return re.sub(r"\([^)]*\)?|;.*|\s+", "", text).upper()


LONG_DWELL_S = 30.0
"""Assumed: a spindle needs some seconds to start, a chip some turns to break; 30 s are probably a wrong
unit."""
WIDE_CORNER_MM = 3.0
"""Assumed: a corner that is rounded by more is not what a milled part asks for (the test program of
`identify controller` rounds by 2.4 mm on purpose)."""
RUBBING_MM = 0.001
"""Feed per tooth below which no chip forms: a fifth of the edge radius of the sharpest carbide, 5 µm."""
THICK_MM, THICK_OF_DIAMETER, THICK_OF_FLAT_IN_METAL = 0.2, 0.1, 0.03
"""Feed per tooth above which no mill of that diameter cuts: usual are 0.002 to 0.02 of it, 0.05 in wood; at
small depth a ball or a corner radius makes the chip thinner than the feed."""
_DOWN_MM = 0.01
_SHORT_MM = 1e-6


def doubtful(toolpath: Toolpath, cell: Cell, tolerance_mm: float | None = None) -> Iterator[Issue]:
    """Yield warnings on dwells, blending and stops in the cut beyond what is usual.

    ``tolerance_mm`` is the blend tolerance asked for, below ``G64 P`` and above the cell's.
    """
    feed = ~toolpath.rapid & ~toolpath.machine & toolpath.is_position()
    feed[:1] = False
    yield from _dwells(toolpath)
    yield from _blends(toolpath, cell, tolerance_mm, feed)
    yield from _stops_in_cut(toolpath, cell, feed)
    yield from _stock_elsewhere(toolpath, cell, feed)
    yield from _clamps_above_plane(toolpath, cell)


def _dwells(toolpath: Toolpath) -> Iterator[Issue]:
    long = np.flatnonzero(toolpath.dwell_s > LONG_DWELL_S)
    if not len(long):
        return
    row, seconds = int(long[0]), float(toolpath.dwell_s[long[0]])
    first = int(toolpath.source_line[row])
    last = int(toolpath.source_line[row + 1]) if row + 1 < len(toolpath) else first + 100
    span = toolpath.source, first, max(last, first)
    line = _line_in(span, rf"G0*4(?![0-9]).*P0*{seconds:g}") or _line_in(span, r"G0*4(?![0-9])") or first
    many = f", {len(long)} times" if len(long) > 1 else ""
    yield Issue(
        "warning",
        "dwell-long",
        line,
        f"a dwell of {seconds:g} s ({seconds / S_PER_MIN:.1f} min){many}: G4 P counts seconds",
        f"if milliseconds are meant, write G4 P{seconds / MS_PER_S:g}",
    )


def _line_in(span: tuple[str, int, int], pattern: str) -> int | None:
    source, first, last = span
    return line_with(source, pattern, first, last)


def _blends(toolpath: Toolpath, cell: Cell, tolerance_mm: float | None, feed: Bools) -> Iterator[Issue]:
    controller = cell.controller
    programmed = feed & (toolpath.tolerance_mm > WIDE_CORNER_MM)
    if programmed.any():
        row = int(np.argmax(programmed))
        line = int(toolpath.source_line[row])
        value = float(toolpath.tolerance_mm[row])
        g64_line = line_with(toolpath.source, r"G64.*P", 1, line, from_end=True)
        remedy = "G64 P0.05 is usual; under G20 P counts inches"
        yield _wide_blend(f"G64 P allows corners to be {value:g} mm off", g64_line or line, remedy)
    blended = feed & ~toolpath.exact_stop & np.isnan(toolpath.tolerance_mm)
    if not blended.any():
        return
    tolerance = tolerance_mm if tolerance_mm is not None else controller.tolerance_mm
    if tolerance is not None:
        if tolerance > WIDE_CORNER_MM:
            name = "--tolerance" if tolerance_mm is not None else "[controller] tolerance_mm ="
            line = int(toolpath.source_line[_widest_corner(toolpath, 1e9, blended)[0]])
            words = f"{name} {tolerance:g} allows corners to be as many mm off"
            yield _wide_blend(words, line, "0.02 to 0.2 is usual")
    elif controller.cdis_mm * math.sqrt(0.125) > WIDE_CORNER_MM:
        row, error_mm = _widest_corner(toolpath, controller.cdis_mm, blended)
        words = f"[controller] cdis_mm = {controller.cdis_mm:g} rounds corners, this one by {error_mm:.3f} mm"
        yield _wide_blend(words, int(toolpath.source_line[row]), "0.05 to 1 is usual for milling")


def _wide_blend(words: str, line: int, remedy: str) -> Issue:
    return Issue("warning", "blend-wide", line, words, remedy)


def _widest_corner(toolpath: Toolpath, cdis_mm: float, rows: Bools) -> tuple[int, float]:
    """Return the row at whose end CDIS rounds most, and by how much: d·cos(alpha/2)/2 (see `blending`)."""
    chosen = np.flatnonzero(rows[:-1] & rows[1:])
    if not len(chosen):
        return int(np.argmax(rows)), 0.0
    position = toolpath.position_mm
    before, after = position[chosen] - position[chosen - 1], position[chosen + 1] - position[chosen]
    long_before, long_after = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    product = np.maximum(long_before * long_after, _SHORT_MM**2)
    cos_half = np.sqrt(np.clip(0.5 - 0.5 * np.einsum("ij,ij->i", before, after) / product, 0.0, 1.0))
    error = 0.5 * np.minimum(cdis_mm, 0.5 * np.minimum(long_before, long_after)) * cos_half
    worst = int(np.argmax(error))
    return int(chosen[worst]), float(error[worst])


def _stops_in_cut(toolpath: Toolpath, cell: Cell, feed: Bools) -> Iterator[Issue]:
    """Yield M0 and M1 that stop the tool lower than its feed run began, so in the material."""
    stops = [event for event in toolpath.events if _stops(event, cell)]
    if not stops:
        return
    row = np.arange(len(feed))
    begin = np.maximum.accumulate(np.where(feed, 0, row))  # the row before the feed run
    position, axis = toolpath.position_mm, toolpath.axis
    for event in stops:
        depth_mm = float((position[begin[event.row]] - position[event.row]) @ axis[event.row])
        if feed[event.row] and depth_mm > _DOWN_MM:
            turning = "the spindle turning" if _spindle_on(toolpath, event) else "the spindle stopped"
            yield Issue(
                "warning",
                "stop-in-cut",
                int(event.values["line"]),
                f"M{event.values['m']} stops the program with the tool in the cut, {depth_mm:.2f} mm below "
                f"where it went in, and {turning}",
                "retract before the stop and go back in behind it",
            )


def _stock_elsewhere(toolpath: Toolpath, cell: Cell, feed: Bools) -> Iterator[Issue]:
    """Yield a stated stock that lies beside all feed moves, by more than its own size.

    What is nearer the simulation of the cut finds, if there is one.
    """
    box = stock_box(cell)
    rows = np.flatnonzero(feed)
    if box is None or not len(rows):
        return
    radius_mm = max((tool.diameter_mm for tool in cell.tool.values()), default=0.0) / 2.0
    places = toolpath.position_mm[np.append(rows, rows - 1)][:, :2]
    low, high = places.min(axis=0) - radius_mm, places.max(axis=0) + radius_mm
    beside_mm = np.maximum(low - box[1][:2], box[0][:2] - high)
    if (beside_mm > (box[1] - box[0])[:2]).any():
        yield Issue(
            "error",
            "stock-untouched",
            int(toolpath.source_line[rows[0]]),
            f"no feed move touches the stock that the cell states: all are {beside_mm.max():.1f} mm away",
            "correct stock.box_mm of the cell, the work offset, or the zero point of the program",
            key="stock.box_mm",
        )


def _clamps_above_plane(toolpath: Toolpath, cell: Cell) -> Iterator[Issue]:
    """Yield the obstacles that stand higher than the clearance plane where the program goes."""
    z_mm = cell.clearance_z_mm
    known = toolpath.is_position() & ~toolpath.machine
    if z_mm is None or not cell.obstacle or not known.any():
        return
    radius_mm = max((tool.diameter_mm for tool in cell.tool.values()), default=0.0) / 2.0
    places = toolpath.position_mm[known][:, :2]
    low, high = places.min(axis=0) - radius_mm, places.max(axis=0) + radius_mm
    for obstacle in cell.obstacle:
        box = obstacle_box(cell, obstacle)
        if box is None or not box[0][2] < z_mm < box[1][2]:
            continue
        if (low < box[1][:2]).all() and (box[0][:2] < high).all():
            yield Issue(
                "warning",
                "cell-contradiction",
                0,
                f"clearance.z_mm = {z_mm:g} is below the top of obstacle {obstacle.name}, {box[1][2]:g}, "
                "where the program goes",
                "raise clearance.z_mm of the cell above all clamps",
                key="clearance.z_mm",
            )


def _stops(event: Event, cell: Cell) -> bool:
    """Tell whether an event is M0 or M1 and the cell's KRL for it does more than comment."""
    number = event.values.get("m")
    if number not in (0, 1):
        return False
    text = cell.m_code.get(f"M{number}", "")
    return any(line.strip() and not line.strip().startswith(";") for line in text.splitlines())


def _spindle_on(toolpath: Toolpath, stop: Event) -> bool:
    rpm = 0.0
    for event in toolpath.events:
        if event is stop:
            break
        if event.kind == "spindle":
            rpm = event.values["rpm"]
    return rpm != 0.0


def _thick_share(tool: Tool, material: Material | None) -> float:
    flat = tool.kind in ("flat", "drill") and tool.corner_radius_mm == 0.0
    in_metal = material is not None and not material.is_soft
    return THICK_OF_FLAT_IN_METAL if flat and in_metal else THICK_OF_DIAMETER


def feeds_per_tooth(toolpath: Toolpath, cell: Cell, cuts: Bools) -> Iterator[Issue]:
    """Yield warnings on a feed per tooth F/(S·z) that forms no chip or is too large for the diameter.

    ``cuts`` (n,) tells which moves meet material.
    """
    turning = (
        cuts
        & ~toolpath.rapid
        & ~toolpath.machine
        & (toolpath.spindle_rad_s != 0.0)
        & (toolpath.feed_mm_s > 0.0)
    )
    x, y, z = (toolpath.position_mm[1:] != toolpath.position_mm[:-1]).T
    turning[1:] &= x | y | z
    for number in distinct(toolpath.tool[turning]).tolist():
        tool = cell.tool.get(number)
        rows = np.flatnonzero(turning & (toolpath.tool == number))
        if tool is None or not len(rows):
            continue
        f_z_mm = RAD_PER_REV * toolpath.feed_mm_s[rows] / (np.abs(toolpath.spindle_rad_s[rows]) * tool.teeth)
        most_mm = max(THICK_MM, _thick_share(tool, cell.material) * tool.diameter_mm)
        for wrong, words in (
            (f_z_mm < RUBBING_MM, f"less than {RUBBING_MM:g} mm: edges rub and nothing comes off"),
            (f_z_mm > most_mm, f"more than {most_mm:g} mm, for a tool of {tool.diameter_mm:g} mm"),
        ):
            if wrong.any():
                row = int(rows[np.argmax(wrong)])
                rpm = abs(float(toolpath.spindle_rad_s[row])) / RAD_PER_REV * S_PER_MIN
                yield Issue(
                    "warning",
                    "feed-per-tooth",
                    int(toolpath.source_line[row]),
                    f"F{toolpath.feed_mm_s[row] * S_PER_MIN:.6g} at S{rpm:.6g} with {tool.teeth} teeth are "
                    f"{f_z_mm[np.argmax(wrong)]:.3g} mm a tooth, {words}",
                    "check F, S and the unit, and the tool's teeth in the cell",
                )
