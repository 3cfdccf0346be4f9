"""The field: strips copied out and back, positions of cells, remaining material."""

import itertools

import numpy as np
import pytest
import trimesh

from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.mesh_file import MeshError
from gcode2krl.cutting.raw_part import load_mesh
from gcode2krl.cutting.solids import CRACK_MM, mesh_of, solid_of
from gcode2krl.cutting.sweep import LANES
from gcode2krl.errors import NotUnderstoodError


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


def box(low, high):
    return trimesh.creation.box(bounds=[low, high])


def cracked(mesh, crack_mm, seed=1):
    """Each triangle with corners of its own, moved a little."""
    moved = mesh.triangles + np.random.default_rng(seed).uniform(-0.5, 0.5, mesh.triangles.shape) * crack_mm
    return trimesh.Trimesh(moved.reshape(-1, 3), np.arange(3 * len(moved)).reshape(-1, 3), process=False)


def test_bodies_that_overlap_count_once():
    both = trimesh.util.concatenate([box([0, 0, 0], [10, 10, 10]), box([5, 5, 5], [15, 15, 15])])
    assert both.volume == pytest.approx(2000.0)
    assert solid_of(both).volume() == pytest.approx(2000.0 - 125.0)


def test_bodies_apart_stay_two():
    both = trimesh.util.concatenate([box([0, 0, 0], [1, 1, 1]), box([5, 5, 5], [7, 7, 7])])
    assert len(solid_of(both).decompose()) == 2


def test_a_hollow_stays_hollow():
    inner = box([2, 2, 2], [8, 8, 8])
    inner.invert()
    assert solid_of(trimesh.util.concatenate([box([0, 0, 0], [10, 10, 10]), inner])).volume() == 1000 - 216


def test_inside_out():
    turned = box([0, 0, 0], [10, 10, 10])
    turned.invert()
    assert solid_of(turned).volume() == pytest.approx(1000.0)


@pytest.mark.parametrize("crack_mm", [0.0, 1e-6, 0.5 * CRACK_MM])
def test_cracks_are_closed(crack_mm):
    solid = solid_of(cracked(trimesh.creation.icosphere(subdivisions=3, radius=10.0), crack_mm))
    assert solid.volume() == pytest.approx(
        trimesh.creation.icosphere(subdivisions=3, radius=10.0).volume, rel=1e-3
    )
    assert mesh_of(solid).is_watertight


def test_a_hole_is_refused():
    whole = box([0, 0, 0], [10, 10, 10])
    with pytest.raises(MeshError, match="not closed"):
        solid_of(trimesh.Trimesh(whole.vertices, whole.faces[1:], process=False))


def test_a_stock_with_cracks_is_read_and_one_with_a_hole_is_not(tmp_path):
    whole = box([0, 0, 0], [30, 20, 10])
    cracked(whole, 2e-4).export(tmp_path / "cracked.stl")
    assert load_mesh(tmp_path / "cracked.stl").volume == pytest.approx(6000.0, rel=1e-3)
    trimesh.Trimesh(whole.vertices, whole.faces[1:], process=False).export(tmp_path / "open.stl")
    with pytest.raises(NotUnderstoodError, match="not closed"):
        load_mesh(tmp_path / "open.stl")
