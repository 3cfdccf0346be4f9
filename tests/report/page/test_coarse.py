"""A mesh to be looked at: few triangles, and none of them far from the mesh."""

import numpy as np
import pytest
import trimesh

from gcode2krl.report.page.content import drawn_mesh


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
