"""What a moving cutter leaves of a height field: compiled, one sweep after the other.

A sweep is what the cutter passes on a straight way between two samples. Each cell holds the height of the
material over its centre; the number of the sweep whose vertical wall runs through a cell is drawn into
`Grid.wall`, so that this wall is known exactly and not only to a cell.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcode2krl.cutting.kernels import kernel

LANES = np.uintp(16)
"""Cells that a compiled loop takes at once; so many columns of a grid are spare."""
BLOCK = 32
"""Cells along one side of a block that shares one bound of its height."""
FLAT, BALL, OTHER = 0.0, 1.0, 2.0
WALL_SLACK = 0.05
"""Cells by which a wall counts as cut: sweeps are chords, and joints of chords stand back a little."""
FEEL_MM = 1e-3
"""Material thinner than this is rounding of the path, not material."""
_REFRESH = 48  # visits after which the bound of a block is looked up again
_RADIUS, _BOTTOM, _CORNER, _ARC_RADIUS, _ARC_TOP, _STEEP, _KIND = range(7)


class Grid(NamedTuple):
    """A height field as the kernels see it; lengths in mm, row = y, column = x."""

    height: NDArray[np.float32]
    """(ny, nx) top of the material over the middle of a cell, -inf = none. The first row and column, the last row
    and the last LANES columns are empty."""
    wall: NDArray[np.int32]
    """(ny, nx) the sweep whose wall runs through a cell, -1 = none."""
    bound: NDArray[np.float32]
    """(ceil(ny/BLOCK), ceil(nx/BLOCK)) no height in the block is above it."""
    visits: NDArray[np.int32]
    place: tuple[float, float, float, float]
    """Low corner x, y of the whole field and size of a cell along x, y in mm."""
    shift: tuple[int, int]
    """Row and column of the whole field that are this grid's first: every coordinate is rounded as in the whole."""
    bottom_mm: float


class Path(NamedTuple):
    """Samples in the order of time, in the frame of the field (z = tool axis)."""

    position_mm: NDArray[np.float64]
    """(n, 3) tips."""
    tool: NDArray[np.int32]
    """(n,) row of `outlines`."""
    rapid: NDArray[np.bool_]
    first: NDArray[np.bool_]
    """(n,) True where no sweep leads to the sample: the first one, and after a change of tool."""
    outlines: NDArray[np.float64]
    """(t, 7) radius, bottom, corner, end of the corner arc (r, z), steepness of the side above it, kind."""


# --- one cutter, one sweep, at one point ---------------------------------------------------------------
# Small functions take numbers and the few arrays they need: to hand on a whole `Grid` costs more than they do.


@kernel
def outline_of(outlines, tool):
    """Return a row of `Path.outlines` as numbers."""
    return (
        outlines[tool, 0], outlines[tool, 1], outlines[tool, 2], outlines[tool, 3],
        outlines[tool, 4], outlines[tool, 5], outlines[tool, 6],
    )  # fmt: skip


@kernel
def outline_height(r, outline):
    """Return the height of the cutter's lower outline above the tip at radius r."""
    if r < outline[_ARC_RADIUS] or outline[_STEEP] == 0.0:
        x = min(max(r - outline[_BOTTOM], 0.0), outline[_CORNER])
        return outline[_CORNER] - math.sqrt(outline[_CORNER] ** 2 - x * x)
    return outline[_ARC_TOP] + (r - outline[_ARC_RADIUS]) * outline[_STEEP]


@kernel
def nearest(position, first, last, x, y):
    """Return distance, share and height of the point of the line between two samples that is nearest in plan."""
    ax, ay, az = position[first, 0], position[first, 1], position[first, 2]
    ux, uy, uz = position[last, 0] - ax, position[last, 1] - ay, position[last, 2] - az
    square = ux * ux + uy * uy
    if square < 1e-18:
        return math.sqrt((x - ax) ** 2 + (y - ay) ** 2), 0.0, az + min(uz, 0.0)
    share = min(max(((x - ax) * ux + (y - ay) * uy) / square, 0.0), 1.0)
    distance = math.sqrt((x - ax - share * ux) ** 2 + (y - ay - share * uy) ** 2)
    return distance, share, az + share * uz


