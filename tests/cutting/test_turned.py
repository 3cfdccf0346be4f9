"""Dexels: against the height field where the axis is constant, against themselves turned, against solids."""

from itertools import pairwise

import numpy as np
import pytest

from gcode2krl.cutting.cutter import shape_of
from gcode2krl.cutting.dexels import dexel_block, dexel_mesh
from gcode2krl.cutting.engagement import engage
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.records import taken
from gcode2krl.cutting.turned import TurnedEngagement
from tests.cutting import scenes, turning_scenes

FLAT, BALL, BULL, TAPERED = turning_scenes.TOOLS
UP = np.array([0.0, 0.0, 1.0])
SLOT = [[-10.0, 20.0, -4.0], [30.0, 20.4, -4.0]]
BOX = np.array([[0.0, 0.0, -10.0], [40.0, 40.0, 0.0]])


def case(tool, corners=SLOT, axes=None):
    return turning_scenes.Case("", tool, *turning_scenes.along(corners, axes or [UP] * len(corners)))


def cut(one, box=BOX, points=None):
    dexels = dexel_block(box, one.tool.diameter_mm / 40.0)
    engagement = TurnedEngagement(dexels, [one.tool], scenes.LAW)
    engaged, area = engagement.contacts(points or turning_scenes.points_of(one), ends=True)
    return engaged.result, area, engagement.dexels


def of_height_field(one, box=BOX):
    size = (box[1] - box[0])[:2] / 250
    field = HeightField(np.full((250, 250), box[1, 2], np.float32), box[0, :2].copy(), size, box[0, 2])
    rows, none = len(one.tip), np.zeros(len(one.tip), np.int32)
    direction = turning_scenes.points_of(one).feed_mm / turning_scenes.F_Z_MM
    force_N = np.full(rows, turning_scenes.F_Z_MM)
    found = engage(field, one.tip, none, none.astype(bool), force_N, [one.tool], scenes.LAW, 1, direction)
    return found, field


@pytest.mark.parametrize("tool", [FLAT, BALL, BULL, TAPERED], ids=lambda tool: tool.kind)
def test_an_upright_tool_cuts_as_in_a_height_field(tool):
    one = case(tool)
    found, _, left = cut(one)
    wanted, field = of_height_field(one)
    own, other = (np.linalg.norm(each.force_N, axis=1) for each in (found, wanted))
    assert own.sum() == pytest.approx(other.sum(), rel=0.02)
    moment, other_moment = (np.linalg.norm(each.moment_Nmm, axis=1).sum() for each in (found, wanted))
    assert moment == pytest.approx(other_moment, rel=0.03)
    removed = np.prod(BOX[1] - BOX[0]) - np.array([left.volume_mm3, field.volume_mm3])
    assert removed[0] == pytest.approx(removed[1], rel=0.005)


def test_a_lying_tool_cuts_as_an_upright_one():
    """The same slot, everything turned by a quarter about x: cut from the side, where no height field is."""
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    one = case(BULL)
    lying = turning_scenes.Case("", BULL, one.tip @ turn.T, one.axis @ turn.T)
    found, area, _ = cut(one)
    corners = BOX @ turn.T
    other, other_area, _ = cut(lying, np.array([corners.min(axis=0), corners.max(axis=0)]))
    assert other_area.sum() == pytest.approx(area.sum(), rel=0.01)
    off = np.linalg.norm(other.force_N - found.force_N @ turn.T, axis=1)
    assert off.max() < 0.08 * np.linalg.norm(found.force_N, axis=1).max()
    assert np.sqrt((off**2).mean()) < 0.02 * np.linalg.norm(found.force_N, axis=1).max()


@pytest.mark.parametrize("tool", [FLAT, BALL, TAPERED], ids=lambda tool: tool.kind)
def test_volume_and_contact_of_a_blend(tool):
    """The axis turns from lead to tilt on the way: against hulls, and places that no pose has been at."""
    axes = [turning_scenes.tilted(12.0, -6.0), turning_scenes.tilted(-5.0, 14.0)]
    one = case(tool, [[-14.0, 20.0, -3.0], [50.0, 24.0, -3.0]], axes)
    _, area, left = cut(one, turning_scenes.STOCK)
    removed = np.prod(turning_scenes.STOCK[1] - turning_scenes.STOCK[0]) - left.volume_mm3
    assert removed == pytest.approx(turning_scenes.exact_volume(one, every=6), rel=0.005)
    rows = [90, 150]
    wanted = [turning_scenes.exact_contact(one, row, fine=3) for row in rows]
    assert area[rows].sum() == pytest.approx(sum(wanted), rel=0.05)


@pytest.mark.parametrize("tool", [FLAT, BALL, BULL, TAPERED], ids=lambda tool: tool.kind)
def test_a_second_time_cuts_nothing(tool):
    """But for what steps leave beside the way of a turning axis, 3 % of a cell."""
    one = case(tool, axes=[turning_scenes.tilted(8.0, 5.0), turning_scenes.tilted(3.0, -9.0)])
    _, area, left = cut(one)
    again = TurnedEngagement(left, [tool], scenes.LAW)
    assert again.contacts(turning_scenes.points_of(one), ends=True)[1].max() < 0.015 * area.max()


