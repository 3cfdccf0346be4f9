"""Steps, gear twist, interpolation and eccentricity of joints: each against its stated form."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.effects import parse, simulate
from gcode2krl.errors import NotUnderstoodError
from tests.effects import KNOWN, moved_by, run

DEG = np.pi / 180.0


def test_a_step_of_the_tip_stays(swinging):
    text = "step:target=tip,at_s=7.2,size_mm=0.5,direction=0/3/4"
    moved = moved_by(swinging, text)
    t = swinging.time_s
    assert not moved[t < 7.18].any()
    np.testing.assert_allclose(moved[t > 7.22], np.tile([0.0, 0.3, 0.4], (np.sum(t > 7.22), 1)), atol=1e-9)
    middle = np.argmin(np.abs(t - 7.2))
    assert moved[middle, 1] == pytest.approx(0.15, abs=0.01)


def test_a_step_is_there_in_all_later_runs_and_in_no_earlier_one(swinging):
    text = "step:target=tip,at_s=607.2,size_mm=0.5,direction=1/0/0"
    nominal = simulate(swinging).tcp_base_mm
    by_run = [
        (run(replace(swinging, hours=hours), text).tcp_base_mm - nominal)[:, 0]
        for hours in (0.0, 600.0 / 3600.0, 0.5)
    ]
    assert not by_run[0].any()
    assert by_run[1][0] == 0.0
    assert by_run[1][-1] == pytest.approx(0.5)
    np.testing.assert_allclose(by_run[2], 0.5)


def test_a_step_of_a_joint_is_behind_its_gear(swinging):
    signals = run(swinging, "step:target=A3,at_s=5,size_deg=-0.02")
    slipped = signals.q_load_rad - signals.q_act_rad
    np.testing.assert_array_equal(signals.q_act_rad, swinging.q_cmd_rad)
    wanted = np.where(swinging.time_s > 5.0, -0.02 * DEG, 0.0)
    clear = np.abs(swinging.time_s - 5.0) > 0.02
    np.testing.assert_allclose(slipped[clear, 2], wanted[clear], atol=1e-15)
    assert not np.delete(slipped, 2, axis=1).any()
    q = swinging.q_cmd_rad + slipped
    moved = robot.forward(q, swinging.cell)[0] - swinging.position_mm
    np.testing.assert_allclose(signals.tcp_base_mm - simulate(swinging).tcp_base_mm, moved, atol=1e-3)


def test_a_step_has_a_length_at_the_tip_and_an_angle_at_a_joint(cell):
    with pytest.raises(NotUnderstoodError, match="allowed for step: at_s, size_deg"):
        parse("step:target=A3,at_s=5,size_mm=0.1", KNOWN, cell)
    with pytest.raises(NotUnderstoodError, match="allowed for step: at_s, size_mm"):
        parse("step:target=tip,at_s=5,size_deg=0.1", KNOWN, cell)
    for text in (
        "step:target=A3,at_s=5.0,size_deg=0.1",
        "step:target=tip,at_s=5.0,size_mm=0.1,direction=0/0/1",
    ):
        again = parse(str(parse(text, KNOWN, cell)), KNOWN, cell)
        assert again == parse(text, KNOWN, cell)


def work_per_rad(inputs, joint):
    """Power of all loads per speed of one joint, in N·m: forces times the way of what they act on."""
    step, ends = 1e-5, []
    for sign in (1, -1):
        q = np.array(inputs.q_cmd_rad)
        q[:, joint] += sign * step
        position, rotation = robot.forward(q, inputs.cell)
        turned = replace(inputs, q_cmd_rad=q, position_mm=position, rotation=rotation)
        ends.append((position, turned.tool_rotation, turned.bodies.centre_mm))
    (p1, r1, b1), (p0, r0, b0) = ends
    spin = (r1 - r0) @ np.swapaxes(r0, 1, 2) / (2 * step)
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    way, ways = (p1 - p0) / (2 * step), (b1 - b0) / (2 * step)
    work = np.sum(inputs.force_base_N * way + inputs.moment_base_Nmm * omega, axis=1)
    return (work + np.sum(inputs.bodies_push_N * ways, axis=(1, 2))) / 1000.0


@pytest.mark.parametrize("joint", [0, 1, 2, 4])
def test_a_gear_twists_by_the_virtual_work_of_all_loads(swinging, joint):
    signals = run(swinging, f"gear_twist:target=A{joint + 1},deg_per_kNm=0.03")
    twist_deg = (signals.q_load_rad - signals.q_act_rad)[:, joint] / DEG
    np.testing.assert_allclose(twist_deg, 0.03 * work_per_rad(swinging, joint) / 1000.0, atol=2e-6)
    assert np.ptp(twist_deg) > 1e-4


def test_weights_are_those_of_links_and_payload(swinging):
    masses = swinging.bodies.mass_kg
    whole_kg = sum(swinging.cell.robot.drives.link_mass_kg) + swinging.cell.load.mass_kg
    np.testing.assert_allclose(masses.sum(axis=1), whole_kg)
    still = replace(swinging, q_cmd_rad=np.repeat(swinging.q_cmd_rad[:1], len(swinging), axis=0))
    still = replace(still, position_mm=np.repeat(swinging.position_mm[:1], len(swinging), axis=0))
    still = replace(still, rotation=np.repeat(swinging.rotation[:1], len(swinging), axis=0))
    weight_N = -9.80665 * whole_kg
    pushed_N = still.bodies_push_N.sum(axis=1)
    np.testing.assert_allclose(pushed_N, np.tile([0, 0, weight_N], (len(still), 1)), atol=1e-6)
    # the shoulder carries what hangs before it: positive about A2 lowers the arm
    assert still.own_torque_Nm[0, 1] > 1000.0
    assert abs(still.own_torque_Nm[0, 0]) < abs(still.own_torque_Nm[0, 1]) / 10.0


def test_no_torque_is_made_up_where_the_posture_is_unknown(swinging):
    unknown = replace(swinging, position_mm=np.zeros_like(swinging.position_mm))
    signals = run(unknown, "gear_twist:target=A2,deg_per_kNm=0.03")
    np.testing.assert_array_equal(signals.q_load_rad, signals.q_act_rad)


def test_interpolation_has_its_periods_while_the_motor_is_slow(swinging):
    slow = replace(
        swinging, q_cmd_rad=np.radians(20.0) + 1e-3 * np.radians(swinging.time_s[:, None] * np.ones(6))
    )
    signals = run(slow, "encoder_interpolation:target=A2,amplitude_deg=0.0004,periods=512,phase=0.7")
    error = (signals.q_act_rad - slow.q_cmd_rad)[:, 1] / DEG
    turn = 512 * swinging.cell.robot.drives.gear_ratio[1] * slow.q_cmd_rad[:, 1] + 0.7
    passed = 512 * abs(swinging.cell.robot.drives.gear_ratio[1]) * 1e-3 * DEG * 0.012
    np.testing.assert_allclose(error, 4e-4 * np.sin(turn) * np.sin(passed / 2) / (passed / 2), atol=1e-9)
    assert np.abs(error).max() > 3.8e-4


def test_the_joint_does_nothing_of_what_its_encoder_misreads(swinging):
    signals = run(swinging, "encoder_interpolation:target=A2,amplitude_deg=0.004,periods=1")
    assert np.abs(signals.q_act_rad - swinging.q_cmd_rad).max() > np.radians(0.003)
    np.testing.assert_allclose(signals.q_load_rad, swinging.q_cmd_rad, atol=1e-12)
    read = replace(swinging, q_act_rad=signals.q_act_rad)  # as a log has it
    signals = run(read, "encoder_interpolation:target=A2,amplitude_deg=0.004,periods=1")
    np.testing.assert_allclose(signals.q_load_rad, swinging.q_cmd_rad, atol=1e-12)


def test_nothing_is_left_of_periods_faster_than_samples(swinging):
    signals = run(swinging, "encoder_interpolation:target=A2,amplitude_deg=0.0004,periods=1024")
    error = (signals.q_act_rad - swinging.q_cmd_rad)[:, 1] / DEG
    quick = np.abs(np.gradient(swinging.q_cmd_rad[:, 1], swinging.time_s)) > np.radians(2.0)
    assert np.abs(error[quick]).max() < 0.1 * 4e-4


def test_eccentricity_turns_once_with_the_joint(swinging):
    whole = replace(swinging, q_cmd_rad=np.linspace(-np.pi, np.pi, len(swinging))[:, None] * np.ones(6))
    signals = run(whole, "joint_eccentricity:target=A1,amplitude_deg=0.02,phase=0.5")
    error = (signals.q_load_rad - signals.q_act_rad)[:, 0] / DEG
    spectrum = np.fft.rfft(error[:-1]) / (len(error) - 1) * 2.0
    assert np.abs(spectrum[1]) == pytest.approx(0.02, rel=1e-3)
    assert np.abs(np.delete(spectrum, 1)).max() < 1e-4
    assert error[0] == pytest.approx(0.02 * np.sin(-np.pi + 0.5), rel=1e-6)
