"""What the pictures are drawn from: the component, its size at the tip, and the input it depends on."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.effects import Dependence
from gcode2krl.gap.answer.evidence import Depends, Residual, evidence_of, tip_of
from tests.gap.constructed import LINK, cell, motion, trace

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
