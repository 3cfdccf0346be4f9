"""Walls inside cells: drawn by the sweeps that leave them, read to a small fraction of a cell.

A cell holds only the height over its middle; where the upright wall of a sweep runs through it, the number of
that sweep is noted in `Grid.wall`, and a point of the cell is looked up on the side of the wall where it
lies.
"""

# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False

import math

import numpy as np

from gcode2krl.cutting.kernels import inlined, kernel
from gcode2krl.cutting.sweep import (
    FEEL_MM,
    RADIUS,
    cell_at,
    highest,
    nearest,
    outline_height,
    outline_of,
    sweep_height,
)

WALL_SLACK = 0.05
"""Distance in cells within which a wall counts as cut: sweeps are chords, whose joints recede a little."""


@kernel
def height_at(place, shift, height, wall, position, outlines, tools, x, y):
    """Return the top of the material at a point: of its cell, or beside the wall that runs through it."""
    row, column = cell_at(place, shift, height.shape, x, y)
    if row < 0:
        return -math.inf
    sweep = np.int64(wall[row, column])
    if sweep < 0:
        return np.float64(height[row, column])
    return beside_wall(
        place, shift, height, position, outline_of(outlines, tools[sweep]), sweep, row, column, x, y
    )


@kernel
def beside_wall(place, shift, height, position, outline, sweep, row, column, x, y):
    """Return the height on the point's side of the wall that a sweep left in the cell."""
    here = np.float64(height[row, column])
    cut = sweep_height(position, sweep - 1, sweep, outline, x, y, WALL_SLACK * place[2])
    if cut < math.inf:
        return min(here, cut)
    middle_x, middle_y = (
        place[0] + (column + shift[1] + 0.5) * place[2],
        place[1] + (row + shift[0] + 0.5) * place[3],
    )
    if nearest(position, sweep - 1, sweep, middle_x, middle_y)[0] >= outline[RADIUS]:
        return here
    distance, share, _ = nearest(
        position, sweep - 1, sweep, x, y
    )  # the cell's height is that of the cut side
    foot_x = position[sweep - 1, 0] + share * (position[sweep, 0] - position[sweep - 1, 0])
    foot_y = position[sweep - 1, 1] + share * (position[sweep, 1] - position[sweep - 1, 1])
    away_x, away_y = (x - foot_x) / distance * place[2], (y - foot_y) / distance * place[3]
    row, column = cell_at(place, shift, height.shape, x + away_x, y + away_y)
    return -math.inf if row < 0 else max(here, np.float64(height[row, column]))


@kernel
def draw_walls(grid, path, k, after):
    """Draw the walls that sweep k leaves: both sides, and the round at its end where the next one turns away.

    ``after`` is the number of samples.
    """
    position = path.position_mm
    ax, ay, bx, by = position[k - 1, 0], position[k - 1, 1], position[k, 0], position[k, 1]
    outline = outline_of(path.outlines, path.tool[k])
    radius = outline[RADIUS]
    floor = min(position[k - 1, 2], position[k, 2]) + outline_height(radius, outline)
    top = highest(
        grid.place,
        grid.shift,
        grid.bound,
        min(ax, bx) - radius,
        max(ax, bx) + radius,
        min(ay, by) - radius,
        max(ay, by) + radius,
    )
    if top <= floor + FEEL_MM:
        return
    quarter = 0.5 * math.pi
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    if length > 0.0:
        nx, ny = -(by - ay) / length, (bx - ax) / length
        _draw_line(grid, path, k, radius, floor, nx, ny)
        _draw_line(grid, path, k, radius, floor, -nx, -ny)
        if path.first[k - 1]:  # the round at the start of the chain
            came = math.atan2(by - ay, bx - ax)
            _draw_round(grid, path, k, ax, ay, radius, floor, came + quarter, came + 3 * quarter)
    next_x, next_y = bx, by
    if k + 1 < after and not path.first[k + 1]:
        next_x, next_y = position[k + 1, 0], position[k + 1, 1]
        if next_x == bx and next_y == by:
            return  # the last of the samples at one place draws the round
    onward = math.sqrt((next_x - bx) ** 2 + (next_y - by) ** 2)
    cross, dot = (
        (bx - ax) * (next_y - by) - (by - ay) * (next_x - bx),
        (bx - ax) * (next_x - bx) + (by - ay) * (next_y - by),
    )
    if dot > 0.0 and abs(cross) * radius < 0.5 * grid.place[2] * dot:
        return  # straight on, within the resolution of a cell
    came, goes = math.atan2(by - ay, bx - ax), math.atan2(next_y - by, next_x - bx)
    start, stop = came - quarter, came + quarter
    if length == 0.0:
        start, stop = (0.0, 4 * quarter) if onward == 0.0 else (goes + quarter, goes + 3 * quarter)
    elif onward > 0.0:
        turn = math.atan2(cross, dot)
        start, stop = (start, start + turn) if turn > 0.0 else (stop + turn, stop)
    _draw_round(grid, path, k, bx, by, radius, floor, start, stop)


