"""Lower a height field below the sweeps of a cutter: compiled."""

# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False

import math

import numpy as np

from gcode2krl.cutting.kernels import inlined, kernel
from gcode2krl.cutting.sweep import (
    ARC_RADIUS,
    ARC_TOP,
    BALL,
    BLOCK,
    BOTTOM,
    CORNER,
    FLAT,
    KIND,
    LANES,
    RADIUS,
    STEEP,
    cells_between,
    highest,
    outline_height,
    outline_of,
    refresh,
)

_REFRESH = 48  # visits after which the bound of a block is computed again


# each branch is a shape of sweep: rapid or feed, level or inclined, and the kind of cutter
@kernel
def remove_sweep(grid, path, k, index):
    """Lower the field below the sweep that ends at sample k; return the height a rapid has cut off, else 0.

    ``index`` holds 0, 1, 2 ... in single precision, as many as the longest sweep has cells in a row.
    """
    position, height, wall, outline = (
        path.position_mm,
        grid.height,
        grid.wall,
        outline_of(path.outlines, path.tool[k]),
    )
    radius, kind = outline[RADIUS], outline[KIND]
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
    behind = -math.inf  # cells farther back were cut when the cutter was at the start
    if chained and length > 0.0:
        behind = 0.0 if slope >= 0.0 else sink * radius if kind == BALL else -radius
    hollow = chained and length > 0.0 and kind == FLAT and slope >= 0.0  # the whole disc at the start was cut
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
def _visit(height, bound, visits, ja, jb, ia, ib):
    """Count a visit of every block of a range of cells; refresh its bound every `_REFRESH` visits."""
    for i in range(ia // BLOCK, (ib - 1) // BLOCK + 1):
        for j in range(ja // BLOCK, (jb - 1) // BLOCK + 1):
            visits[i, j] += 1
            if visits[i, j] >= _REFRESH:
                refresh(height, bound, i, j)
                visits[i, j] = 0


@kernel
def _chord(y, ex, ey, length, radius):
    """Return where a row enters and leaves the plan of a sweep; left > right where it does not."""
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


# The loops over the cells of a row have no branches and single precision (1 µm at the size of a cutter), and
# run in steps of LANES, so that the compiler takes eight or sixteen cells at once; cells beyond the end get
# inf. Indices are unsigned, or each would be tried for a negative one. Where a cell is lowered, older walls
# end. ``start`` holds along and beside the sweep at the
# cell ``begin``, which may lie outside the grid, and their steps from cell to cell.


@kernel
def _lower_to(height, wall, i, ja, jb, z):
    z, i = np.float32(z), np.uintp(i)
    for j in range(np.uintp(ja), np.uintp(max(ja, jb))):
        wall[i, j] = -1 if z < height[i, j] else wall[i, j]
        height[i, j] = z if z < height[i, j] else height[i, j]


@kernel
def _lower_ramp(height, wall, i, ja, jb, begin, index, start, z, slope, length, radius):
    """Lower cells below a flat cutter that rises or sinks: its height where it reaches or leaves a cell."""
    u, v, du, dv = np.float32(start[0]), np.float32(start[1]), np.float32(start[2]), np.float32(start[3])
    z, rise, length = np.float32(z), np.float32(slope), np.float32(length)
    square, zero = np.float32(radius * radius), np.float32(0.0)
    sign, far = np.float32(-1.0 if slope > 0.0 else 1.0), np.float32(np.inf)
    i, shift, after = np.uintp(i), np.uintp(ja - begin) - np.uintp(ja), np.uintp(jb)
    for block in range(np.uintp(ja), after, LANES):
        for lane in range(LANES):
            j = block + lane
            along, beside = u + index[j + shift] * du, v + index[j + shift] * dv
            rest = square - beside * beside
            reach = np.sqrt(rest if rest > zero else zero)
            t = along + sign * reach
            t = t if t > zero else zero
            low = z + rise * (t if t < length else length)
            low = low if j < after else far
            wall[i, j] = -1 if low < height[i, j] else wall[i, j]
            height[i, j] = low if low < height[i, j] else height[i, j]


@kernel
def _lower_ball(height, wall, i, ja, jb, begin, index, start, z, slope, sink, length, radius):
    """Lower cells below a ball: its lowest point over a cell belongs to the nearest point of its path."""
    u, v, du, dv = np.float32(start[0]), np.float32(start[1]), np.float32(start[2]), np.float32(start[3])
    centre, slope, sink = np.float32(z + radius), np.float32(slope), np.float32(sink)
    length, square, zero, far = (
        np.float32(length),
        np.float32(radius * radius),
        np.float32(0.0),
        np.float32(np.inf),
    )
    i, shift, after = np.uintp(i), np.uintp(ja - begin) - np.uintp(ja), np.uintp(jb)
    for block in range(np.uintp(ja), after, LANES):
        for lane in range(LANES):
            j = block + lane
            along, beside = u + index[j + shift] * du, v + index[j + shift] * dv
            rest = square - beside * beside
            t = along - sink * np.sqrt(rest if rest > zero else zero)
            t = t if t > zero else zero
            t = t if t < length else length
            rest = rest - (along - t) * (along - t)
            low = centre + slope * t - np.sqrt(rest if rest > zero else zero)
            low = low if j < after else far
            wall[i, j] = -1 if low < height[i, j] else wall[i, j]
            height[i, j] = low if low < height[i, j] else height[i, j]


# its branches are minima and maxima, written out so that the loop stays one of plain single-precision numbers
@kernel
def _lower_other(height, wall, i, ja, jb, begin, index, start, z, slope, length, outline):
    """Lower cells below any cutter. Along the sweep the height over a cell is convex: the lowest of both ends
    of the contact, the nearest point in plan, and the lowest point of a parabola."""
    one = np.float32
    u, v, du, dv = one(start[0]), one(start[1]), one(start[2]), one(start[3])
    z, slope, length = one(z), one(slope), one(length)
    square, zero, half, quarter = one(outline[RADIUS] ** 2), one(0.0), one(0.5), one(0.25)
    arc_radius = one(outline[ARC_RADIUS] if outline[STEEP] > 0.0 else np.inf)
    shape = (
        one(outline[BOTTOM]),
        one(outline[CORNER]),
        arc_radius,
        one(outline[ARC_TOP]),
        one(outline[STEEP]),
    )
    tiny, far = one(1e-9), one(np.inf)
    i, shift, after = np.uintp(i), np.uintp(ja - begin) - np.uintp(ja), np.uintp(jb)
    for block in range(np.uintp(ja), after, LANES):
        for lane in range(LANES):
            j = block + lane
            along, beside = u + index[j + shift] * du, v + index[j + shift] * dv
            rest = square - beside * beside
            reach = np.sqrt(rest if rest > zero else zero)
            a, b = along - reach, along + reach
            a = a if a > zero else zero
            b = b if b < length else length
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
            t = along if along > a else a
            t = t if t < b else b
            near = slope * t + _height32(beside + (along - t) * (along - t), shape)
            low = low if low < near else near
            low = low if low < at_a else at_a
            low = low if low < at_b else at_b
            low = z + (low if low < at_middle else at_middle)
            low = low if j < after else far
            wall[i, j] = -1 if low < height[i, j] else wall[i, j]
            height[i, j] = low if low < height[i, j] else height[i, j]


@inlined
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
    """Return the largest height that a sweep cuts off in a row of cells."""
    worst = 0.0
    for j in range(ja, jb):
        along, beside = start[0] + (j - begin) * start[2], start[1] + (j - begin) * start[3]
        t = min(max(along, 0.0), length)
        low = z + slope * t + outline_height(math.sqrt((along - t) ** 2 + beside * beside), outline)
        worst = max(worst, height[i, j] - low)
    return worst