@kernel
def sweep_height(position, first, last, outline, x, y, slack):
    """Return how deep the sweep between two samples cuts at a point, inf beside it."""
    radius = outline[_RADIUS]
    distance, _, z = nearest(position, first, last, x, y)
    if distance >= radius + slack:
        return math.inf
    lowest = z + outline_height(min(distance, radius), outline)
    for side in range(2):  # on a slope the nearest point in plan is not always the lowest
        end = last if side else first
        r = math.sqrt((x - position[end, 0]) ** 2 + (y - position[end, 1]) ** 2)
        if r < radius + slack:
            lowest = min(lowest, position[end, 2] + outline_height(min(r, radius), outline))
    return lowest


@kernel
def cell_at(place, shift, shape, x, y):
    """Return row and column of the cell at a point, row -1 outside the field."""
    column, row = math.floor((x - place[0]) / place[2]) - shift[1], math.floor((y - place[1]) / place[3]) - shift[0]
    if column < 0 or row < 0 or column >= shape[1] or row >= shape[0]:
        return -1, -1
    return row, column


@kernel
def beside_wall(place, shift, height, position, outline, sweep, row, column, x, y):
    """Return the height on the point's side of the wall that a sweep left in the cell."""
    here = np.float64(height[row, column])
    cut = sweep_height(position, sweep - 1, sweep, outline, x, y, WALL_SLACK * place[2])
    if cut < math.inf:
        return min(here, cut)
    middle_x, middle_y = place[0] + (column + shift[1] + 0.5) * place[2], place[1] + (row + shift[0] + 0.5) * place[3]
    if nearest(position, sweep - 1, sweep, middle_x, middle_y)[0] >= outline[_RADIUS]:
        return here
    distance, share, _ = nearest(
        position, sweep - 1, sweep, x, y
    )  # the cell's height is that of the cut side
    foot_x = position[sweep - 1, 0] + share * (position[sweep, 0] - position[sweep - 1, 0])
    foot_y = position[sweep - 1, 1] + share * (position[sweep, 1] - position[sweep - 1, 1])
    away_x, away_y = (x - foot_x) / distance * place[2], (y - foot_y) / distance * place[3]
    row, column = cell_at(place, shift, height.shape, x + away_x, y + away_y)
    return -math.inf if row < 0 else max(here, np.float64(height[row, column]))


# --- bounds ----------------------------------------------------------------------------------------------


@kernel
def cells_between(low, high, origin, size, shift, count):
    """Return the first cell and the one after the last whose middles lie between two coordinates."""
    first = math.ceil((low - origin) / size - 0.5) - shift
    after = math.floor((high - origin) / size - 0.5) + 1 - shift
    return max(first, 0), min(after, count)


