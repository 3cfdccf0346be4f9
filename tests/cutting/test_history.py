"""How a part comes about: against material removal, and against scenes whose surface is known by hand."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import plan_motion, read_gcode
from gcode2krl.cell import resolve_cell
from gcode2krl.cutting import history_of, remove

CELL = {"based_on": "demonstration", "stock": {"box_mm": [[0, 0, -20], [60, 40, 0]]}}
BALL = CELL | {"tool": {"1": {"kind": "ball", "diameter_mm": 16, "teeth": 2, "length_mm": 60}}}
SLOT = "G21 G90\nT1 M6\nG0 G43 H1 Z20\nS8000 M3\nG0 X-20 Y20\nG0 Z-4\nG1 X80 F1200\nG0 Z20\nM5\nM30\n"
"""A slot 16 mm wide and 4 mm deep along x, from y = 12 to 28."""
AWAY_MM = np.array([0.03, 0.1, -0.02])


def scene(folder, stated, text=SLOT):
    part = folder / "slot.nc"
    part.write_text(text, encoding="ascii")
    cell = resolve_cell(stated)
    toolpath = read_gcode(part, cell)
    return toolpath, plan_motion(toolpath, cell), cell


@pytest.fixture(scope="module")
def slot(tmp_path_factory):
    return scene(tmp_path_factory.mktemp("slot"), CELL)


@pytest.fixture(scope="module")
def history(slot):
    return history_of(*slot)


def middles(history, axis):
    count = history.raw_mm.shape[1 - axis]
    return history.origin_mm[axis] + (np.arange(count) + 0.5) * history.cell_mm[axis]


def test_its_volume_is_that_of_material_removal(slot, history):
    left_mm3 = remove(*slot, is_checked=False).material.volume_mm3
    assert history.volume_mm3(-1) == pytest.approx(60 * 40 * 20)
    assert history.volume_mm3() == pytest.approx(left_mm3, rel=0.001)
    assert history.volume_mm3() == pytest.approx(60 * (40 * 20 - 16 * 4), rel=0.001)


def test_half_way_half_of_the_slot_is_cut(slot, history):
    _, motion, _ = slot
    middle = int(np.argmin(np.abs(motion.position_mm[:, 0] - 30.0) + np.abs(motion.position_mm[:, 2] + 4.0)))
    cut_mm3 = history.volume_mm3(-1) - history.volume_mm3(middle)
    ahead_mm3 = np.pi * 8.0**2 / 2.0 * 4.0
    slot_mm3 = 20.0 * 0.25 * 16.0 * 4.0  # what the feed cuts in a slot of time
    assert cut_mm3 == pytest.approx(30.0 * 16.0 * 4.0 + ahead_mm3, abs=slot_mm3)


def test_nothing_grows(history):
    assert (np.diff(history.sample) >= 0).all()
    order = np.lexsort((history.sample, history.cell))
    same = np.diff(history.cell[order]) == 0
    assert (np.diff(history.height_mm[order])[same] < 0.0).all()


def test_a_tip_that_is_off_leaves_one_wall_and_cuts_too_much_of_the_other(slot, history):
    _, motion, _ = slot
    off_mm = history.error_mm(np.tile(AWAY_MM, (len(motion), 1)))
    y, inner = middles(history, 1), slice(5, -5)
    rows = {name: np.argmin(np.abs(y - at)) for name, at in (("low", 12.0), ("high", 28.0))}
    walls = {
        name: off_mm[row - 1 : row + 2, inner][np.abs(history.normal[row - 1 : row + 2, inner, 2]) < 0.5]
        for name, row in rows.items()
    }
    assert walls["low"].size > 10
    assert walls["high"].size > 10
    assert walls["low"] == pytest.approx(AWAY_MM[1], abs=1e-3)  # away from this wall: material is left
    assert walls["high"] == pytest.approx(-AWAY_MM[1], abs=1e-3)
    assert off_mm[np.abs(y - 20.0) < 6.0][:, inner] == pytest.approx(AWAY_MM[2])
    assert np.isnan(off_mm[np.abs(y - 20.0) > 10.0]).all()


def test_the_surface_below_a_ball_faces_its_middle(tmp_path):
    history = history_of(*scene(tmp_path, BALL))
    y = middles(history, 1) - 20.0
    inside = np.abs(y) < 6.5
    normal = history.normal[inside][:, history.raw_mm.shape[1] // 2]
    assert normal[:, 1] == pytest.approx(-y[inside] / 8.0, abs=0.01)
    assert normal[:, 2] == pytest.approx(np.sqrt(1.0 - (y[inside] / 8.0) ** 2), abs=0.01)


def test_fewer_events_end_alike(slot, history):
    cut = int((history.left_by >= 0).sum())
    few = history_of(*slot, most_events=cut)
    assert len(few.cell) == cut
    assert few.heights_mm() == pytest.approx(history.heights_mm())


def test_two_passes_are_two_events(tmp_path):
    text = SLOT.replace("G0 Z20\nM5", "G0 Z20\nG0 X-20\nG0 Z-6\nG1 X80\nG0 Z20\nM5")
    twice = history_of(*scene(tmp_path, CELL, text))
    middle = twice.raw_mm.shape[1] // 2 + twice.raw_mm.shape[1] * (twice.raw_mm.shape[0] // 2)
    assert twice.height_mm[twice.cell == middle] == pytest.approx([-4.0, -6.0])


def test_no_motion_in_material_is_no_event(slot):
    toolpath, motion, cell = slot
    above = replace(motion, position_mm=motion.position_mm + np.array([0.0, 0.0, 50.0]))
    history = history_of(toolpath, above, cell)
    assert len(history.cell) == 0
    assert (history.left_by == -1).all()
    assert history.volume_mm3() == pytest.approx(60 * 40 * 20)
