"""Admissible inputs: loads of the gears, what was logged, memory, corners."""

import io
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from gcode2krl import load_cell
from gcode2krl.effects import Applied, library
from gcode2krl.effects.inputs import gradient
from gcode2krl.gap.compare.inputs import Admissible, Corners
from gcode2krl.gap.compare.pair import Simulator, _shared, with_corners
from gcode2krl.gap.posterior.examination import moments_off
from gcode2krl.gcode import read_stream
from gcode2krl.pipeline import predict_toolpath
from tests.gap.constructed import motion, trace

# Admissible inputs: loads of the gears with and without weight, what was logged, memory

COUNT = 500
PUSH_N = np.array([80.0, -30.0, 20.0])


def inputs_of(**more):
    return Admissible(trace(np.zeros((COUNT, 1)), inputs=replace(motion(), **more)))


def loaded(mass_kg):
    cell = motion().cell
    load = cell.load.model_copy(update={"mass_kg": mass_kg, "x_mm": 0.0, "y_mm": 0.0, "z_mm": 0.0})
    return cell.model_copy(update={"load": load})


def test_gears_carry_the_weight_and_the_arm_beside_the_cut_only_the_force():
    """m·g at the flange about A2, whose arm is the way along the floor from A2's axis to the flange."""
    light = inputs_of(force_base_N=np.tile(PUSH_N, (COUNT, 1)), cell=loaded(0.0))
    heavy = inputs_of(force_base_N=np.tile(PUSH_N, (COUNT, 1)), cell=loaded(50.0))
    np.testing.assert_allclose(light.load_torque_Nm, heavy.load_torque_Nm)
    added = heavy.torque_Nm - light.torque_Nm
    assert np.abs(added[:, 0]).max() < 0.1 * np.abs(added[:, 1]).max()  # inertia alone turns A1
    assert 0.3 < np.abs(added[:, 1]).max() / (50.0 * 9.81) < 4.0  # metres of arm


def test_a_logged_torque_comes_before_the_modelled_one():
    logged = np.column_stack([np.sin(motion().time_s + joint) for joint in range(6)])
    own = inputs_of(torque_Nm=logged, force_base_N=np.tile(PUSH_N, (COUNT, 1)))
    np.testing.assert_allclose(own.torque_Nm, logged)
    assert own.load_torque_Nm.any()
    assert own.torque_with_memory(2).shape == (COUNT, 6)


def test_memory_of_a_torque_lags_at_each_turn_and_not_between():
    rising = np.column_stack([np.linspace(0.0, 1.0, COUNT)] * 6)
    memory = inputs_of(torque_Nm=rising).torque_with_memory(0)
    # a play follows a rising torque half its width behind, once it has been taken up
    assert memory[-1] == pytest.approx([0.0125, 0.025, 0.05, 0.1, 0.2, 0.4])


def test_directions_are_those_of_each_joint():
    rates = np.gradient(motion().q_cmd_rad, motion().time_s, axis=0)
    fast = np.abs(rates) > 0.3 * np.abs(rates).max(axis=0)
    np.testing.assert_array_equal(inputs_of().directions[fast], np.sign(rates[fast]))


def test_friction_fades_and_cables_drag_by_the_angle():
    own, t_s = inputs_of(), motion().time_s
    direction = own.directions
    for column, tau_s in zip(own.reversals(0).T[-3:], (2.0, 8.0, 30.0), strict=True):
        np.testing.assert_allclose(column, direction[:, 0] * np.exp(-(t_s - t_s[0]) / tau_s))
    np.testing.assert_array_equal(own.drags[:, :6], direction)
    moves = np.flatnonzero(np.ptp(motion().q_cmd_rad, axis=0) > 1e-3)
    angle = motion().q_cmd_rad - motion().q_cmd_rad.mean(axis=0)
    for power in (1, 2):
        drags = own.drags[:, 6 * power : 6 * power + 6] * direction
        for joint in moves:
            assert np.corrcoef(drags[:, joint], angle[:, joint] ** power)[0, 1] == pytest.approx(1.0)


