"""Traces: what an instrument would show, in its frame, on its clock, with effects at work."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import robot
from gcode2krl.effects import Applied, library
from gcode2krl.gap.compare.trace import Trace
from tests.gap.constructed import applied, joint_rates, joints, motion, trace, wave

LIBRARY = library()
INPUTS = motion()
TIME_S = INPUTS.time_s
INSIDE = slice(10, -10)


@pytest.fixture(scope="module")
def pushed():
    """The motion with a force that turns in space."""
    force = np.stack([100 * np.cos(TIME_S), 80 * np.sin(TIME_S), 30 + 0 * TIME_S], axis=1)
    return replace(INPUTS, force_base_N=force)


def test_the_nominal_tip_is_that_of_forward_kinematics():
    one = trace(np.zeros((500, 3)), "mechanics", time_s=TIME_S + 0.004)
    tip, _ = robot.forward(joints(TIME_S + 0.004), INPUTS.cell, 1)
    np.testing.assert_allclose(one.nominal[INSIDE], tip[INSIDE], atol=1e-3)
    assert not one.residual.any()


def test_a_force_is_turned_into_the_axes_of_its_instrument(pushed):
    one = trace(np.zeros((500, 3)), "force", inputs=pushed)
    _, quaternion = robot.forward(INPUTS.q_cmd_rad, INPUTS.cell, 1)
    tool = Rotation.from_quat(quaternion)
    flange = tool * Rotation.from_matrix(INPUTS.cell.tool_matrix(1)[:3, :3]).inv()
    np.testing.assert_allclose(one.nominal, pushed.force_base_N, atol=1e-12)
    in_tool = replace(one, frame="tcp").nominal
    np.testing.assert_allclose(in_tool, tool.inv().apply(pushed.force_base_N), atol=1e-9)
    in_sensor = replace(one, frame="sensor").nominal
    np.testing.assert_allclose(in_sensor, flange.inv().apply(pushed.force_base_N), atol=1e-9)
    assert not np.allclose(in_tool, in_sensor)


def test_a_difference_of_two_sides_has_the_recorded_columns():
    one = replace(trace(np.zeros((500, 2)), "servo"), columns=(0, 3))
    effect = wave(1.0)
    found = one.sample([applied(effect, 0.02)])
    np.testing.assert_allclose(found[:, 0], 0.02 * effect.form(TIME_S), atol=1e-12)
    assert not found[:, 1].any()


def test_what_was_found_before_is_part_of_the_model():
    first, second = wave(1.0), wave(2.0)
    one = replace(trace(np.zeros((500, 1))), base=(applied(first, 0.01),))
    np.testing.assert_allclose(one.nominal[:, 0], 0.01 * first.form(TIME_S), atol=1e-12)
    both = 0.01 * first.form(TIME_S) + 0.03 * second.form(TIME_S)
    np.testing.assert_allclose(one.sample([applied(second, 0.03)])[:, 0], both, atol=1e-12)


def test_a_clock_shows_the_signal_as_it_was():
    """offset_s > 0: what is stamped t was true at t - offset."""
    one = trace(np.zeros((500, 6)), "path")
    late = Applied(LIBRARY["clock"], "controller", {"offset_s": 0.05, "skew": 0.0})
    np.testing.assert_allclose(one.sample([late])[INSIDE], joints(TIME_S - 0.05)[INSIDE], atol=1e-6)
    fast = Applied(LIBRARY["clock"], "controller", {"offset_s": 0.0, "skew": 1e-3})
    np.testing.assert_allclose(one.sample([fast])[INSIDE], joints(TIME_S / 1.001)[INSIDE], atol=1e-6)


def test_one_side_alone_may_be_late():
    one = replace(trace(np.zeros((500, 6)), "gear"), plus_late_s=0.02)
    expected = joints(TIME_S - 0.02) - joints(TIME_S)
    np.testing.assert_allclose(one.nominal[INSIDE], expected[INSIDE], atol=2e-6)


def test_rates_are_derivatives():
    path = trace(np.zeros((500, 6)), "path")
    np.testing.assert_allclose(path.rate[INSIDE], joint_rates(TIME_S)[INSIDE], atol=2e-4)
    assert (path.clock_rate == path.rate).all()
    gear = trace(np.zeros((500, 6)), "gear")
    assert not gear.rate.any()  # both sides move alike
    np.testing.assert_allclose(gear.clock_rate[INSIDE], joint_rates(TIME_S)[INSIDE], atol=2e-4)


def test_it_says_what_its_link_is():
    gear = trace(np.zeros((500, 2)), "gear")
    assert isinstance(gear, Trace)
    assert (gear.signal, gear.link.unit, gear.shape) == ("joint_load", "deg", (500, 2))
    tip = trace(np.zeros((500, 3)), "mechanics")
    assert (tip.signal, tip.link.unit) == ("tcp", "mm")


def test_late_commands_show_in_the_drives():
    """The model begins at the commands as they were stamped: the drives are then ahead of these."""
    nominal = trace(np.zeros((500, 6)), "servo")
    late = nominal.sample([Applied(library()["clock"], "q_cmd", {"offset_s": 0.012, "skew": 0.0})])
    ahead = replace(nominal, plus_late_s=-0.012).nominal
    np.testing.assert_allclose(late, ahead, atol=1e-12)
    assert np.abs(late).max() > 1e-3
