"""A commanded path beside the planned curve: distances by brute force, frames that bring it back."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.gap.compare.slips import Curve, commanded_path, on_the_curve
from gcode2krl.runs import RunHead
from tests.gap.constructed import controller, joints, motion, pair

INPUTS = motion(10.0, 0.004)
STAMPS_S = np.arange(0.0, 9.9, 0.012)
OWN = joints(STAMPS_S)


def nearest_on_segments(point, corners):
    """Return the distance of a point from a polyline, segment by segment."""
    best = np.inf
    for a, b in pairwise(corners):
        along = b - a
        share = np.clip(np.dot(point - a, along) / max(np.dot(along, along), 1e-30), 0.0, 1.0)
        best = min(best, float(np.linalg.norm(point - a - share * along)))
    return best


def test_feet_on_a_curve_are_those_of_a_loop_over_its_segments():
    t = np.linspace(0.0, 4.0, 120)
    corners = np.stack([40 * np.cos(t), 30 * np.sin(2 * t), 5 * t], axis=1)
    points = corners[::7] + np.random.default_rng(1).normal(0.0, 2.0, (18, 3))
    feet, distance, along = Curve(corners).foot(points)
    np.testing.assert_allclose(distance, [nearest_on_segments(p, corners) for p in points], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(points - feet, axis=1), distance, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1.0, atol=1e-9)
    inside = np.abs(np.sum((points - feet) * along, axis=1)) < 1e-6  # across, but at a corner
    assert inside.mean() > 0.5


def test_a_straight_line_by_hand():
    curve = Curve(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]))
    feet, distance, along = curve.foot(np.array([[30.5, 3.0, 4.0], [-6.0, 8.0, 0.0], [100.0, 0.0, 2.0]]))
    np.testing.assert_allclose(feet, [[30.5, 0, 0], [0, 0, 0], [100, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(distance, [5.0, 10.0, 2.0])
    np.testing.assert_allclose(along, [[1.0, 0.0, 0.0]] * 3)


def path(q_rad=OWN, **more):
    return commanded_path(pair(INPUTS, controller=controller(STAMPS_S, q_cmd_rad=q_rad), **more))


def test_a_path_as_planned_is_on_the_curve_with_its_whole_way():
    found = path()
    assert found.apart_mm.max() < 0.01
    tips, _ = robot.forward(OWN, INPUTS.cell, 1)
    length = np.sum(np.linalg.norm(np.diff(tips, axis=0), axis=1))
    assert found.way_mm.sum() == pytest.approx(length, rel=0.01)
    assert found.gone_mm[-1] == pytest.approx(length, rel=0.01)
    assert found.share(found.apart_mm < 1.0) == 1.0
    assert (found.on_mm, found.off_mm) == (0.03, 0.2)


def test_the_last_decimal_of_the_log_widens_what_is_on_the_curve():
    """A tenth of a degree is millimetres at the arm's length: twice that is on, five times is not off."""
    rounded = np.radians(np.round(np.degrees(OWN), 1))
    found = path(rounded)
    reach = np.linalg.norm(robot.forward(OWN, INPUTS.cell, 1)[0] - root(), axis=1).max()
    assert found.resolution_mm == pytest.approx(np.radians(0.1) * reach, rel=0.02)
    assert (found.on_mm, found.off_mm) == (2.0 * found.resolution_mm, 5.0 * found.resolution_mm)
    assert found.apart_mm.max() < found.off_mm


def root():
    return np.linalg.inv(INPUTS.cell.base_matrix())[:3, 3]


@pytest.mark.parametrize(
    "changed", [{"from_log": True}, {"head": RunHead(angles="relative")}], ids=["log alone", "relative"]
)
def test_what_cannot_be_compared_is_none(changed):
    made = pair(INPUTS, controller=controller(STAMPS_S, q_cmd_rad=OWN), head=changed.pop("head", None))
    made = replace(made, **changed)
    assert commanded_path(made) is None
    assert on_the_curve(made)


def test_an_unknown_joint_or_no_motion_is_none():
    unknown = OWN.copy()
    unknown[:, 5] = np.nan
    assert path(unknown) is None
    assert path(np.tile(OWN[:1], (len(OWN), 1))) is None
    assert commanded_path(pair(INPUTS)) is None


def shifted(frame):
    """Return joints whose tips are the planned ones moved by a frame, by Newton steps."""
    q = OWN.copy()
    tips, _ = robot.forward(OWN, INPUTS.cell, 1)
    wanted = tips @ frame[:3, :3].T + frame[:3, 3]
    rows = np.clip(np.searchsorted(INPUTS.time_s, STAMPS_S), 0, len(INPUTS) - 1)
    inverse = np.linalg.pinv(INPUTS.jacobian[rows][:, :3])
    for _ in range(8):
        q += np.einsum("nij,nj->ni", inverse, wanted - robot.forward(q, INPUTS.cell, 1)[0])
    return q


def test_a_frame_brings_a_path_onto_the_curve_that_was_commanded_in_it():
    turn = np.radians(1.0)
    frame = np.eye(4)
    frame[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    frame[:3, 3] = [4.0, -3.0, 2.0]
    # the way to the start and from the end is no part of the program, so it begins and ends near the curve
    small = np.eye(4)
    small[:3, 3] = [0.12, 0.0, 0.0]
    made = pair(INPUTS, controller=controller(STAMPS_S, q_cmd_rad=shifted(small)))
    assert not on_the_curve(made)
    assert on_the_curve(made, small)
    assert on_the_curve(pair(INPUTS, controller=controller(STAMPS_S, q_cmd_rad=OWN)))
    assert not on_the_curve(pair(INPUTS, controller=controller(STAMPS_S, q_cmd_rad=OWN)), frame)