def test_a_joint_at_a_spring_follows_as_an_oscillator_does():
    t_s, q = motion().time_s, motion().q_cmd_rad[:, 0]
    rings = inputs_of().rings(0)
    for column in (0, 3):
        w = 2.0 * np.pi * 7.0 * 1.12**column
        _, moved, _ = signal.lsim(([w * w], [1.0, 2.0 * 0.04 * w, w * w]), q - q[0], t_s)
        behind = moved - (q - q[0])
        np.testing.assert_allclose(rings[:, column], behind, atol=0.1 * np.abs(behind).max())


def test_without_a_force_nothing_presses_and_without_a_thermometer_there_is_no_temperature():
    bare = inputs_of()
    assert not bare.presses
    assert bare.temperature_C.shape == (COUNT, 0)
    warm = inputs_of(temperature_C=np.linspace(20.0, 25.0, COUNT)[:, None])
    assert warm.temperature_C[-1, 0] == pytest.approx(25.0)


# Another rounding of corners is a sum of columns, beside them and in time; moments alone are a gap

SAME_SPEED = "G1 X80 F3000\nG1 Y60\nG1 X10 Y20\nG1 Y0\n"
OTHER_SPEEDS = "G1 X80 F9000\nG1 Y60 F3000\nG1 X10 Y20 F9000\nG1 Y0 F3000\n"


def _inputs(moves):
    text = f"G21 G90 G17\nG54\nT1 M6\nS9000 M3\nG0 X0 Y0 Z30\n{moves}M30\n"
    cell = load_cell()
    prediction = predict_toolpath(read_stream(io.BytesIO(text.encode()), "p.nc", cell), cell, dt_s=0.012)
    return _shared(prediction)[0]


def _left(inputs, cdis_mm):
    """Return the share of what another approximation distance does that no sum of the columns takes."""
    corner = library()["corner"]
    there = corner.replan(inputs, Applied(corner, None, {"cdis_mm": cdis_mm}))
    moved = [np.interp(inputs.time_s, there.time_s, q) for q in there.q_cmd_rad.T]
    change = np.stack(moved, axis=1) - inputs.q_cmd_rad
    corners, rate = Corners(inputs), gradient(inputs.q_cmd_rad, inputs.time_s)
    late = rate[:, :, None] * corners.late_by_rounding[:, None, :]
    columns = np.concatenate([corners.roundings.transpose(0, 2, 1), late], axis=2).reshape(change.size, -1)
    rest = change.ravel() - columns @ np.linalg.lstsq(columns, change.ravel(), rcond=None)[0]
    return float(np.sum(rest**2) / np.sum(change**2))


@pytest.mark.parametrize("moves", [SAME_SPEED, OTHER_SPEEDS])
def test_another_approximation_distance_is_a_sum_of_the_columns(moves):
    inputs = _inputs(moves)
    assert _left(inputs, 3.0 * float(inputs.targets.cdis_mm.max())) < 0.15


def test_corners_are_passed_in_order_and_change_nothing_on_straight_lines():
    corners = Corners(_inputs(SAME_SPEED))
    assert np.all(np.diff(corners.passed(np.arange(len(corners.inputs))), axis=0) >= 0.0)
    assert np.mean(np.any(corners.roundings != 0.0, axis=(1, 2))) < 0.5


def test_without_targets_there_are_none():
    corners = Corners(replace(_inputs(SAME_SPEED), targets=None))
    assert corners.passed(np.arange(3)).shape[1] == 0
    assert not corners.roundings.any()
    assert not corners.late_by_rounding.any()


def test_commanded_paths_are_sampled_every_millisecond_but_not_where_they_were_moved():
    inputs = _inputs(SAME_SPEED)
    assert np.median(np.diff(Simulator().commanded(inputs, []).time_s)) == pytest.approx(1e-3)
    moved = replace(inputs, time_s=1.01 * inputs.time_s)
    assert with_corners(moved) is moved


def test_a_path_that_is_off_for_a_moment_alone_is_a_gap():
    """Four rows of five hundred, at ten times the accuracy: a mean over the run does not see them."""
    path = trace(np.zeros((500, 6)), "path")
    off = np.zeros((500, 6))
    off[[100, 200, 300, 400], 2] = 10.0 * path.link.model_rms
    assert moments_off([path], [off], []) == 4
    assert moments_off([path], [0.1 * off], []) == 0
    servo = trace(np.zeros((500, 6)), "servo")
    assert moments_off([servo], [off], []) == 0
