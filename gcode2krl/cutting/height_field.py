"""The material as a height field: one height per cell of a grid normal to the tool axis.

A field belongs to one direction of the tool, its z; 3+2 machining has one field per set-up. Everything below
the highest surface counts as solid down to one flat bottom, so undercuts are filled.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats
from gcode2krl.compiled.core import core_function
from gcode2krl.cutting.sweep import BLOCK, GRID, LANES, Grid

CELLS_PER_DIAMETER = 100.0
"""Default resolution: 0.16 mm for a cutter of 16 mm. `benchmarks/force_accuracy.py` prints what it costs."""
MAX_CELLS = 16_000_000
"""Default limit of a field: 128 MB, and as much again while it is cut."""
MESH_CELLS = 250_000
"""Default limit of the cells of a mesh that is made from a field."""

_bound = core_function("cutting_bound", GRID)


@dataclass(frozen=True, eq=False)
class HeightField:
    """Material over a rectangle in the plane normal to the tool axis; row = y, column = x.

    ``height_mm`` (ny, nx) float32, top of the material over the middle of each cell, -inf where there is
    none; ``origin_mm`` (2,) the low corner; ``cell_mm`` (2,) size of a cell along x and y. It changes while
    it is cut.
    """

    height_mm: NDArray[np.float32]
    origin_mm: Floats
    cell_mm: Floats
    bottom_mm: float
    guessed: bool = False

    @property
    def volume_mm3(self) -> float:
        """Volume of the material."""
        thickness = np.maximum(self.height_mm.astype(np.float64) - self.bottom_mm, 0.0)
        return float(thickness.sum() * self.cell_mm.prod())

    def copy(self) -> "HeightField":
        """Return a field that can be cut without changing this one."""
        return HeightField(self.height_mm.copy(), self.origin_mm, self.cell_mm, self.bottom_mm, self.guessed)

    def cells(self, axis: int, low_mm: float, high_mm: float) -> tuple[int, int]:
        """Return the first column (axis 0) or row (axis 1) between coordinates and the one after the last."""
        count, origin, size = self.height_mm.shape[1 - axis], self.origin_mm[axis], self.cell_mm[axis]
        low, high = (np.clip((at - origin) / size, 0.0, float(count)) for at in (low_mm, high_mm))
        return int(low), int(high)

    def grid(self, axis: int, first: int, after: int) -> Grid:
        """Return a copy of some columns (axis 0) or rows (axis 1) as the core takes it."""
        part = self.height_mm[:, first:after] if axis == 0 else self.height_mm[first:after]
        height = np.full((part.shape[0] + 2, part.shape[1] + 1 + LANES), -np.inf, np.float32)
        height[1:-1, 1 : part.shape[1] + 1] = part
        row, column = (-1, first - 1) if axis == 0 else (first - 1, -1)  # one empty cell all around
        blocks = -(-height.shape[0] // BLOCK), -(-height.shape[1] // BLOCK)
        grid = Grid(
            height=height,
            wall=np.full(height.shape, -1, np.int32),
            bound=np.empty(blocks, np.float32),
            visits=np.zeros(blocks, np.int32),
            counted=np.zeros(2, np.int64),
            x_mm=float(self.origin_mm[0]),
            y_mm=float(self.origin_mm[1]),
            dx_mm=float(self.cell_mm[0]),
            dy_mm=float(self.cell_mm[1]),
            row=row,
            column=column,
            bottom_mm=self.bottom_mm,
        )
        _bound(grid)
        return grid

    def take_back(self, grid: Grid, axis: int, first: int, after: int, skip: int) -> None:
        """Copy columns or rows back from a grid that begins ``skip`` cells before ``first``."""
        inner = slice(skip + 1, skip + 1 + after - first)
        if axis == 0:
            self.height_mm[:, first:after] = grid.height[1 : 1 + self.height_mm.shape[0], inner]
        else:
            self.height_mm[first:after] = grid.height[inner, 1 : 1 + self.height_mm.shape[1]]
