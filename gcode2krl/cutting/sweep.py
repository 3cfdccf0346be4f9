"""The height that one sweep of a cutter leaves at a point, and the grid it is cut out of.

A sweep is the volume that the cutter passes through on the straight line between two samples.
"""

# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cutting.kernels import kernel

LANES = np.uintp(16)
"""Cells that a compiled loop takes at once; a grid has as many spare columns."""
BLOCK = 32
"""Cells along one side of a block with a common bound of its height."""
FEEL_MM = 1e-3
"""Material thinner than this is rounding of the path, not material."""
FLAT, BALL, OTHER = 0.0, 1.0, 2.0
RADIUS, BOTTOM, CORNER, ARC_RADIUS, ARC_TOP, STEEP, KIND = range(7)
"""Columns of `Path.outlines`."""


class Grid(NamedTuple):
    """A height field as the kernels see it; lengths in mm, row = y, column = x."""

    height: NDArray[np.float32]
    """(ny, nx) top of the material over the middle of a cell, -inf = none. The first row and column, the last
    row and the last LANES columns are empty."""
    wall: Ints32
    """(ny, nx) the sweep whose wall runs through a cell, -1 = none."""
    bound: NDArray[np.float32]
    """(ceil(ny/BLOCK), ceil(nx/BLOCK)) no height in the block is above it."""
    visits: Ints32
    place: tuple[float, float, float, float]
    """Low corner x, y of the whole field and size of a cell along x, y in mm."""
    shift: tuple[int, int]
    """First row and column in the whole field: coordinates are rounded as in the whole."""
    bottom_mm: float


class Path(NamedTuple):
    """Points in the order of time, in the frame of the field (z = tool axis)."""

    position_mm: Floats
    """(n, 3) tips."""
    tool: Ints32
    """(n,) row of `outlines`."""
    rapid: Bools
    first: Bools
    """(n,) True where no sweep leads to the sample: the first one, and after a change of tool."""
    outlines: Floats
    """(t, 7) radius, bottom, corner, end of the corner arc (r, z), steepness of the side above it, kind."""
    direction: Floats
    """(n, 3) unit tangents."""
    read: Bools
    """(n,) True where the engagement is read: False at points that only shape the sweep."""


# Small functions take numbers and the few arrays they need: passing a whole `Grid` costs more than the
# function itself.


@kernel
def outline_of(outlines, tool):
    """Return a row of `Path.outlines` as numbers."""
    return (
        outlines[tool, 0],
        outlines[tool, 1],
        outlines[tool, 2],
        outlines[tool, 3],
        outlines[tool, 4],
        outlines[tool, 5],
        outlines[tool, 6],
    )


@kernel
def outline_height(r, outline):
    """Return the height of the cutter's lower outline above the tip at radius r."""
    if r < outline[ARC_RADIUS] or outline[STEEP] == 0.0:
        x = min(max(r - outline[BOTTOM], 0.0), outline[CORNER])
        return outline[CORNER] - math.sqrt(outline[CORNER] ** 2 - x * x)
    return outline[ARC_TOP] + (r - outline[ARC_RADIUS]) * outline[STEEP]


@kernel
def nearest(position, first, last, x, y):
    """Return distance, fraction and height of the nearest point, in plan, between two samples."""
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
    radius = outline[RADIUS]
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
    column, row = (
        math.floor((x - place[0]) / place[2]) - shift[1],
        math.floor((y - place[1]) / place[3]) - shift[0],
    )
    if column < 0 or row < 0 or column >= shape[1] or row >= shape[0]:
        return -1, -1
    return row, column


@kernel
def cells_between(low, high, origin, size, shift, count):
    """Return the first cell and the one after the last whose middles lie between two coordinates."""
    first = math.ceil((low - origin) / size - 0.5) - shift
    after = math.floor((high - origin) / size - 0.5) + 1 - shift
    return max(first, 0), min(after, count)


@kernel
def highest(place, shift, bound, x_low, x_high, y_low, y_high):
    """Return a bound of the height within a rectangle, -inf where it misses the field."""
    ja, jb = cells_between(
        x_low - place[2], x_high + place[2], place[0], place[2], shift[1], bound.shape[1] * BLOCK
    )
    ia, ib = cells_between(
        y_low - place[3], y_high + place[3], place[1], place[3], shift[0], bound.shape[0] * BLOCK
    )
    top = np.float32(-np.inf)
    if ja >= jb or ia >= ib:
        return top
    for i in range(ia // BLOCK, (ib - 1) // BLOCK + 1):
        for j in range(ja // BLOCK, (jb - 1) // BLOCK + 1):
            top = max(top, bound[i, j])
    return top


@kernel
def refresh(height, bound, i, j):
    """Compute the bound of a block again."""
    top = np.float32(-np.inf)
    for row in range(i * BLOCK, min((i + 1) * BLOCK, height.shape[0])):
        for column in range(j * BLOCK, min((j + 1) * BLOCK, height.shape[1])):
            value = height[row, column]
            top = value if value > top else top
    bound[i, j] = top
