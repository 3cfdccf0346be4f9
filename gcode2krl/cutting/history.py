"""How a part comes about, coarse enough to be shown: what stands when, what left it, and which way it faces.

The motion is cut out of a field with several cells to a block. A block has their mean height, so that the
volume is that of the cells.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import (
    INT,
    INTS32,
    OUT_FLOATS32,
    OUT_INTS,
    OUT_INTS32,
    core_function,
)
from gcode2krl.cutting.engagement import outlines_of
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.milling import shaped
from gcode2krl.cutting.outlook import outlook_of, turned
from gcode2krl.cutting.raw_part import height_field_of
from gcode2krl.cutting.records import taken
from gcode2krl.cutting.surface import surface_history
from gcode2krl.cutting.sweep import BALL, GRID, LANES, PATH, Grid, Path
from gcode2krl.tables import Motion, PartHistory, SurfaceHistory, Toolpath, lengths

Heights = NDArray[np.float32]

MOST_BLOCKS = 40_000
MOST_EVENTS = 150_000
"""Some 0.4 MB of a page."""
_MOST_SIDE = 6
"""Cells of a field along the side of a block; more do not make the volume better."""
_SHORTEST_S, _SLOTS = 0.2, 2000
"""What happens to a block within a slot of time, at first a share of the whole, is one event."""
_STEP_MM = 0.05
"""A wall is where heights differ by more on both sides of it."""

_cut = core_function(
    "cutting_history",
    *(GRID, PATH, INTS32, INT, INT, OUT_FLOATS32, OUT_INTS32),
    *(OUT_INTS32, OUT_INTS32, OUT_FLOATS32, OUT_INTS),
    returns=INT,
)


def history_of(
    toolpath: Toolpath,
    motion: Motion,
    cell: Cell,
    most_blocks: int = MOST_BLOCKS,
    most_events: int = MOST_EVENTS,
) -> PartHistory | SurfaceHistory:
    """Return how the part comes about along a motion; a surface where the tool axis turns.

    Raises
    ------
    NotUnderstoodError
        Where the stock cannot be read.
    """
    outlook = outlook_of([motion]).on(toolpath.restart.material if toolpath.restart is not None else None)
    if outlook.turns:
        slots, most = (_SHORTEST_S, 1.0 / _SLOTS), (most_blocks, most_events)
        return surface_history(toolpath, motion, cell, outlook, slots, most)
    tools, to_field = [cell.tool[number] for number in outlook.numbers], outlook.to_field
    field, side = _coarse(height_field_of(toolpath, cell, to_field, tools), most_blocks)
    grid, raw_mm = field.grid(0, 0, field.height_mm.shape[1]), _means(field, side)
    path, sample = _path(motion, to_field, outlook.numbers, outlines_of(tools), toolpath)
    events, mean_mm, last = _cut_out(grid, path, motion.time_s[sample], side, raw_mm, most_events)
    origin_mm, size_mm = field.origin_mm, field.cell_mm * side
    point, normal = _surface(grid, path, side, last, mean_mm, origin_mm, size_mm)
    return PartHistory(
        to_field=to_field,
        origin_mm=origin_mm,
        cell_mm=size_mm,
        bottom_mm=field.bottom_mm,
        raw_mm=raw_mm.astype(np.float64),
        cell=events.block,
        sample=sample[events.point],
        height_mm=events.height_mm.astype(np.float64),
        left_by=np.where(point >= 0, sample[point], -1),
        normal=turned(normal.reshape(-1, 3), to_field.T).reshape(normal.shape),
    )


def _coarse(field: HeightField, most_blocks: int) -> tuple[HeightField, int]:
    """Return the material in cells that fill it exactly, and how many of them are the side of a block."""
    size_mm = np.array(field.height_mm.shape[::-1]) * field.cell_mm
    wanted_mm = max(math.sqrt(float(size_mm.prod()) / most_blocks), float(field.cell_mm.max()))
    side = int(np.clip(round(wanted_mm / float(field.cell_mm.max())), 1, _MOST_SIDE))
    columns, rows = np.maximum(np.rint(size_mm / wanted_mm), 1).astype(np.int64) * side
    at = [
        np.minimum(((np.arange(count) + 0.5) / count * whole).astype(np.int64), whole - 1)
        for count, whole in zip((rows, columns), field.height_mm.shape, strict=True)
    ]
    height = np.ascontiguousarray(field.height_mm[np.ix_(*at)])
    return HeightField(height, field.origin_mm, size_mm / (columns, rows), field.bottom_mm), side


def _means(field: HeightField, side: int) -> Heights:
    """Return the mean height (r, c) of each block."""
    rows, columns = (count // side for count in field.height_mm.shape)
    heights = np.maximum(field.height_mm, field.bottom_mm).reshape(rows, side, columns, side)
    means: Heights = heights.mean(axis=(1, 3), dtype=np.float64).astype(np.float32)
    return means


def _path(
    motion: Motion, to_field: Floats, numbers: tuple[int, ...], outlines: Floats, toolpath: Toolpath
) -> tuple[Path, Ints]:
    """Return the way of the tip, and the sample (p,) to which the sweep to each point belongs."""
    position = turned(motion.position_mm, to_field)
    tool = np.searchsorted(numbers, motion.tool).astype(np.int32)
    joined = np.append(False, tool[1:] == tool[:-1])
    way = shaped(position, turned(motion.direction, to_field), motion.path_mm, joined)
    tool_of_place = tool[way.sample]
    first = np.append(True, tool_of_place[1:] != tool_of_place[:-1])
    rapid = toolpath.rapid[np.clip(motion.move, 0, len(toolpath) - 1)][way.sample]
    steps_mm = lengths(np.diff(way.position_mm, axis=0, prepend=way.position_mm[:1]))
    place = np.ascontiguousarray(way.position_mm)
    return Path(place, np.cumsum(steps_mm), tool_of_place, rapid, first, outlines), way.sample


class _Events(NamedTuple):
    """Blocks (e) that got lower, in the order of time."""

    block: Ints32
    point: Ints32
    """(e,) the point of the path by which that had happened."""
    height_mm: Heights


def _cut_out(
    grid: Grid, path: Path, time_s: Floats, side: int, raw_mm: Heights, most_events: int
) -> tuple[_Events, Heights, Ints32]:
    """Cut the path out of the grid; return the events, and of each block mean height and last point."""
    mean_mm, last = raw_mm.copy(), np.full(raw_mm.shape, -1, dtype=np.int32)
    begin_s, whole_s = (float(time_s[0]), float(time_s[-1] - time_s[0])) if len(time_s) else (0.0, 0.0)
    slot_s = max(_SHORTEST_S, whole_s / _SLOTS)
    slot = ((time_s - begin_s) / slot_s).astype(np.int32)
    room = max(3 * last.size, 100_000)
    block, point, height = np.empty(room, np.int32), np.empty(room, np.int32), np.empty(room, np.float32)
    count, parts, at = np.zeros(1, dtype=np.int64), [], 1
    while at < len(time_s):
        at = _cut(grid, path, slot, at, side, mean_mm, last, block, point, height, count)
        parts.append([column[: count[0]].copy() for column in (block, point, height)])
    cut = np.flatnonzero(last >= 0).astype(np.int32)
    parts.append([cut, last.ravel()[cut], mean_mm.ravel()[cut]])
    events = _Events(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    order = np.lexsort((events.point, events.block))
    events = taken(events, order)
    while len(events.block) > most_events:
        slot_s *= 1.5
        slots = ((time_s[events.point] - begin_s) / slot_s).astype(np.int64)
        ends = np.append((events.block[1:] != events.block[:-1]) | (slots[1:] != slots[:-1]), True)
        events = taken(events, ends)
    order = np.argsort(events.point, kind="stable")
    return taken(events, order), mean_mm, last


def _surface(
    grid: Grid, path: Path, side: int, last: Ints32, mean_mm: Heights, origin_mm: Floats, size_mm: Floats
) -> tuple[Ints32, Floats]:
    """Return for each block (r, c) the point whose sweep left its surface, and its normal (r, c, 3).

    A block that a wall runs through faces as the wall does.
    """
    point, normal = last.copy(), np.full((*last.shape, 3), np.nan)
    row, column = np.nonzero(last >= 0)
    place = np.stack(
        [*(origin_mm + (np.stack([column, row], axis=1) + 0.5) * size_mm).T, mean_mm[row, column]], axis=1
    )
    normal[row, column] = _floor_normals(path, last[row, column], place)
    cell_row, cell_column, sweep, towards = _walls(grid, path)
    order = np.argsort(sweep, kind="stable")  # the last one counts
    row, column = cell_row[order] // side, cell_column[order] // side
    step = np.rint(towards[order]).astype(np.int64) * (last[row, column] < 0)[:, None]  # it ends at a border
    row, column = (np.clip(at + step[:, k], 0, last.shape[1 - k] - 1) for k, at in ((1, row), (0, column)))
    is_cut = last[row, column] >= 0
    row, column = row[is_cut], column[is_cut]
    point[row, column], normal[row, column] = sweep[order][is_cut], towards[order][is_cut]
    return point, normal


def _floor_normals(path: Path, sweep: Ints32, place_mm: Floats) -> Floats:
    """Return the normals (n, 3) of what sweeps leave at places (n, 3): those of the cutter's outline."""
    radius, bottom, corner, arc_radius, _, steep, kind = path.outlines[path.tool[sweep]].T
    is_ball = kind == BALL
    lift = np.stack([np.zeros(len(sweep)), np.zeros(len(sweep)), np.where(is_ball, radius, 0.0)], axis=1)
    start, end = path.position_mm[sweep - 1] + lift, path.position_mm[sweep] + lift
    # a ball's surface faces its middle, which passes nearest in space; of other cutters the axis counts
    flat = np.where(is_ball, 1.0, 0.0)[:, None] * [0.0, 0.0, 1.0] + [1.0, 1.0, 0.0]
    way, off = (end - start) * flat, (place_mm - start) * flat
    share = np.clip((way * off).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12), 0.0, 1.0)
    away = off - share[:, None] * way
    distance = np.maximum(lengths(away), 1e-9)
    x = np.clip(distance - bottom, 0.0, 0.999 * corner)
    slope = np.where(corner > 0.0, x / np.sqrt(np.maximum(corner**2 - x**2, 1e-12)), 0.0)
    slope = np.where((steep > 0.0) & (distance > arc_radius), steep, slope)
    outline = -away / distance[:, None] * slope[:, None]
    outline[:, 2] = 1.0
    normal = np.where(is_ball[:, None], -away, outline)
    unit: Floats = normal / np.maximum(lengths(normal), 1e-12)[:, None]
    return unit


