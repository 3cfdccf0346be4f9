"""What follows from the commanded motion is computed once for all inputs that share it."""

from dataclasses import replace

import numpy as np

from tests.gap.constructed import motion


def test_measured_values_keep_what_is_commanded():
    inputs = replace(motion(), kept={})  # other tests have the same motion
    jacobian, torque = inputs.jacobian, inputs.own_torque_Nm
    later = replace(inputs, hours=1.0, q_act_rad=inputs.q_cmd_rad + 0.01)
    assert later.jacobian is jacobian
    np.testing.assert_array_equal(later.own_torque_Nm, torque)


def test_a_path_on_other_times_keeps_its_geometry_and_has_velocities_of_its_own():
    inputs = replace(motion(), kept={})
    jacobian, turned, velocity = inputs.jacobian, inputs.tool_rotation, inputs.velocity_mm_s
    later = replace(inputs, time_s=2.0 * inputs.time_s)
    assert later.jacobian is jacobian
    assert later.tool_rotation is turned
    np.testing.assert_allclose(later.velocity_mm_s, velocity / 2.0)


def test_another_motion_has_values_of_its_own():
    inputs = motion()
    before = inputs.jacobian.copy()
    moved = replace(inputs, q_cmd_rad=inputs.q_cmd_rad + 0.1)
    alone = replace(moved, kept={})
    np.testing.assert_array_equal(moved.jacobian, alone.jacobian)
    assert np.abs(moved.jacobian - before).max() > 1e-3
    np.testing.assert_array_equal(replace(inputs, hours=2.0).jacobian, before)


def test_joints_without_a_measured_value_are_known():
    inputs = motion()
    measured = inputs.q_cmd_rad.copy()
    measured[:, 4] = np.nan
    assert replace(inputs, q_act_rad=measured).is_act_missing.tolist() == [False] * 4 + [True, False]
    assert not replace(inputs, q_load_rad=inputs.q_cmd_rad).is_load_missing.any()
