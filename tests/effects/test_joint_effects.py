"""Timing and joints: each effect against its stated form."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from gcode2krl import load_cell, predict, robot
from gcode2krl.compliance import deflection_of
from gcode2krl.effects import inputs_of, parse, simulate
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gcode import read_stream
from gcode2krl.pipeline import predict_toolpath
from tests.effects import KNOWN, moved_by, run

DEG = np.pi / 180.0


def standing(q, inputs):
    """The tip of joints q, bent by the run's load there."""
    load = (inputs.force_base_N, inputs.moment_base_Nmm)
    return robot.forward(q, inputs.cell)[0] + deflection_of(q, *load, np.zeros(3), inputs.cell, 1)[0]


def test_servo_lag(swinging):
    signals = run(swinging, "servo_lag:target=A3,tau_s=0.03")
    q, t = swinging.q_cmd_rad[:, 2], swinging.time_s
    fine = np.arange(0.0, t[-1], 1e-4)
    x, y = CubicSpline(t, q)(fine), np.empty(len(fine))
    y[0] = x[0]
    for i in range(1, len(fine)):  # trapezoidal rule
        half = 0.5e-4 / 0.03
        y[i] = (y[i - 1] * (1.0 - half) + half * (x[i] + x[i - 1])) / (1.0 + half)
    np.testing.assert_allclose(signals.q_act_rad[:-1, 2], np.interp(t[:-1], fine, y), atol=3e-6)
    others = [0, 1, 3, 4, 5]
    np.testing.assert_array_equal(signals.q_act_rad[:, others], swinging.q_cmd_rad[:, others])
    np.testing.assert_array_equal(signals.q_load_rad, signals.q_act_rad)
    np.testing.assert_allclose(signals.tcp_base_mm, standing(signals.q_act_rad, swinging), atol=1e-9)


def test_backlash_is_a_play_with_memory(swinging):
    gap = 0.04 * DEG
    signals = run(swinging, "backlash:target=A2,gap_deg=0.04")
    np.testing.assert_array_equal(signals.q_act_rad, swinging.q_cmd_rad)
    apart = (signals.q_load_rad - signals.q_act_rad)[:, 1]
    rising = np.gradient(swinging.q_cmd_rad[:, 1]) > 0
    long_enough = np.abs(swinging.q_cmd_rad[:, 1] - np.median(swinging.q_cmd_rad[:, 1])) < 2.0 * DEG
    settled = long_enough & (swinging.time_s > 3.0)
    np.testing.assert_allclose(apart[settled], np.where(rising, -gap / 2, gap / 2)[settled], atol=1e-12)
    assert np.abs(apart).max() <= gap / 2 + 1e-15


def test_friction(swinging):
    signals = run(swinging, "friction:target=A4,spike_deg=0.02,decay_s=0.2")
    apart = (signals.q_act_rad - swinging.q_cmd_rad)[:, 3]
    speed = np.gradient(swinging.q_cmd_rad[:, 3], swinging.time_s)
    turns = swinging.time_s[1:][np.diff(np.sign(speed)) != 0]
    first = swinging.time_s < turns[0] - 0.02
    assert not apart[first].any()
    for turn, following in zip(turns, [*turns[1:], np.inf], strict=True):
        rows = (swinging.time_s > turn + 0.03) & (swinging.time_s < following - 0.03)
        wanted = -np.sign(speed) * 0.02 * DEG * np.exp(-(swinging.time_s - turn) / 0.2)
        np.testing.assert_allclose(apart[rows], wanted[rows], rtol=0.08)
    assert len(turns) > 3


def test_transmission(swinging):
    text = "transmission:target=A1,amplitude_deg=0.005,harmonic=2,phase=0.7"
    signals = run(swinging, text)
    ratio = swinging.cell.robot.drives.gear_ratio[0]
    wanted = 0.005 * DEG * np.sin(2.0 * ratio * swinging.q_cmd_rad[:, 0] + 0.7)
    np.testing.assert_allclose((signals.q_load_rad - swinging.q_cmd_rad)[:, 0], wanted, atol=1e-15)


def test_transmission_follows_the_motor_not_the_command(swinging):
    signals = run(swinging, "servo_lag:target=A1,tau_s=0.05", "transmission:target=A1,amplitude_deg=0.005")
    ratio = swinging.cell.robot.drives.gear_ratio[0]
    wanted = 0.005 * DEG * np.sin(ratio * signals.q_act_rad[:, 0])
    np.testing.assert_allclose((signals.q_load_rad - signals.q_act_rad)[:, 0], wanted, atol=1e-15)


