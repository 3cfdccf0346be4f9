"""Gouges and rest against scenes whose difference is known by hand."""

import numpy as np
import pytest
import trimesh

from gcode2krl import load_cell, plan_motion, read_gcode
from gcode2krl.cell import resolve_cell
from gcode2krl.cutting import remove
from gcode2krl.cutting.mesh_file import MeshError
from gcode2krl.cutting.nominal import MOST_SOLIDS, TOLERANCE_MM, compare

CELL = {"based_on": "demonstration", "stock": {"box_mm": [[0, 0, -20], [60, 40, 0]]}}
SLOT = "G21 G90\nT1 M6\nG0 G43 H1 Z20\nS8000 M3\nG0 X-20 Y20\nG0 Z-4\nG1 X80 F1200\nG0 Z20\nM5\nM30\n"
"""A slot 16 mm wide and 4 mm deep along x, from y = 12 to 28."""


@pytest.fixture(scope="module")
def slot(tmp_path_factory):
    part = tmp_path_factory.mktemp("slot") / "slot.nc"
    part.write_text(SLOT, encoding="ascii")
    cell = resolve_cell(CELL)
    toolpath = read_gcode(part, cell)
    motion = plan_motion(toolpath, cell)
    return remove(toolpath, motion, cell), motion


def nominal(*pockets):
    """The block without some boxes."""
    block = trimesh.creation.box(bounds=[[0, 0, -20], [60, 40, 0]])
    for low, high in pockets:
        block = block.difference(trimesh.creation.box(bounds=[low, high]), engine="manifold")
    return block


def test_a_part_as_it_should_be_has_no_difference(slot):
    found = compare(*slot, nominal(([-1, 12, -4], [61, 28, 1])))
    assert found.differences == ()
    assert found.volume_mm3 == {"gouge": 0.0, "rest": 0.0}


def test_a_slot_that_is_too_deep_is_a_gouge(slot):
    """1.5 mm deeper than wanted over 60 x 16 mm."""
    (one,) = compare(*slot, nominal(([-1, 12, -2.5], [61, 28, 1]))).differences
    assert one.kind == "gouge"
    assert one.depth_mm == pytest.approx(1.5, abs=0.01)
    assert one.volume_mm3 == pytest.approx(1.5 * 60 * 16, rel=0.03)
    assert one.solid.is_watertight
    assert one.solid.volume == pytest.approx(one.volume_mm3, rel=0.02)
    assert one.solid.bounds[:, 2] == pytest.approx([-4.0, -2.5], abs=0.02)
    assert one.place_mm[2] == pytest.approx(-4.0, abs=0.01)
    _, motion = slot
    assert np.linalg.norm(motion.position_mm[one.row] - one.place_mm) < 9.0


def test_what_is_not_cut_is_rest(slot):
    """A pocket of 20 x 6 x 3 mm beside the slot that nobody cut."""
    (one,) = compare(*slot, nominal(([-1, 12, -4], [61, 28, 1]), ([20, 32, -3], [40, 38, 1]))).differences
    assert one.kind == "rest"
    assert one.depth_mm == pytest.approx(3.0, abs=0.01)
    assert one.volume_mm3 == pytest.approx(3.0 * 20 * 6, rel=0.07)
    assert one.solid.volume == pytest.approx(one.volume_mm3, rel=0.05)
    assert 20 <= one.place_mm[0] <= 40
    assert 32 <= one.place_mm[1] <= 38


@pytest.mark.slow
def test_a_wall_beside_a_gouge_is_not_part_of_its_depth(slot):
    """Cells of 0.16 mm do not end where the slot does: half of a wall's height would be taken for a gouge."""
    for shift in (0.0, 0.04, 0.08, 0.12):
        found = compare(*slot, nominal(([-1, 12 + shift, -3.2], [61, 28 + shift, 1])))
        assert [one.kind for one in found.differences] == ["gouge"]
        assert found.differences[0].depth_mm == pytest.approx(0.8, abs=0.01)
        assert found.volume_mm3["gouge"] == pytest.approx(0.8 * 60 * 16, rel=0.03)


def test_less_than_the_tolerance_is_none(slot):
    near = 0.9 * TOLERANCE_MM
    assert compare(*slot, nominal(([-1, 12, -4 + near], [61, 28, 1]))).differences == ()
    assert len(compare(*slot, nominal(([-1, 12, -4 + 2 * near], [61, 28, 1]))).differences) == 1


def test_a_wall_that_is_off_by_less_than_a_cell_is_none(slot):
    """A cell is 0.16 mm."""
    assert compare(*slot, nominal(([-1, 12.1, -4], [61, 27.9, 1]))).differences == ()
    kinds = {one.kind for one in compare(*slot, nominal(([-1, 13, -4], [61, 27, 1]))).differences}
    assert kinds == {"gouge"}


def test_a_slanted_surface_is_judged_along_the_tool(slot):
    """The nominal slot falls from -3 to -5 mm along x: a gouge first, rest later."""
    wedge = trimesh.Trimesh(
        [[x, y, z] for x, low in ((-1, -3 + 2 / 60), (61, -5 - 2 / 60)) for y in (12, 28) for z in (low, 1)],
        process=False,
    ).convex_hull
    block = nominal().difference(wedge, engine="manifold")
    gouge, rest = compare(*slot, block).differences
    assert (gouge.kind, rest.kind) == ("gouge", "rest")
    assert gouge.depth_mm == pytest.approx(1.0, abs=0.03)
    assert rest.depth_mm == pytest.approx(1.0, abs=0.03)
    assert gouge.volume_mm3 == pytest.approx(0.5 * 1.0 * 30 * 16, rel=0.05)
    assert gouge.place_mm[0] < 5 < 55 < rest.place_mm[0]


def test_the_smallest_of_many_are_counted(slot):
    holes = [([2 * k + 1, 32, -3], [2 * k + 2, 33, 1]) for k in range(MOST_SOLIDS + 5)]
    found = compare(*slot, nominal(([-1, 12, -4], [61, 28, 1]), *holes))
    assert len(found.differences) == MOST_SOLIDS
    assert found.left_out == {"gouge": 0, "rest": 5}
    assert found.volume_mm3["rest"] > sum(one.volume_mm3 for one in found.differences)


def test_a_tilted_set_up_is_compared_in_its_own_frame(slot):
    """The same scene turned about y by 90°: places and solids come back in $BASE."""
    from dataclasses import replace

    removal, motion = slot
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    turned = replace(removal, to_field=turn)
    block = nominal(([-1, 12, -2.5], [61, 28, 1]))
    matrix = np.eye(4)
    matrix[:3, :3] = turn.T
    (one,) = compare(turned, motion, block.apply_transform(matrix)).differences
    assert one.place_mm[0] == pytest.approx(4.0, abs=0.01)
    assert one.solid.bounds[:, 0] == pytest.approx([2.5, 4.0], abs=0.02)


def test_an_open_mesh_is_refused(slot):
    block = nominal()
    with pytest.raises(MeshError):
        compare(*slot, trimesh.Trimesh(block.vertices, block.faces[1:], process=False))


def test_the_demonstration_cell_has_no_stock():
    """Else the scenes above would not be what they say."""
    assert load_cell().stock is None