@kernel
def highest(place, shift, bound, x_low, x_high, y_low, y_high):
    """Return a bound of the height within a rectangle, -inf where it misses the field."""
    ja, jb = cells_between(x_low - place[2], x_high + place[2], place[0], place[2], shift[1], bound.shape[1] * BLOCK)
    ia, ib = cells_between(y_low - place[3], y_high + place[3], place[1], place[3], shift[0], bound.shape[0] * BLOCK)
    top = np.float32(-np.inf)
    if ja >= jb or ia >= ib:
        return top
    for i in range(ia // BLOCK, (ib - 1) // BLOCK + 1):
        for j in range(ja // BLOCK, (jb - 1) // BLOCK + 1):
            top = max(top, bound[i, j])
    return top


@kernel
def refresh(height, bound, i, j):
    """Look up the bound of a block again."""
    top = np.float32(-np.inf)
    for row in range(i * BLOCK, min((i + 1) * BLOCK, height.shape[0])):
        for column in range(j * BLOCK, min((j + 1) * BLOCK, height.shape[1])):
            value = height[row, column]
            top = value if value > top else top
    bound[i, j] = top


@kernel
def _visit(height, bound, visits, ja, jb, ia, ib):
    """Count a visit of every block of a range of cells; now and then look its bound up."""
    for i in range(ia // BLOCK, (ib - 1) // BLOCK + 1):
        for j in range(ja // BLOCK, (jb - 1) // BLOCK + 1):
            visits[i, j] += 1
            if visits[i, j] >= _REFRESH:
                refresh(height, bound, i, j)
                visits[i, j] = 0


# --- removal -----------------------------------------------------------------------------------------------


@kernel
def remove_sweep(grid, path, k, index):
    """Lower the field below the sweep that ends at sample k; return the height a rapid has cut off, else 0.

    ``index`` holds 0, 1, 2 ... in single precision, as many as the longest sweep has cells in a row.
    """
    position, height, wall, outline = path.position_mm, grid.height, grid.wall, outline_of(path.outlines, path.tool[k])
    radius, kind = outline[_RADIUS], outline[_KIND]
    ax, ay, az = position[k - 1, 0], position[k - 1, 1], position[k - 1, 2]
    bx, by, bz = position[k, 0], position[k, 1], position[k, 2]
    x_low, x_high = min(ax, bx) - radius, max(ax, bx) + radius
    y_low, y_high = min(ay, by) - radius, max(ay, by) + radius
    if highest(grid.place, grid.shift, grid.bound, x_low, x_high, y_low, y_high) <= min(az, bz):
        return 0.0
    (x0, y0, dx, dy), (row, column) = grid.place, grid.shift
    ny, nx = height.shape[0], height.shape[1] - int(LANES)
    ia, ib = cells_between(y_low, y_high, y0, dy, row, ny)
    length, rise = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2), bz - az
    ex, ey, slope, sink = 1.0, 0.0, 0.0, 0.0
    if length > 1e-9:
        ex, ey = (bx - ax) / length, (by - ay) / length
        slope, sink = rise / length, rise / math.sqrt(length * length + rise * rise)
    else:
        length, az = 0.0, min(az, bz)
    chained = k > 1 and not path.first[k - 1]
    behind = -math.inf  # what lies farther back was cut when the cutter stood at the start
    if chained and length > 0.0:
        behind = 0.0 if slope >= 0.0 else sink * radius if kind == BALL else -radius
    hollow = chained and kind == FLAT and slope >= 0.0  # the whole disc at the start was cut
    worst = 0.0
    for i in range(ia, ib):
        y = y0 + (i + row + 0.5) * dy - ay
        left, right = _chord(y, ex, ey, length, radius)
        if behind > -math.inf:  # along >= behind
            if abs(ex) > 1e-9:
                edge = (behind - y * ey) / ex
                left, right = (max(left, edge), right) if ex > 0.0 else (left, min(right, edge))
            elif y * ey < behind:
                continue
        begin = math.ceil((left + ax - x0) / dx - 0.5) - column  # without the border of the grid
        ja, jb = cells_between(left + ax, right + ax, x0, dx, column, nx)
        if ja >= jb:
            continue
        x = x0 + (begin + column + 0.5) * dx - ax
        start = (x * ex + y * ey, y * ex - x * ey, dx * ex, -dx * ey)
        if path.rapid[k]:
            worst = max(worst, _measure(height, i, ja, jb, begin, start, az, slope, length, outline))
        if kind == BALL:
            _lower_ball(height, wall, i, ja, jb, begin, index, start, az, slope, sink, length, radius)
        elif kind == FLAT and slope == 0.0:
            gap_a, gap_b = jb, jb
            if hollow and abs(y) < radius:
                half = math.sqrt(radius * radius - y * y)
                gap_a, gap_b = cells_between(ax - half, ax + half, x0, dx, column, nx)
            _lower_to(height, wall, i, ja, min(gap_a, jb), az)
            _lower_to(height, wall, i, max(gap_b, ja), jb, az)
        elif kind == FLAT:
            _lower_ramp(height, wall, i, ja, jb, begin, index, start, az, slope, length, radius)
        else:
            _lower_other(height, wall, i, ja, jb, begin, index, start, az, slope, length, outline)
    ja, jb = cells_between(x_low, x_high, x0, dx, column, nx)
    if ia < ib and ja < jb:
        _visit(height, grid.bound, grid.visits, ja, jb, ia, ib)
    return worst


@kernel
def _chord(y, ex, ey, length, radius):
    """Return where a row enters and leaves the plan of a sweep, from its start (left > right: it does not)."""
    low, high = 0.0, length
    left, right = 0.0, length
    if ey != 0.0:
        a, b = (y - radius) / ey, (y + radius) / ey
        low, high = max(low, min(a, b)), min(high, max(a, b))
        tangent = radius * ex if ey > 0.0 else -radius * ex
        left, right = (y - tangent) / ey, (y + tangent) / ey
    elif ex < 0.0:
        left, right = length, 0.0
    if low > high or (ey == 0.0 and abs(y) > radius):
        return 1.0, 0.0
    left, right = min(max(left, low), high), min(max(right, low), high)
    reach_left = math.sqrt(max(radius * radius - (y - ey * left) ** 2, 0.0))
    reach_right = math.sqrt(max(radius * radius - (y - ey * right) ** 2, 0.0))
    return ex * left - reach_left, ex * right + reach_right


# The loops over the cells of a row have no branches and single precision (1 µm at the size of a cutter), and run
# in steps of LANES, so that the compiler takes eight or sixteen cells at once; cells beyond the end get inf.
# Indices are unsigned, or each would be tried for a negative one. Where a cell is lowered, older walls end.
# ``start`` holds along and beside the sweep at the
# cell ``begin``, which may lie outside the grid, and their steps from cell to cell.


@kernel
def _lower_to(height, wall, i, ja, jb, z):
    z, i = np.float32(z), np.uintp(i)
    for j in range(np.uintp(ja), np.uintp(max(ja, jb))):
        wall[i, j] = -1 if z < height[i, j] else wall[i, j]
        height[i, j] = z if z < height[i, j] else height[i, j]


@kernel
def _lower_ramp(height, wall, i, ja, jb, begin, index, start, z, slope, length, radius):
    """Lower cells below a flat cutter that rises or sinks: where it comes to a cell, or where it leaves it."""
    u, v, du, dv = np.float32(start[0]), np.float32(start[1]), np.float32(start[2]), np.float32(start[3])
    z, rise, length = np.float32(z), np.float32(slope), np.float32(length)
    square, zero = np.float32(radius * radius), np.float32(0.0)
    sign, far = np.float32(-1.0 if slope > 0.0 else 1.0), np.float32(np.inf)
    i, shift = np.uintp(i), np.uintp(ja - begin) - np.uintp(ja)
    for block in range(np.uintp(ja), np.uintp(jb), LANES):
        for lane in range(LANES):
            j = block + lane
            along, beside = u + index[j + shift] * du, v + index[j + shift] * dv
            rest = square - beside * beside
            reach = np.sqrt(rest if rest > zero else zero)
            t = along + sign * reach
            t = t if t > zero else zero
            low = z + rise * (t if t < length else length)
            low = low if (rest >= zero) & (along - reach <= length) & (along + reach >= zero) else far
            wall[i, j] = -1 if low < height[i, j] else wall[i, j]
            height[i, j] = low if low < height[i, j] else height[i, j]


@kernel
def _lower_ball(height, wall, i, ja, jb, begin, index, start, z, slope, sink, length, radius):
    """Lower cells below a rolling ball: its lowest point over a cell belongs to the nearest point of its axis."""
    u, v, du, dv = np.float32(start[0]), np.float32(start[1]), np.float32(start[2]), np.float32(start[3])
    centre, slope, sink = np.float32(z + radius), np.float32(slope), np.float32(sink)
    length, square, zero, far = (
        np.float32(length),
        np.float32(radius * radius),
        np.float32(0.0),
        np.float32(np.inf),
    )
    i, shift = np.uintp(i), np.uintp(ja - begin) - np.uintp(ja)
    for block in range(np.uintp(ja), np.uintp(jb), LANES):
        for lane in range(LANES):
            j = block + lane
            along, beside = u + index[j + shift] * du, v + index[j + shift] * dv
            rest = square - beside * beside
            t = along - sink * np.sqrt(rest if rest > zero else zero)
            t = t if t > zero else zero
            t = t if t < length else length
            rest = rest - (along - t) * (along - t)
            low = centre + slope * t - np.sqrt(rest if rest > zero else zero)
            low = low if rest >= zero else far
            wall[i, j] = -1 if low < height[i, j] else wall[i, j]
            height[i, j] = low if low < height[i, j] else height[i, j]


@kernel
def _lower_other(height, wall, i, ja, jb, begin, index, start, z, slope, length, outline):
    """Lower cells below any cutter. Along the sweep the height over a cell is convex: the lowest of both ends of
    the contact, its middle and the lowest point of the parabola through them."""
    one = np.float32
    u, v, du, dv = one(start[0]), one(start[1]), one(start[2]), one(start[3])
    z, slope, length = one(z), one(slope), one(length)
    square, zero, half, quarter = one(outline[_RADIUS] ** 2), one(0.0), one(0.5), one(0.25)
    arc_radius = one(outline[_ARC_RADIUS] if outline[_STEEP] > 0.0 else np.inf)
    shape = (
        one(outline[_BOTTOM]),
        one(outline[_CORNER]),
        arc_radius,
        one(outline[_ARC_TOP]),
        one(outline[_STEEP]),
    )
    tiny, far = one(1e-9), one(np.inf)
    i, shift = np.uintp(i), np.uintp(ja - begin) - np.uintp(ja)
    for block in range(np.uintp(ja), np.uintp(jb), LANES):
        for lane in range(LANES):
            j = block + lane
            along, beside = u + index[j + shift] * du, v + index[j + shift] * dv
            rest = square - beside * beside
            reach = np.sqrt(rest if rest > zero else zero)
            a, b = along - reach, along + reach
            a = a if a > zero else zero
            b = b if b < length else length
            touched = (b >= a) & (rest >= zero)
            b = b if b > a else a
            middle = half * (a + b)
            beside = beside * beside
            at_a = slope * a + _height32(beside + (along - a) * (along - a), shape)
            at_b = slope * b + _height32(beside + (along - b) * (along - b), shape)
            at_middle = slope * middle + _height32(beside + (along - middle) * (along - middle), shape)
            bend = at_a - at_middle + at_b - at_middle
            t = middle - quarter * (b - a) * (at_b - at_a) / (bend if bend > tiny else tiny)
            t = t if t > a else a
            t = t if t < b else b
            low = slope * t + _height32(beside + (along - t) * (along - t), shape)
            low = low if low < at_a else at_a
            low = low if low < at_b else at_b
            low = z + (low if low < at_middle else at_middle)
            low = low if touched else far
            wall[i, j] = -1 if low < height[i, j] else wall[i, j]
            height[i, j] = low if low < height[i, j] else height[i, j]


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, inline="always")
def _height32(square, shape):
    """`outline_height` of a squared radius, in single precision and without branches."""
    zero = np.float32(0.0)
    r = np.sqrt(square)
    x = r - shape[0]
    x = x if x > zero else zero
    x = x if x < shape[1] else shape[1]
    rest = shape[1] * shape[1] - x * x
    arc = shape[1] - np.sqrt(rest if rest > zero else zero)
    side = shape[3] + (r - shape[2]) * shape[4]
    return arc if r < shape[2] else side


@kernel
def _measure(height, i, ja, jb, begin, start, z, slope, length, outline):
    """Return the largest height that a sweep cuts off a row."""
    worst = 0.0
    for j in range(ja, jb):
        along, beside = start[0] + (j - begin) * start[2], start[1] + (j - begin) * start[3]
        t = min(max(along, 0.0), length)
        low = z + slope * t + outline_height(math.sqrt((along - t) ** 2 + beside * beside), outline)
        worst = max(worst, height[i, j] - low)
    return worst


# --- walls -------------------------------------------------------------------------------------------------


@kernel
def draw_walls(grid, path, k, after):
    """Draw the walls that sweep k leaves: both sides, and the round at its end where the next one turns away.

    ``after`` is the number of samples.
    """
    position = path.position_mm
    ax, ay, bx, by = position[k - 1, 0], position[k - 1, 1], position[k, 0], position[k, 1]
    outline = outline_of(path.outlines, path.tool[k])
    radius = outline[_RADIUS]
    floor = min(position[k - 1, 2], position[k, 2]) + outline_height(radius, outline)
    top = highest(
        grid.place,
        grid.height.shape,
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
        return  # straight on, as far as a cell can tell
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


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, inline="always")
def _draw_cell(grid, path, k, row, column, floor, nx, ny):
    """Note the wall of sweep k in a cell, unless nothing stands behind it or a deeper one is there already."""
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
    old_floor = min(position[old - 1, 2], position[old, 2]) + outline_height(outline[_RADIUS], outline)
    if floor < old_floor - FEEL_MM:
        return True
    old_gap = nearest(position, old - 1, old, x, y)[0] - outline[_RADIUS]
    new_gap = nearest(position, k - 1, k, x, y)[0] - outlines[tools[k], _RADIUS]
    return new_gap < old_gap - slack
