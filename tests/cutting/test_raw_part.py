"""The raw part: block, mesh and guess become the same field; the remaining material becomes a closed mesh."""

import io

import numpy as np
import pytest
import trimesh

from gcode2krl import load_cell
from gcode2krl.cell import resolve_cell
from gcode2krl.cutting.guess import guessed_box
from gcode2krl.cutting.raw_part import block, height_field_of, load_mesh, to_mesh
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gcode import read_stream

TOOL = load_cell().tool[1]
PART = (
    "G21 G90\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\nG0 X10 Y20\nG0 Z5\nG1 Z-3 F600\nG1 X60\nG1 Y50\nG0 Z30\nM30\n"
)


@pytest.fixture(scope="module")
def toolpath():
    return read_stream(io.BytesIO(PART.encode()), "part.nc", load_cell())


def test_a_block_is_filled_without_rest():
    field = block(np.array([[-1.0, 2.0, -5.0], [9.3, 7.1, 1.5]]), 0.4)
    assert field.volume_mm3 == pytest.approx(10.3 * 5.1 * 6.5, rel=1e-6)
    assert (field.cell_mm <= 0.4).all()


def test_the_guess_follows_the_feed_moves(toolpath):
    box = guessed_box(toolpath, np.eye(3), 8.0)
    np.testing.assert_allclose(box, [[10 - 8, 20 - 8, -3], [60 + 8, 50 + 8, 0]])


def test_a_guess_is_marked(toolpath):
    assert height_field_of(toolpath, load_cell(), np.eye(3), [TOOL]).guessed
    stated = resolve_cell({"based_on": "demonstration", "stock": {"box_mm": [[0, 0, -10], [80, 60, 0]]}})
    assert not height_field_of(toolpath, stated, np.eye(3), [TOOL]).guessed


@pytest.mark.parametrize("ending", ["stl", "ply", "3mf"])
def test_a_mesh_gives_the_field_of_its_upper_side(toolpath, tmp_path, ending):
    solid = trimesh.creation.icosphere(subdivisions=4, radius=10.0)
    solid.export(tmp_path / f"ball.{ending}")
    cell = resolve_cell({"based_on": "demonstration", "stock": {"mesh": f"ball.{ending}"}}, folder=tmp_path)
    field = height_field_of(toolpath, cell, np.eye(3), [TOOL])
    filled = 2.0 / 3.0 * np.pi * 10.0**3 + np.pi * 10.0**3
    assert field.volume_mm3 == pytest.approx(filled, rel=0.005)


def test_a_turned_set_up_sees_the_block_from_its_side(toolpath):
    cell = resolve_cell({"based_on": "demonstration", "stock": {"box_mm": [[0, 0, -10], [80, 60, 0]]}})
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    field = height_field_of(toolpath, cell, turn, [TOOL])
    assert field.volume_mm3 == pytest.approx(80 * 60 * 10, rel=1e-3)
    assert float(field.height_mm.max()) == pytest.approx(80.0)


def test_what_is_left_is_closed_and_is_the_stock_of_the_next_program(tmp_path):
    field = block(np.array([[0.0, 0.0, -10.0], [20.0, 10.0, 0.0]]), 0.1)
    field.height_mm[25:50, 25:100] = -4.0
    field.height_mm[:15, :15] = -np.inf
    field.height_mm[60:70, 100:120] = -np.inf
    mesh = to_mesh(field)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(field.volume_mm3, rel=0.002)
    mesh.export(tmp_path / "left.stl")
    assert load_mesh(tmp_path / "left.stl").volume == pytest.approx(mesh.volume, rel=1e-5)
    assert len(to_mesh(field, most_cells=1000).faces) < 6000


def open_box():
    box = trimesh.creation.box(extents=(10, 10, 10))
    return trimesh.Trimesh(box.vertices, box.faces[:-2])


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda file: None, "no such file"),
        (lambda file: file.write_bytes(b"not a mesh at all" * 20), "mesh"),
        (lambda file: file.write_bytes(b""), "mesh"),
        (lambda file: open_box().export(file), "not closed"),
        (lambda file: trimesh.creation.box(extents=(0.1, 0.05, 0.02)).export(file), "metres"),
        (lambda file: trimesh.creation.box(extents=(1e5, 10, 10)).export(file), "not in mm"),
    ],
)
def test_a_bad_mesh_gets_one_clear_line(tmp_path, make, word):
    file = tmp_path / "raw.stl"
    make(file)
    with pytest.raises(NotUnderstoodError, match=word) as wrong:
        load_mesh(file)
    assert wrong.value.source == str(file)
    assert wrong.value.issues[0].remedy


def test_a_field_that_is_too_fine_is_refused(toolpath):
    cell = resolve_cell(
        {
            "based_on": "demonstration",
            "stock": {"box_mm": [[0, 0, -10], [800, 600, 0]], "resolution_mm": 0.01},
        }
    )
    with pytest.raises(NotUnderstoodError, match="resolution_mm"):
        height_field_of(toolpath, cell, np.eye(3), [TOOL])
