"""Set-up slips: each against what it says happens."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.cell.sections import Frame
from gcode2krl.compliance import deflection_of, displace, project_normal
from gcode2krl.effects import simulate
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.frames import rotation_from_quaternion
from tests.effects import run


def unloaded(inputs):
    nothing = np.zeros_like(inputs.force_base_N)
    return replace(inputs, force_base_N=nothing, moment_base_Nmm=nothing)


@pytest.fixture
def two_tools(swinging):
    """The same run in a cell whose tool 2 is 30 mm longer."""
    tools = dict(swinging.cell.tool)
    tools[1] = tools[1].model_copy(update={"length_mm": 100.0})
    tools[2] = tools[2].model_copy(update={"length_mm": 130.0})
    return unloaded(replace(swinging, cell=swinging.cell.model_copy(update={"tool": tools})))


def test_tool_number(two_tools):
    signals = run(two_tools, "tool_number:target=2")
    wrong_tip, _ = robot.forward(signals.q_cmd_rad, two_tools.cell, 2)
    np.testing.assert_allclose(wrong_tip, two_tools.position_mm, atol=1e-6)  # that one follows the path
    true_tip, _ = robot.forward(signals.q_cmd_rad, two_tools.cell, 1)
    np.testing.assert_allclose(signals.tcp_base_mm, true_tip, atol=1e-6)
    assert np.linalg.norm(signals.tcp_base_mm - two_tools.position_mm, axis=1) == pytest.approx(30.0)
    assert np.abs(np.diff(signals.q_cmd_rad, axis=0)).max() < 0.02  # one branch


def test_base_number(swinging):
    free = unloaded(swinging)
    values = {"x_mm": 20.0, "y_mm": -10.0, "z_mm": 5.0, "a_deg": 2.0, "b_deg": -1.0, "c_deg": 0.5}
    signals = run(free, "base_number:" + ",".join(f"{k}={v}" for k, v in values.items()))
    frame = Frame(**values).matrix()
    wanted = free.position_mm @ frame[:3, :3].T + frame[:3, 3]
    np.testing.assert_allclose(signals.tcp_base_mm, wanted, atol=1e-9)
    np.testing.assert_allclose(robot.forward(signals.q_cmd_rad, free.cell)[0], wanted, atol=1e-6)


def test_a_frame_out_of_reach_is_refused(swinging):
    with pytest.raises(NotUnderstoodError, match="out of the robot's reach"):
        run(swinging, "base_number:x_mm=1900")


def test_override(milling):
    slow = run(milling, "override:percent=50")
    assert slow.time_s[-1] / milling.time_s[-1] == pytest.approx(2.0, rel=0.15)
    np.testing.assert_allclose(slow.inputs.path_mm[-1], milling.path_mm[-1], rtol=1e-6)
    for inputs, feed_mm_s in ((milling, 25.0), (slow.inputs, 12.5)):
        cutting = ~inputs.toolpath.rapid[inputs.move]
        assert np.median(inputs.motion.speed_mm_s[cutting]) == pytest.approx(feed_mm_s, rel=1e-3)


def test_rsi_takes_the_deflection_back(milling):
    before, after = simulate(milling), run(milling, "rsi_on:gain=1,delay_s=0")
    cuts = milling.force_base_N.any(axis=1)
    feed = milling.velocity_mm_s
    left = project_normal(after.tcp_base_mm - milling.position_mm, feed)[cuts]
    was = project_normal(before.tcp_base_mm - milling.position_mm, feed)[cuts]
    assert np.abs(was).max() > 0.3
    assert np.abs(left).max() < 0.01 * np.abs(was).max()
    np.testing.assert_array_equal(after.q_cmd_rad, milling.q_cmd_rad)
    assert np.abs(after.q_act_rad - milling.q_cmd_rad).max() > 1e-5


def test_rsi_corrects_what_it_saw_some_time_ago(milling):
    without = simulate(milling).tcp_base_mm
    now, later = (run(milling, f"rsi_on:gain=1,delay_s={delay}").tcp_base_mm - without for delay in (0, 0.12))
    rows = milling.time_s > milling.time_s[0] + 0.12
    for axis in range(3):
        wanted = np.interp(milling.time_s - 0.12, milling.time_s, now[:, axis])
        np.testing.assert_allclose(later[rows, axis], wanted[rows], atol=2e-3)


def test_load(swinging):
    signals = run(swinging, "load:mass_kg=25")
    stated = swinging.cell.load
    flange = rotation_from_quaternion(swinging.rotation) @ swinging.cell.tool_matrix(1)[:3, :3].T
    from_tip = np.array([stated.x_mm, stated.y_mm, stated.z_mm]) - swinging.cell.tool_matrix(1)[:3, 3]
    weight = np.array([0.0, 0.0, -25.0 * 9.80665])
    moment = swinging.moment_base_Nmm + np.cross(flange @ from_tip, weight)
    bent, _ = deflection_of(
        swinging.q_cmd_rad, swinging.force_base_N + weight, moment, np.zeros(3), swinging.cell, 1
    )
    np.testing.assert_allclose(signals.tcp_base_mm, swinging.position_mm + bent, atol=1e-9)


def test_absolute_accuracy_shows_in_the_joints_not_at_the_tip(swinging):
    free = unloaded(swinging)
    signals = run(free, "absolute_accuracy:offsets_deg=0.1/0.05/-0.05/0.2/0/0.1")
    wanted = np.radians([0.1, 0.05, -0.05, 0.2, 0.0, 0.1])
    np.testing.assert_allclose(
        signals.q_cmd_rad - free.q_cmd_rad, np.tile(wanted, (len(free), 1)), atol=1e-12
    )
    np.testing.assert_allclose(signals.tcp_base_mm, free.position_mm, atol=1e-9)


def test_unit(swinging):
    signals, before = run(swinging, "unit:target=force,factor=0.001"), simulate(swinging)
    np.testing.assert_allclose(signals.force_meas_base_N, before.force_meas_base_N / 1000.0)
    np.testing.assert_array_equal(signals.tcp_base_mm, before.tcp_base_mm)
    np.testing.assert_array_equal(signals.force_base_N, before.force_base_N)


def test_swapped_tool(swinging):
    signals = run(swinging, "swapped_tool:length_mm=12,diameter_mm=4")
    axis = rotation_from_quaternion(swinging.rotation)[:, :, 2]  # from tip to holder
    moved = signals.tcp_base_mm - simulate(swinging).tcp_base_mm
    np.testing.assert_allclose(moved, -12.0 * axis, atol=1e-9)
    assert signals.radius_offset_mm == 2.0


def test_other_program_can_only_be_found(swinging):
    with pytest.raises(NotUnderstoodError, match="predict the program that was run"):
        run(swinging, "other_program")


def test_the_true_orientation_includes_the_bending(swinging):
    signals = simulate(swinging, rotation=True)
    root = swinging.cell.base_matrix()[:3, :3]
    _, turn = displace(
        swinging.q_cmd_rad,
        swinging.force_base_N @ root.T,
        swinging.moment_base_Nmm @ root.T,
        swinging.cell,
        1,
    )
    apart = rotation_from_quaternion(signals.tcp_rotation) @ np.swapaxes(
        rotation_from_quaternion(swinging.rotation), 1, 2
    )
    found = (
        np.stack(
            [
                apart[:, 2, 1] - apart[:, 1, 2],
                apart[:, 0, 2] - apart[:, 2, 0],
                apart[:, 1, 0] - apart[:, 0, 1],
            ],
            axis=1,
        )
        / 2.0
    )
    np.testing.assert_allclose(found, turn @ root, atol=1e-8)
