"""Material along a ring of the cutter, before the sweep that is about to cut it: compiled.

A ring is the circle on which a point of the edge turns; it is read in bins. Loops over bins have no branches
and unsigned indices (signed ones would be tried for negative), so that the compiler takes eight bins at once.
"""

# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False

import math

import numpy as np

from gcode2krl.cutting.kernels import kernel
from gcode2krl.cutting.sweep import FEEL_MM, cell_at, outline_of, sweep_height
from gcode2krl.cutting.walls import beside_wall


@kernel
def tops_on_ring(place, shift, height, wall, x, y, r, first, after, east, north, tops):
    """Write the height of the cells on a ring; return whether a wall runs through one of them."""
    ax, ay, rx, ry = (x - place[0]) / place[2], (y - place[1]) / place[3], r / place[2], r / place[3]
    nx, ny, walls = height.shape[1] - 0.5, height.shape[0] - 0.5, 0
    column_0, row_0 = float(shift[1]), float(shift[0])
    for j in range(np.uintp(first), np.uintp(after)):
        u, v = ax + rx * east[j] - column_0, ay + ry * north[j] - row_0
        u, v = (u if u > 0.5 else 0.5), (v if v > 0.5 else 0.5)  # the cells at the border are empty
        column, row = np.uintp(u if u < nx else nx), np.uintp(v if v < ny else ny)
        walls |= wall[row, column] >= 0
        tops[j] = height[row, column]
    return walls != 0


@kernel
def correct_at_walls(grid, path, x, y, r, level, first, after, east, north, tops, above):
    """Replace the tops of cells with a wall, and what is above a level, by those of the point's side."""
    place, shift, height, wall, position = grid.place, grid.shift, grid.height, grid.wall, path.position_mm
    for j in range(first, after):
        qx, qy = x + r * east[j], y + r * north[j]
        row, column = cell_at(place, shift, height.shape, qx, qy)
        if row >= 0 and wall[row, column] >= 0:
            sweep = np.int64(wall[row, column])
            outline = outline_of(path.outlines, path.tool[sweep])
            tops[j] = beside_wall(place, shift, height, position, outline, sweep, row, column, qx, qy)
            above[j] = tops[j] - level


@kernel
def take_off_recent(position, outline, x, y, r, level, first, after, past, east, north, tops, above):
    """Lower tops, and what is above a level, by the sweeps that the field does not show yet."""
    for sweep in range(past[0]):
        start, end = past[1][sweep, 0], past[1][sweep, 1]
        for j in range(first, after):
            qx, qy = x + r * east[j], y + r * north[j]
            cut = sweep_height(position, start, end, outline, qx, qy, 0.0)
            tops[j] = min(tops[j], cut)
            above[j] = min(above[j], cut - level)


@kernel
def stand_above_cutter(place, outline, x, y, z, r, level, first, after, east, north, tops, above):
    """Write how far the tops stand above the cutter's surface.

    A cell's height is that of its middle, so it is compared with the cutter's surface there. This is also
    better for a layer so thin that it is parallel to the cutter.
    """
    ax, ay, rx, ry = (x - place[0]) / place[2], (y - place[1]) / place[3], r / place[2], r / place[3]
    dx, dy, radius, bottom, corner = place[2], place[3], outline[0], outline[1], outline[2]
    arc_radius, arc_top, steep = (outline[3] if outline[5] > 0.0 else math.inf), outline[4], outline[5]
    for j in range(np.uintp(first), np.uintp(after)):
        u = (np.floor(ax + rx * east[j]) + 0.5 - ax) * dx
        v = (np.floor(ay + ry * north[j]) + 0.5 - ay) * dy
        s = math.sqrt(u * u + v * v)
        s = s if s < radius else radius
        w = s - bottom
        w = w if w > 0.0 else 0.0
        w = w if w < corner else corner
        surface = corner - math.sqrt(corner * corner - w * w)
        surface = surface if s < arc_radius else arc_top + (s - arc_radius) * steep
        own, plain = tops[j] - z - surface, tops[j] - level
        above[j] = own if (own <= FEEL_MM) | (own < 2.0 * abs(own - plain)) else plain
