"""Geometry and compliance: each effect against its stated form."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.compliance import deflection_of
from gcode2krl.effects import simulate
from gcode2krl.frames import rotation_from_quaternion
from tests.effects import moved_by, run

DEG = np.pi / 180.0


def kuka(a, b, c):
    """Rz(A)·Ry(B)·Rx(C) from degrees."""

    def about(axis, degrees):
        angle, cross = degrees * DEG, np.zeros((3, 3))
        i, j = (axis + 1) % 3, (axis + 2) % 3
        cross[j, i], cross[i, j] = 1.0, -1.0
        return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross

    return about(2, a) @ about(1, b) @ about(0, c)


def turned(inputs, q=None):
    """Tool rotations in $BASE."""
    return rotation_from_quaternion(inputs.rotation if q is None else robot.forward(q, inputs.cell)[1])


FRAME = "x_mm=1,y_mm=-2,z_mm=0.5,a_deg=0.3,b_deg=-0.2,c_deg=0.1"


def test_base_frame(swinging):
    signals = run(swinging, f"base_frame:{FRAME}", rotation=True)
    r, before = kuka(0.3, -0.2, 0.1), simulate(swinging, rotation=True)
    np.testing.assert_allclose(signals.tcp_base_mm, before.tcp_base_mm @ r.T + [1.0, -2.0, 0.5], atol=1e-9)
    np.testing.assert_allclose(
        rotation_from_quaternion(signals.tcp_rotation),
        r @ rotation_from_quaternion(before.tcp_rotation),
        atol=1e-12,
    )
    np.testing.assert_array_equal(signals.q_cmd_rad, swinging.q_cmd_rad)


def test_tool_frame(swinging):
    signals = run(swinging, f"tool_frame:{FRAME}", rotation=True)
    before = simulate(swinging, rotation=True)
    np.testing.assert_allclose(
        signals.tcp_base_mm - before.tcp_base_mm,
        np.einsum("nij,j->ni", turned(swinging), [1.0, -2.0, 0.5]),
        atol=1e-9,
    )
    np.testing.assert_allclose(
        rotation_from_quaternion(signals.tcp_rotation),
        rotation_from_quaternion(before.tcp_rotation) @ kuka(0.3, -0.2, 0.1),
        atol=1e-12,
    )


def test_thermal(swinging):
    later = replace(swinging, hours=0.7)
    moved = moved_by(later, "thermal:mm_per_h=0.4,time_constant_h=1.5,direction=0/3/-4")
    hours = 0.7 + swinging.time_s / 3600.0
    wanted = (0.4 * 1.5 * (1.0 - np.exp(-hours / 1.5)))[:, None] * [0.0, 0.6, -0.8]
    np.testing.assert_allclose(moved, wanted, atol=1e-9)


@pytest.mark.parametrize("name", VIRTUAL_JOINTS)
def test_stiffness(swinging, name):
    signals = run(swinging, f"stiffness:target={name},scale=0.6")
    joints = dict(swinging.cell.compliance.virtual_joints)
    soft = joints[name]
    joints[name] = soft.model_copy(update={k: getattr(soft, k) * 0.6 for k in ("k_c", "k_b", "k_a")})
    compliance = swinging.cell.compliance.model_copy(update={"virtual_joints": joints})
    cell = swinging.cell.model_copy(update={"compliance": compliance})
    bent, _ = deflection_of(
        swinging.q_cmd_rad, swinging.force_base_N, swinging.moment_base_Nmm, np.zeros(3), cell, 1
    )
    np.testing.assert_allclose(signals.tcp_base_mm, swinging.position_mm + bent, atol=1e-9)


def torque_by_virtual_work(inputs, joint):
    """F·dp + M·dphi for a small turn of one joint, in N·m per rad."""
    step = 1e-5
    ends = []
    for sign in (1, -1):
        q = np.array(inputs.q_cmd_rad)
        q[:, joint] += sign * step
        position, _ = robot.forward(q, inputs.cell)
        ends.append((position, turned(inputs, q)))
    (p1, r1), (p0, r0) = ends
    spin = (r1 @ np.swapaxes(r0, 1, 2) - np.eye(3)) / (2 * step)
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    velocity = (p1 - p0) / (2 * step)
    work = np.sum(inputs.force_base_N * velocity + inputs.moment_base_Nmm * omega, axis=1)
    return work / 1000.0


@pytest.mark.parametrize("joint", [0, 1, 4, 5])
def test_nonlinear_stiffness(swinging, joint):
    text = f"nonlinear_stiffness:target=A{joint + 1},soft_deg=0.02,torque_Nm=80"
    signals = run(swinging, text)
    wanted = 0.02 * DEG * np.tanh(torque_by_virtual_work(swinging, joint) / 80.0)
    extra = signals.q_true_rad - swinging.q_cmd_rad
    np.testing.assert_allclose(extra[:, joint], wanted, atol=1e-9)
    assert np.abs(wanted).max() > 0.003 * DEG
    q = swinging.q_cmd_rad + extra
    moved = robot.forward(q, swinging.cell)[0] - swinging.position_mm
    np.testing.assert_allclose(signals.tcp_base_mm - simulate(swinging).tcp_base_mm, moved, atol=1e-9)
    np.testing.assert_array_equal(signals.q_load_rad, swinging.q_cmd_rad)


def held(inputs, force, moment=0.0):
    """The run's first pose, held for as long as there are forces (m, 3)."""
    count = len(force)
    same = {
        name: np.repeat(getattr(inputs, name)[:1], count, axis=0)
        for name in ("q_cmd_rad", "position_mm", "rotation", "tool", "move", "source_line")
    }
    return replace(
        inputs,
        time_s=np.arange(count) * 0.012,
        path_mm=np.zeros(count),
        spindle_rad_s=np.zeros(count),
        force_base_N=force,
        moment_base_Nmm=np.zeros((count, 3)) + moment,
        **same,
    )


