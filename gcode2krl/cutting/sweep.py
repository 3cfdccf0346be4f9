"""What a cutter is cut out of: the grid of heights and the path, as the compiled core sees them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.compiled.core import (
    StructOf,
)

LANES = 16
"""Cells that a compiled loop takes at once; a grid has as many spare columns."""
BLOCK = 32
"""Cells along one side of a block with a common bound of its height."""
FLAT, BALL, OTHER = range(3)
"""Kinds of cutter in `Path.outlines`."""


class Grid(NamedTuple):
    """A height field that is cut; lengths in mm, row = y, column = x."""

    height: NDArray[np.float32]
    """(ny, nx) top of the material over the middle of a cell, -inf = none. The first row and column, the last
    row and the last LANES columns are empty."""
    wall: Ints32
    """(ny, nx) the sweep whose wall runs through a cell, -1 = none."""
    bound: NDArray[np.float32]
    """(ceil(ny/BLOCK), ceil(nx/BLOCK)) no height in the block is above it."""
    visits: Ints32
    counted: Ints
    """(2,) cells that sweeps have looked at and that they have lowered; only the checked build counts."""
    x_mm: float
    y_mm: float
    """Low corner of the whole field, x and y."""
    dx_mm: float
    dy_mm: float
    """Size of a cell along x and y."""
    row: int
    column: int
    """First row and column in the whole field: coordinates are rounded as in the whole."""
    bottom_mm: float


class Path(NamedTuple):
    """Points between which the tip moves straight, in the frame of the field (z = tool axis)."""

    position_mm: Floats
    """(p, 3) tips."""
    way_mm: Floats
    """(p,) along the path."""
    tool: Ints32
    """(p,) row of `outlines`."""
    rapid: Bools
    first: Bools
    """(p,) True where no sweep leads to the point: the first one, and after a change of tool."""
    outlines: Floats
    """(t, 7) radius, bottom, corner, end of the corner arc (r, z), steepness of the side above it, kind."""


class Samples(NamedTuple):
    """Places on the path at which the engagement is wanted, in the order of time."""

    position_mm: Floats
    """(n, 3) tips."""
    direction: Floats
    """(n, 3) unit tangents; zero where the tool stands."""
    way_mm: Floats
    f_z_mm: Floats
    """(n,) feed per tooth."""
    tool: Ints32
    point: Ints
    """(n,) the last point of the path that is not after the sample."""
    node: Bools
    """(n,) True where the engagement is read in any case."""


GRID = StructOf.record(Grid, written=("height", "wall", "bound", "visits", "counted"))
PATH = StructOf.record(Path)
SAMPLES = StructOf.record(Samples)