def test_transmission_needs_the_gear_ratio(cell):
    drives = cell.robot.drives.model_copy(update={"gear_ratio": None})
    without = cell.model_copy(update={"robot": cell.robot.model_copy(update={"drives": drives})})
    with pytest.raises(NotUnderstoodError, match=r"gear ratio of A1 .* is not known"):
        parse("transmission:target=A1,amplitude_deg=0.005", KNOWN, without)
    with pytest.raises(NotUnderstoodError, match="A9"):
        parse("transmission:target=A9,amplitude_deg=0.005", KNOWN, cell)


@pytest.mark.parametrize("joint", range(6))
def test_mastering(swinging, joint):
    signals = run(swinging, f"mastering:target=A{joint + 1},offset_deg=0.1")
    for shown in (signals.q_cmd_rad, signals.q_act_rad, signals.q_load_rad):
        np.testing.assert_array_equal(shown, swinging.q_cmd_rad)
    q = np.array(swinging.q_cmd_rad)
    q[:, joint] += 0.1 * DEG
    np.testing.assert_allclose(signals.tcp_base_mm, standing(q, swinging), atol=1e-9)
    moved = np.linalg.norm(signals.tcp_base_mm - simulate(swinging).tcp_base_mm, axis=1)
    assert moved.max() > 0.1


def test_wrist_coupling(swinging):
    signals = run(swinging, "wrist_coupling:ratio=0.002")
    q = np.array(swinging.q_cmd_rad)
    q4, q5 = q[:, 3].copy(), q[:, 4].copy()
    q[:, 4] += 0.002 * q4
    q[:, 5] += 0.002 * (q4 + q5)
    np.testing.assert_allclose(signals.q_true_rad, q, atol=1e-15)
    np.testing.assert_allclose(signals.q_load_rad, q, atol=1e-15)
    np.testing.assert_array_equal(signals.q_act_rad, swinging.q_cmd_rad)


@pytest.mark.parametrize("name", ["a1", "a2", "c1", "c2", "c3", "c4"])
def test_link_length(swinging, name):
    geometry = swinging.cell.robot.geometry
    longer = geometry.model_copy(update={f"{name}_mm": getattr(geometry, f"{name}_mm") + 2.0})
    robot_ = swinging.cell.robot.model_copy(update={"geometry": longer})
    position, _ = robot.forward(swinging.q_cmd_rad, swinging.cell.model_copy(update={"robot": robot_}))
    moved = moved_by(swinging, f"link_length:target={name},mm=2")
    np.testing.assert_allclose(moved, position - swinging.position_mm, atol=1e-9)


@pytest.mark.parametrize("target", ["tracker", "force", "controller", "q_load", "q_cmd"])
def test_clock(swinging, target):
    signals = run(swinging, f"clock:target={target},offset_s=0.05,skew=0.001")
    stamped = {
        "tracker": ("tcp_base_mm",),
        "force": ("force_meas_base_N", "moment_meas_base_Nmm"),
        "controller": ("q_cmd_rad", "q_act_rad", "q_load_rad"),
        "q_load": ("q_load_rad",),
        "q_cmd": ("q_cmd_rad",),
    }
    everything = {name for names in stamped.values() for name in names}
    for name in everything:
        values, seen = getattr(signals, name), signals.seen(name)
        if name not in stamped[target]:
            np.testing.assert_array_equal(seen, values)
            continue
        t_true = swinging.time_s[100]
        stamp = t_true * 1.001 + 0.05  # t_table = t·(1 + skew) + offset
        np.testing.assert_allclose(signals.seen(name, np.array([stamp]))[0], values[100], rtol=1e-9)


def test_clocks_of_table_and_column_add_up(swinging):
    signals = run(swinging, "clock:target=controller,offset_s=0.02", "clock:target=q_load,offset_s=0.03")
    seen = signals.seen("q_load_rad", np.array([1.0]))
    np.testing.assert_allclose(seen, signals.seen("q_act_rad", np.array([0.97])), atol=1e-12)


def test_the_nominal_constants_plan_the_nominal_motion(milling):
    again = milling.replanned(milling.targets, milling.cell)
    np.testing.assert_allclose(again.position_mm, milling.position_mm, atol=1e-12)
    np.testing.assert_allclose(again.force_base_N, milling.force_base_N, atol=1e-9)
    np.testing.assert_array_equal(again.source_line, milling.source_line)