@kernel
def _draw_line(grid, path, k, radius, floor, nx, ny):
    """Draw the wall beside sweep k on the side of the normal: every cell that it crosses."""
    position, (x0, y0, dx, dy) = path.position_mm, grid.place
    x, y = (position[k - 1, 0] + radius * nx - x0) / dx, (position[k - 1, 1] + radius * ny - y0) / dy
    ux, uy = (position[k, 0] - position[k - 1, 0]) / dx, (position[k, 1] - position[k - 1, 1]) / dy
    column, row = math.floor(x), math.floor(y)  # of the whole field
    step_x, step_y = (1 if ux > 0.0 else -1), (1 if uy > 0.0 else -1)
    over_x, over_y = (abs(1.0 / ux) if ux != 0.0 else math.inf), (abs(1.0 / uy) if uy != 0.0 else math.inf)
    next_x = (column + (ux > 0.0) - x) / ux if ux != 0.0 else math.inf
    next_y = (row + (uy > 0.0) - y) / uy if uy != 0.0 else math.inf
    at = 0.0
    while at <= 1.0:
        _draw_cell(grid, path, k, row, column, floor, nx, ny)
        if next_x < next_y:
            at, column, next_x = next_x, column + step_x, next_x + over_x
        else:
            at, row, next_y = next_y, row + step_y, next_y + over_y


@kernel
def _draw_round(grid, path, k, x, y, radius, floor, start, stop):
    """Draw the wall on a part of the circle about (x, y), counter-clockwise in rad."""
    x0, y0, dx, dy = grid.place
    count = math.ceil((stop - start) * radius / (0.25 * dx))
    for step in range(count):
        angle = start + (step + 0.5) * (stop - start) / count
        nx, ny = math.cos(angle), math.sin(angle)
        column, row = math.floor((x + radius * nx - x0) / dx), math.floor((y + radius * ny - y0) / dy)
        _draw_cell(grid, path, k, row, column, floor, nx, ny)


@inlined
def _draw_cell(grid, path, k, row, column, floor, nx, ny):
    """Note the wall of sweep k in a cell, unless there is no material behind it or a deeper wall is there."""
    x, y = grid.place[0] + (column + 0.5) * grid.place[2], grid.place[1] + (row + 0.5) * grid.place[3]
    column, row = column - grid.shift[1], row - grid.shift[0]
    if 0 <= column < grid.height.shape[1] and 0 <= row < grid.height.shape[0]:
        behind_column, behind_row = column + math.floor(0.5 + nx), row + math.floor(0.5 + ny)
        top = grid.height[row, column]
        if 0 <= behind_column < grid.height.shape[1] and 0 <= behind_row < grid.height.shape[0]:
            top = max(top, grid.height[behind_row, behind_column])
        if top > floor + FEEL_MM:
            old = np.int64(grid.wall[row, column])
            slack = 0.5 * WALL_SLACK * grid.place[2]
            if old < 0 or _deeper(path.position_mm, path.outlines, path.tool, k, old, x, y, floor, slack):
                grid.wall[row, column] = k


@kernel
def _deeper(position, outlines, tools, k, old, x, y, floor, slack):
    """Return whether sweep k reaches deeper or farther at a point than the one whose wall is drawn there."""
    outline = outline_of(outlines, tools[old])
    old_floor = min(position[old - 1, 2], position[old, 2]) + outline_height(outline[RADIUS], outline)
    if floor < old_floor - FEEL_MM:
        return True
    old_gap = nearest(position, old - 1, old, x, y)[0] - outline[RADIUS]
    new_gap = nearest(position, k - 1, k, x, y)[0] - outlines[tools[k], RADIUS]
    return new_gap < old_gap - slack
