"""Meshes as they come from CAD and scanners become solids of the right volume, or are refused."""

import numpy as np
import pytest
import trimesh

from gcode2krl.cutting.mesh_file import MeshError
from gcode2krl.cutting.raw_part import load_mesh
from gcode2krl.cutting.solids import CRACK_MM, mesh_of, solid_of
from gcode2krl.errors import NotUnderstoodError


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
