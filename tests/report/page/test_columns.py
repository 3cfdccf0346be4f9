"""What a page carries: packed columns and coarse meshes."""

import zlib
from base64 import b64decode

import numpy as np
import pytest
import trimesh

from gcode2krl.report.page.content import drawn_mesh
from gcode2krl.report.page.packing import packed, packed_text


def unpacked(text, described, rows):
    """Return name → values, from the layout that columns.py states."""
    content = zlib.decompress(b64decode(text))
    columns = {}
    for number, one in enumerate(described):
        planes = content[4 * rows * number : 4 * rows * (number + 1)]
        whole, values = 0, []
        for row in range(rows):
            difference = sum(planes[weight * rows + row] << (8 * weight) for weight in range(4))
            whole = (whole + difference) % 2**32
            signed = whole - 2**32 if whole >= 2**31 else whole
            values.append(float("nan") if signed == -(2**31) else signed * one["step"])
        columns[one["name"]] = np.array(values)
    return columns


def test_values_come_back_to_half_a_step():
    rng = np.random.default_rng(1)
    values = rng.normal(0.0, 300.0, 500)
    read = unpacked(*packed({"a": (values, 0.01), "b": (np.arange(500), 1.0)}), 500)
    assert np.abs(read["a"] - values).max() <= 0.005 + 1e-9
    assert read["b"].tolist() == list(range(500))


def test_what_is_not_known_stays_unknown():
    values = np.array([1.0, np.nan, np.nan, -2.5, np.inf, 4.0])
    read = unpacked(*packed({"a": (values, 0.5)}), 6)["a"]
    assert np.isnan(read).tolist() == [False, True, True, False, True, False]
    assert read[[0, 3, 5]].tolist() == [1.0, -2.5, 4.0]


@pytest.mark.parametrize("largest", [1e7, 1e12])
def test_a_step_grows_with_values_that_are_too_large(largest):
    text, described = packed({"a": (np.array([largest, -largest]), 1e-3)})
    read = unpacked(text, described, 2)["a"]
    assert read == pytest.approx([largest, -largest], rel=1e-8)


def test_text_keeps_every_sign():
    assert zlib.decompress(b64decode(packed_text("G1 X1\n(Ø 8)"))).decode("utf-8") == "G1 X1\n(Ø 8)"


def test_a_mesh_with_few_triangles_stays_as_it_is():
    box = trimesh.creation.box((10.0, 20.0, 30.0)).triangles
    assert drawn_mesh(box) is box


@pytest.mark.parametrize("most", [500, 4000])
def test_a_mesh_with_many_keeps_its_shape(most):
    fine = trimesh.creation.torus(60.0, 20.0, major_sections=300, minor_sections=80)
    drawn = drawn_mesh(fine.triangles, most)
    assert most / 4 < len(drawn) <= most
    step = 0.0
    for corner in drawn.reshape(-1, 3)[:: len(drawn) // 100]:  # a corner's distance from a torus, exactly
        step = max(step, abs(np.hypot(np.hypot(corner[0], corner[1]) - 60.0, corner[2]) - 20.0))
    assert step < 160.0 / np.sqrt(most)
    area = np.linalg.norm(np.cross(drawn[:, 1] - drawn[:, 0], drawn[:, 2] - drawn[:, 0]), axis=1).sum() / 2.0
    assert area == pytest.approx(fine.area, rel=0.15)


def test_a_mesh_that_cannot_be_thinned_to_so_few_is_drawn_as_coarse_as_it_can_be():
    fine = trimesh.creation.icosphere(4).triangles
    assert len(drawn_mesh(fine, 1)) < 100