def _walls(grid: Grid, path: Path) -> tuple[Ints, Ints, Ints32, Floats]:
    """Return rows, columns and sweeps (w,) of the cells through which a wall runs, and its normal (w, 3)."""
    inside = grid.wall[1:-1, 1:-LANES]
    row, column = np.nonzero(inside >= 0)
    sweep = inside[row, column]
    x = grid.x_mm + (column + 0.5) * grid.dx_mm
    y = grid.y_mm + (row + 0.5) * grid.dy_mm
    start, end = path.position_mm[sweep - 1, :2], path.position_mm[sweep, :2]
    off, way = np.stack([x, y], axis=1) - start, end - start
    share = np.clip((way * off).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12), 0.0, 1.0)
    to_axis = share[:, None] * way - off
    to_axis /= np.maximum(np.hypot(*to_axis.T), 1e-9)[:, None]
    step = np.rint(to_axis).astype(np.int64)
    high, low = (
        np.maximum(grid.height[row + 1 + sign * step[:, 1], column + 1 + sign * step[:, 0]], grid.bottom_mm)
        for sign in (-1, 1)
    )
    is_wall: Bools = high - low > _STEP_MM
    normal = np.concatenate([to_axis, np.zeros((len(row), 1))], axis=1)
    return row[is_wall], column[is_wall], sweep[is_wall], normal[is_wall]
