"""How a part comes about as a surface: an upright tool whose slot is known by hand, closed at all times."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.cutting.outlook import outlook_of
from gcode2krl.cutting.surface import surface_history
from tests.cutting.test_history import AWAY_MM, BALL, CELL, SLOT, scene

SLOTS = (0.2, 0.0005)


def surface_of(toolpath, motion, cell, most=(20_000, 150_000)):
    return surface_history(toolpath, motion, cell, replace(outlook_of([motion]), turns=True), SLOTS, most)


@pytest.fixture(scope="module")
def slot(tmp_path_factory):
    return scene(tmp_path_factory.mktemp("slot"), CELL)


@pytest.fixture(scope="module")
def history(slot):
    return surface_of(*slot)


def middle_of(motion):
    return int(np.argmin(np.abs(motion.position_mm[:, 0] - 30.0) + np.abs(motion.position_mm[:, 2] + 4.0)))


def assert_closed(squares):
    """Each edge of a square is passed as often in one direction as in the other."""
    edges = np.concatenate([squares[:, [k, (k + 1) % 4]] for k in range(4)])
    there, back = (np.sort(edges[:, 0] * 10**7 + edges[:, 1]), np.sort(edges[:, 1] * 10**7 + edges[:, 0]))
    np.testing.assert_array_equal(there, back)


def test_its_volume_is_that_of_the_slot(history):
    assert history.volume_mm3(-1) == pytest.approx(60 * 40 * 20, rel=1e-3)
    assert history.volume_mm3() == pytest.approx(60 * (40 * 20 - 16 * 4), rel=1e-3)


def test_half_way_half_of_the_slot_is_cut(slot, history):
    cut_mm3 = history.volume_mm3(-1) - history.volume_mm3(middle_of(slot[1]))
    ahead_mm3 = np.pi * 8.0**2 / 2.0 * 4.0
    assert cut_mm3 == pytest.approx(30.0 * 16.0 * 4.0 + ahead_mm3, abs=20.0 * 0.25 * 16.0 * 4.0)


def test_it_is_closed_at_every_moment(slot, history):
    for row in (-1, middle_of(slot[1]), None):
        assert_closed(history.surface(row)[1])


def test_edges_of_the_part_are_sharp(history):
    points, squares = history.surface()
    corners = points[np.unique(squares)]
    away = [np.linalg.norm(corners - at, axis=1).min() for at in ((0, 0, 0), (60, 12, 0), (60, 28, -4))]
    assert max(away) < 0.15 * history.cell_mm.max()


def test_a_tip_that_is_off_leaves_one_wall_and_cuts_too_much_of_the_other(slot, history):
    off_mm = history.error_mm(np.tile(AWAY_MM, (len(slot[1]), 1)))
    x, y, z = history.surface()[0].T
    inner = (x > 5.0) & (x < 55.0) & (history.left_by >= 0)
    wall = inner & (z > -3.0) & (z < -1.0)
    low, high = wall & (np.abs(y - 12.0) < 0.1), wall & (np.abs(y - 28.0) < 0.1)
    assert low.sum() > 50
    assert high.sum() > 50
    assert off_mm[low] == pytest.approx(AWAY_MM[1], abs=0.02)
    assert off_mm[high] == pytest.approx(-AWAY_MM[1], abs=0.02)
    floor = inner & (np.abs(y - 20.0) < 6.0) & (np.abs(z + 4.0) < 0.1)
    assert off_mm[floor] == pytest.approx(AWAY_MM[2], abs=2e-3)
    assert np.isnan(off_mm[np.abs(y - 20.0) > 10.0]).all()


def test_a_floor_was_left_where_the_tool_was_then(slot, history):
    x, y, z = history.surface()[0].T
    floor = (x > 5.0) & (x < 55.0) & (np.abs(y - 20.0) < 6.0) & (np.abs(z + 4.0) < 0.1)
    ahead = x[floor] - slot[1].position_mm[history.left_by[floor], 0]
    reach = np.sqrt(8.0**2 - (y[floor] - 20.0) ** 2)  # the rim of the bottom gets there first
    assert ahead == pytest.approx(reach, abs=1.5)


def test_the_surface_below_a_ball_faces_its_middle(tmp_path):
    history = surface_of(*scene(tmp_path, BALL))
    x, y, z = history.surface()[0].T
    below = (history.left_by >= 0) & (x > 10.0) & (x < 50.0) & (np.abs(y - 20.0) < 5.0)
    away = np.stack([0.0 * x, 20.0 - y, 4.0 - z], axis=1)[below]
    assert np.linalg.norm(away, axis=1) == pytest.approx(8.0, abs=0.05)
    assert history.normal[below] == pytest.approx(away / 8.0, abs=0.12)


def test_fewer_events_end_alike_and_are_never_torn(slot, history):
    few = surface_of(*slot, most=(20_000, len(history.site) + 3000))
    assert len(few.cell) < len(history.cell)
    assert few.volume_mm3() == history.volume_mm3()
    assert (np.diff(few.shown) >= 0).all()
    for row in np.unique(few.shown):
        assert_closed(few.surface(row)[1])


def test_a_pass_over_the_same_way_leaves_what_the_first_one_left(tmp_path, history):
    text = SLOT.replace("G0 Z20\nM5", "G1 X-20\nG0 Z20\nM5")
    twice = surface_of(*scene(tmp_path, CELL, text))
    assert twice.volume_mm3() == pytest.approx(history.volume_mm3(), rel=1e-4)
    floor = (twice.normal[:, 2] > 0.99) & (twice.left_by >= 0)
    assert (twice.left_by[floor] <= history.left_by.max()).mean() > 0.99


def test_no_motion_in_material_is_no_event(slot):
    toolpath, motion, cell = slot
    above = replace(motion, position_mm=motion.position_mm + np.array([0.0, 0.0, 50.0]))
    history = surface_of(toolpath, above, cell)
    assert (history.shown == -1).all()
    assert (history.left_by == -1).all()
