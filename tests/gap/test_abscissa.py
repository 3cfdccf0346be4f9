"""The input that a gap depends on, along a run, on a motion that is known."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Dependence
from gcode2krl.gap.answer.evidence import against, knows_place
from tests.gap.constructed import HZ, joint_rates, joints, motion, trace

TIME_S = motion().time_s
FORCED = replace(
    motion(),
    force_base_N=np.tile([30.0, 0.0, 40.0], (500, 1)),
    path_mm=10.0 * TIME_S,
    spindle_rad_s=np.full(500, 2.0 * np.pi * 100.0),
    hours=0.5,
)


def found(on, at="A2", inputs=FORCED):
    one = trace(np.zeros((500, 6)), inputs=inputs)
    return against(one, at, frozenset(on))


@pytest.mark.parametrize(
    ("on", "at", "name", "values"),
    [
        (Dependence.OWN_ANGLE, "A2", "angle of A2 (deg)", np.degrees(joints(TIME_S)[:, 1])),
        (Dependence.MOTOR_ANGLE, "A3", "angle of A3 (deg)", np.degrees(joints(TIME_S)[:, 2])),
        (Dependence.FORCE, None, "force (N)", np.full(500, 50.0)),
        (Dependence.TRAVEL, None, "travel (m)", 0.01 * TIME_S),
        (Dependence.RUN_TIME_STEP, None, "time in the run (s)", TIME_S),
        (Dependence.WALL_CLOCK, None, "time since the first run's start (h)", 0.5 + TIME_S / 3600.0),
        (Dependence.SPINDLE_SPEED, None, "spindle speed (1/min)", np.full(500, 6000.0)),
    ],
)
def test_inputs(on, at, name, values):
    shown = found({on}, at)
    assert shown.name == name
    np.testing.assert_allclose(shown.values, values, atol=1e-9)
    assert shown.across_runs == (on is Dependence.WALL_CLOCK)


def test_speeds_of_a_joint_and_of_the_tip():
    shown = found({Dependence.VELOCITY}, "A5")
    np.testing.assert_allclose(shown.values[1:-1], np.degrees(joint_rates(TIME_S)[1:-1, 4]), atol=0.02)
    assert found({Dependence.VELOCITY}, None).name == "velocity (mm/s)"
    assert found({Dependence.ACCELERATION}, "A5").name == "acceleration of A5 (deg/s²)"
    assert found({Dependence.ACCELERATION}, None).name == "acceleration (mm/s²)"


def test_torque_is_the_work_of_the_force_per_turn():
    shown = found({Dependence.OWN_TORQUE}, "A3")
    work = np.einsum("ni,ni->n", FORCED.jacobian[:, :3, 2], FORCED.force_base_N) / 1000.0
    np.testing.assert_allclose(shown.values, work)


def test_time_since_a_reversal_and_which_way_the_joint_moves():
    shown = found({Dependence.REVERSALS}, "A2")
    turns = (np.arange(1, 20, 2) / 4.0) / HZ[1]
    since = np.array([np.min(np.append((t - turns)[t >= turns], np.inf)) for t in TIME_S])
    known = np.isfinite(shown.values) & (since > 0.05)
    np.testing.assert_allclose(shown.values[known], since[known], atol=0.03)
    np.testing.assert_array_equal(shown.direction[known], np.sign(joint_rates(TIME_S)[known, 1]))


def test_the_input_that_says_most_is_taken_and_one_that_is_not_there_is_passed_over():
    assert found({Dependence.RUN_TIME, Dependence.OWN_TORQUE}).name.startswith("torque about A2")
    assert found({Dependence.RUN_TIME, Dependence.OWN_TORQUE}, None).name == "time in the run (s)"
    assert found({Dependence.FORCE, Dependence.TRAVEL}, None, motion()).name == "travel (m)"
    assert found({Dependence.TEMPERATURE}) is None
    nowhere = replace(motion(), position_mm=np.zeros((500, 3)))
    assert not knows_place(nowhere)
    assert found({Dependence.OWN_TORQUE}, "A2", nowhere) is None
    still = replace(FORCED, q_cmd_rad=np.tile(FORCED.q_cmd_rad[:1], (500, 1)))
    assert found({Dependence.REVERSALS}, "A2", still) is None
