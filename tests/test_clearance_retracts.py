"""The retract of a lost link hits what nothing else in the program comes near."""

import numpy as np
import pytest

from gcode2krl import predict, read_gcode, write_krl
from gcode2krl.chain import prepare
from gcode2krl.clearance import collisions_on_retracts, watch_of
from gcode2krl.collision import Carried
from gcode2krl.errors import RefusedError
from gcode2krl.krl.rsi_text import rsi_rows
from tests.cells import over_demonstration

PART = """G21 G90 G17
T1 M6
S8000 M3
G0 G43 H1 X0 Y0 Z20
G0 Z2
G1 Z-2 F600
G1 Y-300 F1500
G1 Y0
G0 Z20
M5
M30
"""
AWAY_MM = 120.0


def cell_with(obstacles, retract_mm):
    link = {"address": "192.168.7.3", "retract_mm": retract_mm}
    return over_demonstration({"obstacle": obstacles, "online": {"link": link}})


def beam(part):
    """A bar 40 mm above the arm where the tool is farthest from start and end of the cut."""
    cell = cell_with([], AWAY_MM)
    plan = prepare(read_gcode(part, cell), cell)
    targets, joints = plan.targets, plan.joints
    row = int(np.argmin(targets.position_mm[:, 1]))
    carried = Carried(cell)
    ends = carried.ends_mm(joints.q_rad[row : row + 1])[0].reshape(-1, 2, 3)
    wrist = carried.names.index("A5")
    x, y, z = ends[wrist].max(axis=0) + np.array([0.0, 0.0, carried.radius_mm[wrist]])
    for higher_mm in range(40, 110, 10):
        low, high = [x - 5.0, y - 60.0, z + higher_mm], [x + 5.0, y - 50.0, z + higher_mm + 10.0]
        bar = {"name": "beam", "frame": "robroot", "box_mm": [low, high]}
        pose = joints.q_rad[row : row + 1]
        if watch_of(cell_with([bar], AWAY_MM)).poses(pose, 1, 100.0)[0] > 40.0:
            return bar
    raise AssertionError("no place above the wrist")


def test_a_bar_above_the_arm_is_hit_on_the_retract_alone(part, tmp_path):
    near = beam(part)
    cell = cell_with([near], AWAY_MM)
    prediction = predict(part, cell)
    assert not [issue for issue in prediction.issues if issue.code == "collision"]
    write_krl(prediction, tmp_path / "PART.src")  # without RSI there is no such retract
    with pytest.raises(RefusedError) as refused:
        write_krl(prediction, tmp_path / "PART.src", online="ImFree")
    hits = [issue for issue in refused.value.issues if issue.code == "collision"]
    assert hits
    assert all("hits beam on the retract of a lost link" in issue.message for issue in hits)
    assert {issue.line for issue in hits} <= {7, 8}


def test_a_short_retract_does_not_reach_it(part):
    cell = cell_with([beam(part)], 20.0)
    targets = prepare(read_gcode(part, cell), cell).targets
    found = collisions_on_retracts(targets, *rsi_rows(targets), 20.0, cell)
    assert not [issue for issue in found if issue.code == "collision"]
    found = collisions_on_retracts(targets, *rsi_rows(targets), AWAY_MM, cell)
    assert [issue for issue in found if issue.code == "collision"]


def test_a_cell_that_describes_nothing_has_none(part):
    cell = over_demonstration({})
    targets = prepare(read_gcode(part, cell), cell).targets
    assert collisions_on_retracts(targets, *rsi_rows(targets), AWAY_MM, cell) == ()