def test_velocity_rule(cell):
    """A move over L from rest to rest lasts L/v + v/a + k (Bigliardi et al. 2022, law of two averages)."""
    text = b"G21 G90 G61\nT1 M6\nG0 X0 Y0 Z0\nG1 X50 F3000\nY30\nX0\nM30\n"
    toolpath = read_stream(io.BytesIO(text), "part.nc", cell)
    inputs = inputs_of(predict_toolpath(toolpath, cell))
    nominal = 130.0 / 50.0 + 3 * (50.0 / 2000.0 + 0.168)
    assert inputs.time_s[-1] == pytest.approx(nominal, abs=0.013)
    slow = run(inputs, "velocity_rule:k_s=0.4,acc_cp_m_s2=0.5")
    assert slow.time_s[-1] == pytest.approx(130.0 / 50.0 + 3 * (50.0 / 500.0 + 0.4), abs=0.013)
    late = run(inputs, "velocity_rule:k_s=0.4")
    assert late.time_s[-1] == pytest.approx(nominal + 3 * (0.4 - 0.168), abs=0.013)
    assert run(inputs, f"velocity_rule:acc_cp_m_s2={cell.controller.acc_cp_m_s2}").inputs is inputs


def _rests(inputs, least_s):
    """How often the commanded motion stands still for so long."""
    edges = np.flatnonzero(np.diff(inputs.motion.speed_mm_s < 0.05, prepend=False, append=False))
    lengths_s = (edges[1::2] - edges[::2]) * 0.012
    return int(np.count_nonzero(lengths_s >= least_s))


def test_corner(milling):
    signals = run(milling, "corner:cdis_mm=2")
    vertex = np.array([0.0, 40.0, -3.0])  # 90 degrees: the corner is d·cos(45)/2 off
    off = np.linalg.norm(signals.inputs.position_mm - vertex, axis=1).min()
    assert off == pytest.approx(2.0 * math.cos(math.pi / 4) / 2.0, abs=0.02)
    assert len(signals.time_s) == len(signals.tcp_base_mm)


def test_advance_stop(milling):
    signals = run(milling, "advance_stop:count=2,hold_s=0.5")
    assert _rests(milling, 0.4) == 0
    assert _rests(signals.inputs, 0.49) == 2
    assert signals.time_s[-1] - milling.time_s[-1] > 1.0
    assert run(milling, "advance_stop:count=0,hold_s=0.5").inputs is milling


def ramps(inputs, acceleration, run_s=0.4, pause_s=1.2):
    """A2 of a run that is sped up, slowed down, and rests, over and over."""
    t = inputs.time_s
    phase = t % (2.0 * run_s + pause_s)
    wanted = np.where(phase < run_s, acceleration, np.where(phase < 2.0 * run_s, -acceleration, 0.0))
    step = np.diff(t, prepend=t[:1])
    q = np.array(inputs.q_cmd_rad)
    q[:, 1] = -1.7 + np.cumsum(np.cumsum(wanted * step) * step)
    return replace(inputs, q_cmd_rad=q)


def test_a_drive_at_its_limit_falls_behind_and_catches_up(swinging):
    """Two thirds of the acceleration of a ramp: behind by a sixth of a·t², and there within a second."""
    inputs = ramps(swinging, 1.5)
    limit = 1.0 / DEG
    signals = run(inputs, f"current_limit:target=A2,limit_deg_s2={limit}")
    behind = (inputs.q_cmd_rad - signals.q_act_rad)[:, 1]
    period = inputs.time_s % 2.0
    first = (period > 0.05) & (period < 0.39)
    np.testing.assert_allclose(behind[first], 0.25 * period[first] ** 2, rtol=0.1, atol=1e-3)
    assert 0.03 < behind.max() < 0.12
    settled = (period > 1.9) | (inputs.time_s < 0.012)
    assert np.abs(behind[settled]).max() < 0.02 * behind.max()
    taken = np.gradient(np.gradient(signals.q_act_rad[:, 1], inputs.time_s), inputs.time_s)
    assert np.abs(taken[first & (period < 0.36)]).max() < 1.01
    others = [0, 2, 3, 4, 5]
    np.testing.assert_array_equal(signals.q_act_rad[:, others], inputs.q_cmd_rad[:, others])