def test_hysteresis_loses_between_the_branches(swinging):
    triangle = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, -1, 101), np.linspace(-1, 1, 101)])
    still = held(swinging, triangle[:, None] * np.array([0.0, 400.0, 0.0]))
    extra = (run(still, "hysteresis:target=A1,loss_deg=0.03").q_true_rad - still.q_cmd_rad)[:, 0] / DEG
    torque = torque_by_virtual_work(still, 0)
    falling, rising = 100, 201  # no force
    assert abs(torque[falling]) < 1e-6
    apart = extra[falling] - extra[rising]
    assert abs(apart) == pytest.approx(0.03, rel=0.02)
    cycle = slice(50, 252)
    lost = np.trapezoid(torque[cycle], extra[cycle])
    assert lost > 0.0  # the load does more work than it gets back
    np.testing.assert_allclose(np.abs(extra).max(), 0.015, rtol=1e-6)


def test_hysteresis_shows_nothing_without_load(swinging):
    still = held(swinging, np.zeros((20, 3)))
    signals = run(still, "hysteresis:target=A1,loss_deg=0.03")
    np.testing.assert_array_equal(signals.tcp_base_mm, still.position_mm)


def test_gravity(swinging):
    signals = run(swinging, "gravity:payload_kg=12,cx_mm=30,cy_mm=-20,cz_mm=150")
    weight = np.array([0.0, 0.0, -12.0 * 9.80665])
    lever = np.einsum("nij,j->ni", turned(swinging), [30.0, -20.0, 150.0])
    force = swinging.force_base_N + weight
    moment = swinging.moment_base_Nmm + np.cross(lever, weight)
    bent, _ = deflection_of(swinging.q_cmd_rad, force, moment, np.zeros(3), swinging.cell, 1)
    np.testing.assert_allclose(signals.tcp_base_mm, swinging.position_mm + bent, atol=1e-9)
    np.testing.assert_array_equal(signals.force_base_N, swinging.force_base_N)
    np.testing.assert_array_equal(signals.force_meas_base_N, swinging.force_base_N)


def test_gravity_points_down_in_a_turned_base(cell, swinging):
    base = cell.frames.base.model_copy(update={"c_deg": 90.0})
    tilted = cell.model_copy(update={"frames": cell.frames.model_copy(update={"base": base})})
    np.testing.assert_allclose(replace(swinging, cell=tilted).gravity, [0.0, -1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("hz", [0.5, 3.0, 5.0])
def test_vibration_has_the_response_of_its_mode(swinging, hz):
    """Under a sine of the force the tip adds participation·(H - 1)·n·(n·d)."""
    t = np.arange(1500) * 0.012
    still = held(swinging, np.sin(2 * np.pi * hz * t)[:, None] * np.array([100.0, 0.0, 0.0]))
    text = "vibration:hz=5,damping=0.05,participation=0.4,direction=1/0/0"
    moved = moved_by(still, text)
    static = (simulate(still).tcp_base_mm - still.position_mm)[:, 0]
    ratio = hz / 5.0
    response = 1.0 / (1.0 - ratio**2 + 2j * 0.05 * ratio) - 1.0
    size = 0.4 * static.max() * abs(response)
    assert np.abs(moved[750:, 0]).max() == pytest.approx(size, rel=0.03, abs=1e-4)
    assert not moved[:, 1:].any()


def test_vibration_is_driven_by_acceleration(swinging):
    t = np.arange(1500) * 0.012
    still = held(swinging, np.zeros((1500, 3)))
    shaken = still.position_mm + np.sin(2 * np.pi * 1.0 * t)[:, None] * np.array([0.0, 10.0, 0.0])
    text = "vibration:hz=4,damping=0.05,participation=0.5,direction=0/1/0"
    moved = moved_by(replace(still, position_mm=shaken), text)
    ratio = 1.0 / 4.0
    inertia = 10.0 * ratio**2  # a/w² of the sine
    size = 0.5 * inertia / abs(1.0 - ratio**2 + 2j * 0.05 * ratio)
    assert np.abs(moved[900:, 1]).max() == pytest.approx(size, rel=0.03)
