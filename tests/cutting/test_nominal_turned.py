"""Gouges and rest of a part that was cut with a turning axis, against booleans of exact solids."""

import manifold3d
import numpy as np
import pytest
import trimesh

from gcode2krl import plan_motion, read_gcode
from gcode2krl.cell import resolve_cell
from gcode2krl.cli.nominal import _nearest_on
from gcode2krl.cutting import remove
from gcode2krl.cutting.dexels import Dexels, dexel_block
from gcode2krl.cutting.nominal import TOLERANCE_MM
from gcode2krl.cutting.nominal_turned import compare_turned
from gcode2krl.cutting.solids import mesh_of, solid_of

BOX = [[0.0, 0.0, -20.0], [60.0, 40.0, 0.0]]
RADIUS_MM, TOP_MM, TILT_DEG, GOUGE_MM = 5.0, 40.0, 20.0, 0.5
CELL = {
    "based_on": "demonstration",
    "stock": {"box_mm": BOX},
    "machine": {"kind": "table-table", "axes": ["A", "C"], "signs": [1, 1], "tcpm": True},
    "tool": {"1": {"diameter_mm": 10, "teeth": 2, "length_mm": 120, "flute_length_mm": 40}},
}
AXIS = np.array([0.0, np.sin(np.radians(TILT_DEG)), np.cos(np.radians(TILT_DEG))])
ASIDE = np.array([0.0, np.cos(np.radians(TILT_DEG)), -np.sin(np.radians(TILT_DEG))])
TILTED, ASTRAY = np.array([0.0, 12.0, -12.0]), np.array([0.0, 12.0, -12.0]) + GOUGE_MM * ASIDE


def at(x_mm, place):
    return np.array([x_mm, *place[1:]])


def words(x_mm, place):
    return "X{:.4f} Y{:.4f} Z{:.4f}".format(*at(x_mm, place))


def program(angle_deg):
    """A slot under a tool that leans, once more `GOUGE_MM` aside from x = 20 to 40, and an upright one."""
    away = TILTED + 60.0 * AXIS
    return "\n".join(
        [
            "G21 G90 G94",
            "T1 M6",
            f"G0 G43 H1 X-20 Y12 Z60 A{angle_deg} C0",
            "S8000 M3",
            f"G0 {words(-20.0, TILTED)}",
            f"G1 {words(80.0, TILTED)} F1200",
            f"G1 {words(40.0, TILTED)}",
            f"G1 {words(40.0, ASTRAY)} F300",
            f"G1 {words(20.0, ASTRAY)}",
            f"G1 {words(20.0, TILTED)}",
            f"G0 {words(20.0, away)}",
            "G0 Z80 A0",
            "G0 X-20 Y32",
            "G0 Z-4",
            "G1 X80 F1200",
            "G0 Z80",
            "M5",
            "M30",
            "",
        ]
    )


def swept(begin, end, axis):
    """The cylinder of a flat mill from one place to another."""
    cylinder = trimesh.creation.cylinder(RADIUS_MM, TOP_MM, sections=720)
    cylinder.apply_translation([0.0, 0.0, TOP_MM / 2.0])
    cylinder.apply_transform(trimesh.geometry.align_vectors([0.0, 0.0, 1.0], axis))
    points = [cylinder.vertices + np.asarray(place) for place in (begin, end)]
    return manifold3d.Manifold.hull_points(np.concatenate(points))


def block(low=BOX[0], high=BOX[1]):
    return solid_of(trimesh.creation.box(bounds=[low, high]))


def wanted():
    """The part without the move that goes astray."""
    upright = swept([-20.0, 32.0, -4.0], [80.0, 32.0, -4.0], [0.0, 0.0, 1.0])
    return block() - swept(at(-20.0, TILTED), at(80.0, TILTED), AXIS) - upright


def astray():
    """What that move takes."""
    along = swept(at(20.0, ASTRAY), at(40.0, ASTRAY), AXIS)
    return wanted() ^ along


@pytest.fixture(scope="module")
def cut(tmp_path_factory):
    part = tmp_path_factory.mktemp("tilted") / "tilted.nc"
    cell = resolve_cell(CELL)
    for angle_deg in (TILT_DEG, -TILT_DEG):
        part.write_text(program(angle_deg), encoding="ascii")
        toolpath = read_gcode(part, cell)
        if toolpath.axis[5] @ AXIS > 0.999:
            break
    motion = plan_motion(toolpath, cell)
    left = remove(toolpath, motion, cell, is_checked=False).material
    assert isinstance(left, Dexels)
    return left, motion, cell, toolpath


def compared(cut, nominal):
    left, motion, cell, _ = cut
    return compare_turned(left, motion, cell, mesh_of(nominal), _nearest_on)


def of_kind(found, kind):
    return [one for one in found.differences if one.kind == kind]