def test_a_limit_that_the_run_keeps_takes_nothing(swinging):
    effect = KNOWN["current_limit"]
    own = effect.nominal(swinging, "A2")["limit_deg_s2"]
    for limit in (own, 2.0 * own):
        signals = run(swinging, f"current_limit:target=A2,limit_deg_s2={limit}")
        np.testing.assert_array_equal(signals.q_act_rad, swinging.q_cmd_rad)
    assert effect.start(swinging, "A2")["limit_deg_s2"] == pytest.approx(0.8 * own)


def test_a2_turns_a3(swinging):
    signals = run(swinging, "axis_coupling:ratio=0.002,deg_per_kNm=0.05")
    q = np.array(swinging.q_cmd_rad)
    q[:, 2] += 0.002 * q[:, 1] + 0.05 * DEG / 1000.0 * swinging.own_torque_Nm[:, 1]
    np.testing.assert_allclose(signals.q_load_rad, q, atol=1e-15)
    np.testing.assert_allclose(signals.q_true_rad, q, atol=1e-15)
    np.testing.assert_array_equal(signals.q_act_rad, swinging.q_cmd_rad)
    assert KNOWN["axis_coupling"].joints_at(None) == {"A3"}


def test_a_belt_creeps_after_its_load(swinging):
    """A steady torque that is gone at 6 s: what has crept goes back with the time constant."""
    force = np.where(swinging.time_s[:, None] < 6.0, [0.0, 0.0, 0.0], [0.0, 0.0, 400.0])
    still = np.tile(swinging.q_cmd_rad[:1], (len(swinging), 1))
    position, rotation = robot.forward(still, swinging.cell)
    inputs = replace(
        swinging,
        q_cmd_rad=still,
        position_mm=position,
        rotation=rotation,
        force_base_N=force,
        moment_base_Nmm=np.zeros_like(force),
        kept={},
    )
    signals = run(inputs, "belt_wind_up:target=A5,deg_per_kNm=0.5,relax_s=3")
    torque = inputs.own_torque_Nm[:, 4] / 1000.0
    before, after = torque[0], torque[-1]
    assert abs(after - before) > 0.02
    crept = np.where(
        inputs.time_s < 6.0, before, after - (after - before) * np.exp(-(inputs.time_s - 6.0) / 3.0)
    )
    rows = np.abs(inputs.time_s - 6.0) > 0.02  # the sample before a jump is half a slope already
    found = (signals.q_load_rad - still)[rows, 4]
    np.testing.assert_allclose(found, 0.5 * DEG * crept[rows], atol=0.5 * DEG * 4e-3 * abs(after - before))
    np.testing.assert_array_equal(signals.q_true_rad, signals.q_load_rad)
    with pytest.raises(NotUnderstoodError, match="allowed for belt_wind_up: A4, A5, A6"):
        parse("belt_wind_up:target=A2,deg_per_kNm=1", KNOWN, inputs.cell)


def test_a_joint_slips_each_time_its_torque_is_large(swinging):
    torque = swinging.own_torque_Nm[:, 4]
    assert torque.min() > 0.0
    signals = run(swinging, "bolt_ratchet:target=A5,step_deg=0.01,threshold_Nm=300")
    steps, is_high = [], torque[0] > 300.0
    for value in torque:
        rises = not is_high and value > 300.0
        is_high = value > 300.0 or (is_high and value > 270.0)
        steps.append(float(rises))
    assert 2 <= sum(steps) <= 20
    np.testing.assert_allclose(
        (signals.q_load_rad - swinging.q_cmd_rad)[:, 4], 0.01 * DEG * np.cumsum(steps), atol=1e-12
    )


def test_an_effect_that_feels_the_weight_says_that_it_is_not_known(tmp_path):
    part = tmp_path / "part.ngc"
    part.write_text(
        "G21 G90 G17\nT1 M6\nG43 H1\nS8000 M3\nG0 X0 Y0 Z5\nG1 Z-1 F600\nX9\nG0 Z50\nM2\n", "utf-8"
    )
    known, twist = load_cell(), "gear_twist:target=A2,deg_per_kNm=0.01"
    drives = known.robot.drives.model_copy(update={"link_mass_kg": None})
    unknown = known.model_copy(update={"robot": known.robot.model_copy(update={"drives": drives})})
    for cell, found in ((known, []), (unknown, ["effect-weightless"])):
        issues = predict(part, cell, effects=[twist]).issues
        assert [issue.code for issue in issues if issue.code == "effect-weightless"] == found
