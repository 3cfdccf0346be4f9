"""The field: strips copied out and back, positions of cells, remaining material."""

import itertools

import numpy as np
import pytest

from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.sweep import LANES


def field(ny=7, nx=11):
    height = np.arange(ny * nx, dtype=np.float32).reshape(ny, nx)
    return HeightField(height, np.array([-1.0, 2.0]), np.array([0.5, 0.25]), -3.0)


def test_volume_counts_what_is_above_the_bottom():
    some = field()
    some.height_mm[0] = -np.inf
    some.height_mm[1] = -5.0
    wanted = (some.height_mm[2:].astype(float) + 3.0).sum() * 0.125
    assert some.volume_mm3 == pytest.approx(wanted)


@pytest.mark.parametrize("axis", [0, 1])
def test_strips_cover_the_field_and_come_back(axis):
    some, kept = field(), field().height_mm
    borders = [-np.inf, some.origin_mm[axis] + 2.3 * some.cell_mm[axis], np.inf]
    for low, high in itertools.pairwise(borders):
        own, wide = some.cells(axis, low, high), some.cells(axis, low - 0.6, high + 0.6)
        grid = some.grid(axis, *wide)
        assert grid.height[0].max() == grid.height[:, 0].max() == -np.inf
        assert grid.height[:, -LANES:].max() == -np.inf
        grid.height[:] += 1.0
        some.take_back(grid, axis, *own, own[0] - wide[0])
    np.testing.assert_array_equal(some.height_mm, kept + 1.0)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_grid_knows_where_it_lies(axis):
    some = field()
    grid = some.grid(axis, 2, 5)
    row, column = (3, 2) if axis == 0 else (2, 3)  # of the field
    assert grid.height[row - grid.row, column - grid.column] == some.height_mm[row, column]
    assert (grid.x_mm, grid.y_mm, grid.dx_mm, grid.dy_mm) == (-1.0, 2.0, 0.5, 0.25)


def test_bounds_are_above_every_height():
    grid = field(40, 70).grid(0, 0, 70)
    assert grid.bound.max() == grid.height.max()
    assert grid.bound[0, 0] == grid.height[:32, :32].max()


def test_cells_outside_are_cut_off():
    assert field().cells(0, -100.0, 100.0) == (0, 11)
    assert field().cells(1, 50.0, 60.0) == (7, 7)


def test_a_copy_is_its_own():
    some = field()
    other = some.copy()
    other.height_mm[:] = 0
    assert some.height_mm[1, 1] == 12.0