def test_a_move_that_goes_astray_is_one_gouge_and_nothing_else(cut):
    found = compared(cut, wanted())
    (one,) = found.differences
    assert one.kind == "gouge"
    assert one.depth_mm == pytest.approx(GOUGE_MM, abs=0.02)
    assert one.volume_mm3 == pytest.approx(astray().volume(), rel=0.05)
    assert one.solid.is_watertight
    assert one.solid.volume == pytest.approx(astray().volume(), rel=0.1)
    toolpath, motion = cut[3], cut[1]
    assert toolpath.source_line[motion.move[one.row]] in (8, 9, 10)
    off = one.place_mm - ASTRAY
    assert off @ ASIDE == pytest.approx(RADIUS_MM, abs=0.05)
    assert 15.0 <= one.place_mm[0] <= 45.0
    assert found.above_mm.min() == pytest.approx(-GOUGE_MM, abs=0.02)
    assert np.abs((found.at_mm - ASTRAY) @ ASIDE - RADIUS_MM).max() < GOUGE_MM


def test_a_face_that_stands_proud_is_rest(cut):
    """The nominal part is .3 mm narrower on one side."""
    (one,) = of_kind(compared(cut, wanted() - astray() - block([-1, 39.7, -21], [61, 41, 1])), "rest")
    assert one.depth_mm == pytest.approx(0.3, abs=0.01)
    assert one.volume_mm3 == pytest.approx(0.3 * 60.0 * 20.0, rel=0.02)
    assert one.solid.bounds[:, 1] == pytest.approx([39.7, 40.0], abs=0.02)
    assert one.place_mm[1] == pytest.approx(40.0, abs=1e-3)


def test_an_undercut_that_is_not_wanted_is_a_gouge(cut):
    upright = swept([-20.0, 32.0, -4.0], [80.0, 32.0, -4.0], [0.0, 0.0, 1.0])
    nominal = block() - upright
    found = compared(cut, nominal)
    (one,) = found.differences
    true = nominal - (wanted() - astray())
    assert one.kind == "gouge"
    assert one.volume_mm3 == pytest.approx(true.volume(), rel=0.02)
    corners = mesh_of(true).subdivide_to_size(1.0).vertices
    away_mm = np.linalg.norm(corners - _nearest_on(mesh_of(nominal), corners), axis=1)
    assert one.depth_mm == pytest.approx(away_mm.max(), abs=0.2)


def test_a_pocket_under_an_overhang_that_is_not_cut_is_rest(cut):
    """A hole along x in the leaning wall, which no height would show."""
    hole = block([-1.0, 22.0, -16.0], [61.0, 25.0, -13.0])
    (one,) = of_kind(compared(cut, wanted() - astray() - hole), "rest")
    assert one.volume_mm3 == pytest.approx(60.0 * 9.0, rel=0.1)
    assert one.depth_mm == pytest.approx(1.5, abs=0.2)


def test_a_missing_rib_is_a_gouge(cut):
    """The nominal part has a rib in the slot, of which nothing is left."""
    rib = block([10.0, 30.0, -4.0], [50.0, 31.0, -1.0])
    (one,) = of_kind(compared(cut, (wanted() - astray()) + rib), "gouge")
    assert one.volume_mm3 == pytest.approx(40.0 * 3.0, rel=0.15)
    assert one.depth_mm == pytest.approx(0.5, abs=0.05)


def test_less_than_the_tolerance_is_none(cut):
    near = 0.9 * TOLERANCE_MM
    for change_mm, count in ((near, 0), (2.0 * near, 1)):
        nominal = wanted() - astray() - block([-1, 40.0 - change_mm, -21], [61, 41, 1])
        assert len(compared(cut, nominal).differences) == count


@pytest.mark.parametrize("cells", [(8, 8, 8), (9, 10, 11), (5, 4, 7)])
def test_a_block_has_one_stretch_on_each_ray_of_its_fields(cells):
    """Rays lie in blocks of 4 x 4, which reach beyond a field whose cells are no multiple of that."""
    size_mm = np.array(cells, dtype=float)
    block = dexel_block(np.array([[0.0, 0.0, 0.0], size_mm]), 1.0)
    ray, ends_mm = block.stretches()
    axis, row, column = block.places(ray)
    assert len(ray) == cells[0] * cells[1] + cells[1] * cells[2] + cells[2] * cells[0]
    for k in range(3):
        mine = axis == k
        np.testing.assert_allclose(ends_mm[mine], [[0.0, size_mm[k]]] * mine.sum())
        assert row[mine].max() == cells[(k + 2) % 3] - 1
        assert column[mine].max() == cells[(k + 1) % 3] - 1
    assert block.volume_mm3 == pytest.approx(np.prod(size_mm))