def test_a_way_back_cuts_as_the_way_there():
    """A plunge and its retract are no single step: what is removed is the hole."""
    way = case(FLAT, [[20.0, 20.0, 3.0], [20.0, 20.0, -6.0], [20.0, 20.0, 3.0]])
    engaged, _, left = cut(way)
    removed = np.prod(BOX[1] - BOX[0]) - left.volume_mm3
    assert removed == pytest.approx(np.pi * shape_of(FLAT).radius_mm ** 2 * 6.0, rel=0.005)
    assert not engaged.force_N[len(way.tip) // 2 + 1 :].any()


def test_material_ends_at_the_box():
    """Beside an edge of the stock the planes of its two faces go on; the nearer one counts."""
    dexels = dexel_block(BOX, 0.5)
    places = np.array([[0.5, 20.0, 0.5], [-0.2, 20.0, -0.3], [0.2, 20.0, -0.7], [40.3, 40.1, -1.0]])
    np.testing.assert_allclose(dexels.depths(places), [-0.5, -0.2, 0.2, -0.3], atol=1e-6)


def test_how_many_points_come_at_a_time_changes_nothing():
    one = case(BULL, [*SLOT, [30.0, 30.0, -4.0]], [UP, turning_scenes.tilted(9.0, 4.0), UP])
    points = turning_scenes.points_of(one)
    whole, _, left = cut(one)
    engagement = TurnedEngagement(dexel_block(BOX, BULL.diameter_mm / 40.0), [BULL], scenes.LAW)
    borders = [0, 1, 40, 47, 120, len(one.tip)]
    parts = [
        engagement.take(taken(points, slice(a, b)), b == len(one.tip)).result.force_N
        for a, b in pairwise(borders)
    ]
    np.testing.assert_array_equal(np.concatenate(parts), whole.force_N)
    for name in ("ends", "rays"):
        np.testing.assert_array_equal(getattr(engagement.dexels, name), getattr(left, name))


def test_a_tool_that_turns_about_its_tip_cuts():
    """Its tip stands; the edge above moves into the wall, and takes force there."""
    tip = np.repeat([[20.0, -6.0, -8.0]], 60, axis=0)
    angle = np.radians(np.linspace(0.0, 25.0, 60))
    axis = np.stack([0.0 * angle, np.sin(angle), np.cos(angle)], axis=1)
    one = turning_scenes.Case("", FLAT, tip, axis)
    points = turning_scenes.points_of(one)
    points = points._replace(feed_mm=np.zeros_like(tip), swing=np.gradient(axis, axis=0))
    found, area, _ = cut(one, points=points)
    assert area[-1] > 10.0
    assert found.force_N[-1, 1] < -1.0  # the wall stands towards +y and pushes back


def test_a_rapid_into_material_is_told():
    one = case(FLAT, [[-20.0, 20.0, -4.0], [10.0, 20.0, -4.0]])
    points = turning_scenes.points_of(one)
    engagement = TurnedEngagement(dexel_block(BOX, 0.4), [FLAT], scenes.LAW)
    engaged = engagement.take(points._replace(rapid=np.ones(len(one.tip), bool)), ends=True)
    met = one.tip[engaged.rapid_row, 0]
    assert met.min() == pytest.approx(-8.0, abs=0.4)
    assert engaged.settled == len(one.tip) - 1


def test_shank_and_holder_beside_the_cutter():
    tool = FLAT.model_copy(update={"flute_length_mm": 6.0, "holder_diameter_mm": 40.0, "stick_out_mm": 20.0})
    lean = [turning_scenes.tilted(0.0, 60.0)] * 2
    found, _, _ = cut(case(tool, [[20.0, -1.0, -2.0], [22.0, -1.0, -2.0]], lean))
    assert found.overlap_mm[:, 2].max() > 1.0
    free, _, _ = cut(case(tool, [[20.0, -1.0, -2.0], [22.0, -1.0, -2.0]]))
    assert free.overlap_mm.max() == 0.0


def test_a_mesh_becomes_dexels():
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=3, radius=10.0)
    dexels = dexel_mesh(ball, 0.5)
    assert dexels.volume_mm3 == pytest.approx(ball.volume, rel=0.003)
    places = np.random.default_rng(1).normal(size=(200, 3))
    places *= (
        np.random.default_rng(2).uniform(9.3, 10.7, 200)[:, None] / np.linalg.norm(places, axis=1)[:, None]
    )
    depth = dexels.depths(places)
    np.testing.assert_allclose(depth, 10.0 - np.linalg.norm(places, axis=1), atol=0.12)


def test_volume_of_a_block_and_of_a_hole():
    dexels = dexel_block(BOX, 0.7)
    assert dexels.volume_mm3 == pytest.approx(np.prod(BOX[1] - BOX[0]), rel=1e-9)
    way = case(FLAT, [[20.0, 20.0, 3.0], [20.0, 20.0, -6.0]])
    engagement = TurnedEngagement(dexels, [FLAT], scenes.LAW)
    engagement.take(turning_scenes.points_of(way), ends=True)
    removed = np.prod(BOX[1] - BOX[0]) - engagement.dexels.volume_mm3
    assert removed == pytest.approx(np.pi * shape_of(FLAT).radius_mm ** 2 * 6.0, rel=0.005)
