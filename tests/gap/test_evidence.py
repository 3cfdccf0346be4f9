"""What the pictures are drawn from: residuals, the component, its size at the tip, the input."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.effects import Dependence
from gcode2krl.gap.answer.evidence import (
    Depends,
    Residual,
    against,
    evidence_of,
    knows_place,
    residuals_of,
    smoothed,
    tip_of,
)
from gcode2krl.gap.compare.interpolation import rms_length
from gcode2krl.gap.posterior.judgement import judge
from tests.gap.constructed import HZ, LINK, cell, joint_rates, joints, motion, noise, question, trace, wave

# What the pictures are drawn from: the component, its size at the tip, and the input it depends on

NOWHERE = replace(motion(), position_mm=np.zeros((500, 3)))


def residual(values, link="servo", after=None, inputs=None, **more):
    one = trace(values, link, inputs=inputs or motion(), **more)
    noise = np.full(values.shape[1], 0.1)
    after = 0.0 * values if after is None else after
    return Residual(trace=one, before=values, after=after, shape=values, noise=noise)


def found(residuals, link="servo", depends=None):
    return evidence_of(SimpleNamespace(link=LINK[link]), residuals, depends)


def six(joint, size):
    values = np.zeros((500, 6))
    values[:, joint] = size
    return values


def test_small_turns_of_joints_move_the_tip_as_forward_kinematics_say():
    small = 1e-6 * np.random.default_rng(1).standard_normal((500, 6))
    moved = tip_of(trace(small), small)
    q_rad = motion().q_cmd_rad
    direct = robot.forward(q_rad + small, cell(), 1)[0] - robot.forward(q_rad, cell(), 1)[0]
    np.testing.assert_allclose(moved, direct, atol=2e-8)


def test_of_joints_the_one_with_most_of_the_gap_is_shown_and_its_size_is_that_at_the_tip():
    values = six(1, 1e-3) + six(3, 1e-4)
    evidence = found([residual(values, factor=10.0)])
    (run,) = evidence.runs
    assert (evidence.component, evidence.unit, evidence.size_unit) == ("A2", "deg", "mm")
    assert evidence.noise == pytest.approx(1.0)
    np.testing.assert_allclose(run.before, 1e-2)
    np.testing.assert_allclose(run.size_before, np.linalg.norm(tip_of(trace(values), values), axis=1))
    np.testing.assert_array_equal(run.size_after, 0.0)
    assert run.line[[0, -1]].tolist() == [1, 500]


def test_the_joint_of_the_cause_is_shown_even_where_another_has_more():
    values = six(1, 1e-3) + six(3, 1e-4)
    at = Depends("A4", frozenset({Dependence.VELOCITY}))
    evidence = found([residual(values)], depends=at)
    assert evidence.component == "A4"
    assert evidence.runs[0].against.name == "velocity of A4 (deg/s)"


def test_without_a_known_robot_there_is_no_path_and_no_tip():
    evidence = found([residual(six(1, 1e-3), inputs=NOWHERE)])
    assert evidence.size_unit == "deg"
    assert evidence.runs[0].position_mm is None
    np.testing.assert_allclose(evidence.runs[0].size_before, 1e-3)


def test_of_a_vector_the_direction_with_most_power_is_shown_pointing_up():
    along = np.array([0.6, 0.0, -0.8])
    values = np.outer(np.sin(motion().time_s), along)
    evidence = found([residual(values, "mechanics")], "mechanics")
    assert evidence.component == "tip along (-0.6, 0.0, 0.8)"
    np.testing.assert_allclose(evidence.runs[0].before, -np.sin(motion().time_s), atol=1e-12)
    assert found([residual(values, "force")], "force").component.startswith("force along")


def test_at_the_tip_a_joints_cause_is_shown_along_what_the_joint_moves():
    column = motion().jacobian[:, :3, 4]
    values = 0.3 * column / np.linalg.norm(column, axis=1, keepdims=True)
    at = Depends("A5", frozenset({Dependence.REVERSALS}))
    evidence = found([residual(values, "mechanics")], "mechanics", at)
    assert evidence.component == "along what A5 moves"
    np.testing.assert_allclose(evidence.runs[0].before, 0.3)
    assert evidence.noise == pytest.approx(0.1)


# The input that a gap depends on, along a run, on a motion that is known

FORCED_S = motion().time_s
FORCED = replace(
    motion(),
    force_base_N=np.tile([30.0, 0.0, 40.0], (500, 1)),
    path_mm=10.0 * FORCED_S,
    spindle_rad_s=np.full(500, 2.0 * np.pi * 100.0),
    hours=0.5,
)


def drawn_over(on, at="A2", inputs=FORCED):
    one = trace(np.zeros((500, 6)), inputs=inputs)
    return against(one, at, frozenset(on))


@pytest.mark.parametrize(
    ("on", "at", "name", "values"),
    [
        (Dependence.OWN_ANGLE, "A2", "angle of A2 (deg)", np.degrees(joints(FORCED_S)[:, 1])),
        (Dependence.MOTOR_ANGLE, "A3", "angle of A3 (deg)", np.degrees(joints(FORCED_S)[:, 2])),
        (Dependence.FORCE, None, "force (N)", np.full(500, 50.0)),
        (Dependence.TRAVEL, None, "travel (m)", 0.01 * FORCED_S),
        (Dependence.RUN_TIME_STEP, None, "time in the run (s)", FORCED_S),
        (Dependence.WALL_CLOCK, None, "time since the first run's start (h)", 0.5 + FORCED_S / 3600.0),
        (Dependence.SPINDLE_SPEED, None, "spindle speed (1/min)", np.full(500, 6000.0)),
    ],
)
def test_inputs(on, at, name, values):
    shown = drawn_over({on}, at)
    assert shown.name == name
    np.testing.assert_allclose(shown.values, values, atol=1e-9)
    assert shown.across_runs == (on is Dependence.WALL_CLOCK)


def test_speeds_of_a_joint_and_of_the_tip():
    shown = drawn_over({Dependence.VELOCITY}, "A5")
    np.testing.assert_allclose(shown.values[1:-1], np.degrees(joint_rates(FORCED_S)[1:-1, 4]), atol=0.02)
    assert drawn_over({Dependence.VELOCITY}, None).name == "velocity (mm/s)"
    assert drawn_over({Dependence.ACCELERATION}, "A5").name == "acceleration of A5 (deg/s²)"
    assert drawn_over({Dependence.ACCELERATION}, None).name == "acceleration (mm/s²)"


def test_torque_is_the_work_of_the_force_per_turn():
    shown = drawn_over({Dependence.OWN_TORQUE}, "A3")
    work = np.einsum("ni,ni->n", FORCED.jacobian[:, :3, 2], FORCED.force_base_N) / 1000.0
    np.testing.assert_allclose(shown.values, work)


def test_time_since_a_reversal_and_which_way_the_joint_moves():
    shown = drawn_over({Dependence.REVERSALS}, "A2")
    turns = (np.arange(1, 20, 2) / 4.0) / HZ[1]
    since = np.array([np.min(np.append((t - turns)[t >= turns], np.inf)) for t in FORCED_S])
    known = np.isfinite(shown.values) & (since > 0.05)
    np.testing.assert_allclose(shown.values[known], since[known], atol=0.03)
    np.testing.assert_array_equal(shown.direction[known], np.sign(joint_rates(FORCED_S)[known, 1]))


def test_the_input_that_says_most_is_taken_and_one_that_is_not_there_is_passed_over():
    assert drawn_over({Dependence.RUN_TIME, Dependence.OWN_TORQUE}).name.startswith("torque about A2")
    assert drawn_over({Dependence.RUN_TIME, Dependence.OWN_TORQUE}, None).name == "time in the run (s)"
    assert drawn_over({Dependence.FORCE, Dependence.TRAVEL}, None, motion()).name == "travel (m)"
    assert drawn_over({Dependence.TEMPERATURE}) is None
    nowhere = replace(motion(), position_mm=np.zeros((500, 3)))
    assert not knows_place(nowhere)
    assert drawn_over({Dependence.OWN_TORQUE}, "A2", nowhere) is None
    still = replace(FORCED, q_cmd_rad=np.tile(FORCED.q_cmd_rad[:1], (500, 1)))
    assert drawn_over({Dependence.REVERSALS}, "A2", still) is None


# Residuals of a judged link: before and after its named causes, and of what the gap is made

SIGMA = 1e-4
TIME_S = motion().time_s
EFFECT = wave(2.0)
SINE = EFFECT.form(TIME_S)
STEPS = np.repeat([1.0, -1.0, -1.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0], 50)


def judged(y, held=1):
    runs = [trace(SIGMA * y[:, None] + noise(500, number, SIGMA), number=number) for number in range(3)]
    return judge(LINK["servo"], runs[: 3 - held], runs[3 - held :], question([EFFECT]))


def test_a_named_cause_is_the_shape_of_the_gap_in_every_run_and_gone_after_it():
    residuals = residuals_of(judged(3.0 * SINE))
    assert [each.trace.run for each in residuals] == ["run-1", "run-2", "run-3"]
    for each in residuals:
        np.testing.assert_allclose(each.shape[:, 0], 3.0 * SIGMA * SINE, atol=0.3 * SIGMA)
        np.testing.assert_allclose(each.before - each.after, each.shape, atol=1e-15)
        assert np.std(each.after) == pytest.approx(SIGMA, rel=0.15)
        assert each.noise == pytest.approx([SIGMA], rel=0.15)


def test_without_a_named_cause_nothing_is_gone_and_the_shape_is_the_smoothed_rest():
    found = judged(4.0 * STEPS)
    assert found.applied == ()
    for each in residuals_of(found):
        np.testing.assert_array_equal(each.before, each.after)
        within = np.abs(np.diff(STEPS, prepend=0.0, append=0.0))
        far = np.convolve(within, np.ones(17), mode="same")[:500] == 0.0
        np.testing.assert_allclose(each.shape[far, 0], 4.0 * SIGMA * STEPS[far], atol=2.0 * SIGMA)
        assert np.std(each.shape[far, 0] - 4.0 * SIGMA * STEPS[far]) < 0.4 * SIGMA  # 15 samples


def test_the_mean_over_a_tenth_of_a_second():
    time_s = 0.01 * np.arange(100)
    values = np.zeros((100, 2))
    values[50] = (1.0, -2.0)
    mean = smoothed(time_s, values)
    assert mean.sum(axis=0) == pytest.approx([1.0, -2.0])
    assert np.count_nonzero(mean[:, 0]) == 10
    np.testing.assert_allclose(smoothed(time_s, np.ones(100)), 1.0)  # to the ends
    np.testing.assert_allclose(smoothed(0.5 * np.arange(3), np.arange(3.0)), np.arange(3.0))


def test_the_rms_length_of_rows():
    assert rms_length([np.array([[3.0, 4.0]]), np.zeros((3, 2))]) == pytest.approx(2.5)
