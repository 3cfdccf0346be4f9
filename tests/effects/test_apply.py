"""Predictions with effects: what goes where, saved and loaded, and back to the nominal chain."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from gcode2krl import Prediction, plan_motion
from gcode2krl.effects import effects_in, inputs_of, parse, simulate, with_effects
from gcode2krl.errors import NotUnderstoodError
from tests.effects import KNOWN
from tests.gap.constructed import motion

PLAN = partial(plan_motion, dt_s=0.012)


def apply(part, *texts):
    return with_effects(part, [parse(text, KNOWN, part.cell) for text in texts], plan=PLAN)


def test_nothing_applied_is_the_same_prediction(part):
    assert with_effects(part, []) is part


def test_behind_the_motor_goes_into_the_deflection(part, milling):
    found = apply(part, "backlash:target=A2,gap_deg=0.05")
    signals = simulate(milling, [parse("backlash:target=A2,gap_deg=0.05", KNOWN, part.cell)])
    tip = found.motion.position_mm + found.deflection.deflection_base_mm
    np.testing.assert_allclose(tip, signals.tcp_base_mm, atol=1e-12)
    np.testing.assert_array_equal(found.motion.position_mm, part.motion.position_mm)
    np.testing.assert_array_equal(found.joints.q_rad, part.joints.q_rad)
    np.testing.assert_array_equal(found.added["q2_act_rad"], part.joints.q_rad[:, 1])
    assert np.abs(found.added["q2_load_rad"] - part.joints.q_rad[:, 1]).max() > 1e-5
    assert part.added == {}


def test_the_motor_side_and_the_sensor_have_columns(part):
    found = apply(part, "servo_lag:target=A1,tau_s=0.02", "force_offset:fz_N=7")
    assert np.abs(found.added["q1_act_rad"] - part.joints.q_rad[:, 0]).max() > 1e-5
    sensed = np.stack([found.added[f"force_meas_{axis}_N"] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(np.linalg.norm(sensed - part.forces.force_base_N, axis=1), 7.0)
    np.testing.assert_array_equal(found.forces.force_base_N, part.forces.force_base_N)


def test_a_part_that_gives_way_has_columns_that_are_saved(part, tmp_path):
    found = apply(part, "fixture_compliance:um_per_N=1/2/0")
    shift = np.stack([found.added[f"part_shift_{axis}_mm"] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(shift, -part.forces.force_base_N * [1e-3, 2e-3, 0.0])
    np.testing.assert_array_equal(
        found.deflection.deflection_base_mm,
        apply(part, "force_offset:fz_N=0").deflection.deflection_base_mm,
    )
    found.save(tmp_path)
    np.testing.assert_allclose(Prediction.load(tmp_path).added["part_shift_x_mm"], shift[:, 0], atol=1e-9)


def test_correction_is_normal_to_the_feed(part):
    found = apply(part, "tool_wear:growth_per_m=0.5")
    np.testing.assert_allclose(found.forces.peak_N >= part.forces.peak_N - 1e-9, True)
    moving = part.motion.speed_mm_s > 5.0
    velocity = np.gradient(part.motion.position_mm, part.motion.time_s, axis=0)
    along = np.sum(found.deflection.correction_base_mm * velocity, axis=1) / part.motion.speed_mm_s.clip(1e-9)
    assert np.abs(along[moving]).max() < 1e-6


def test_clocks_shift_what_their_tables_show(part):
    found = apply(part, "clock:target=tracker,offset_s=0.024", "clock:target=force,offset_s=0.012")
    tip = part.motion.position_mm + part.deflection.deflection_base_mm
    seen = found.motion.position_mm + found.deflection.deflection_base_mm
    np.testing.assert_allclose(seen[2:], tip[:-2], atol=1e-9)
    np.testing.assert_allclose(found.added["force_meas_y_N"][1:], part.forces.force_base_N[:-1, 1], atol=1e-6)


@pytest.mark.parametrize("text", ["velocity_rule:k_s=0.3", "corner:cdis_mm=1", "override:percent=70"])
def test_planned_anew(part, text):
    found = apply(part, text)
    assert len(found.motion) != len(part.motion) or not np.array_equal(
        found.motion.position_mm, part.motion.position_mm
    )
    for table in (found.joints, found.forces, found.deflection):
        assert len(table) == len(found.motion)
    assert all(len(column) == len(found.motion) for column in found.added.values())
    slow = np.abs(np.gradient(found.joints.q_rad, found.motion.time_s, axis=0) - found.joints.qd_rad_s)
    assert np.median(slow) < 1e-6


def test_saved_and_loaded(part, tmp_path):
    found = apply(part, "backlash:target=A2,gap_deg=0.05", "force_delay:delay_s=0.03")
    found.save(tmp_path / "p")
    again = Prediction.load(tmp_path / "p")
    assert set(again.added) == set(found.added)
    for name, column in found.added.items():
        np.testing.assert_array_equal(again.added[name], column)
    np.testing.assert_array_equal(again.deflection.deflection_base_mm, found.deflection.deflection_base_mm)


def test_back_to_the_nominal_chain(part):
    """Applied to the inputs of a prediction with effects, the same effects give that prediction again."""
    texts = ["tool_wear:growth_per_m=0.3", "velocity_rule:k_s=0.25", "mastering:target=A3,offset_deg=0.05"]
    found = apply(part, *texts)
    found = replace(found, inputs={**found.inputs, "effects": texts})
    inputs = inputs_of(found, plan=PLAN)
    np.testing.assert_allclose(inputs.position_mm, part.motion.position_mm, atol=1e-9)
    np.testing.assert_allclose(inputs.force_base_N, part.forces.force_base_N, atol=1e-6)
    signals = simulate(inputs, effects_in(found, KNOWN))
    wanted = found.motion.position_mm + found.deflection.deflection_base_mm
    np.testing.assert_allclose(signals.tcp_base_mm, wanted, atol=1e-6)


def test_a_prediction_without_motion_is_refused(part):
    with pytest.raises(NotUnderstoodError, match="no motion and joints"):
        inputs_of(replace(part, motion=None))


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
