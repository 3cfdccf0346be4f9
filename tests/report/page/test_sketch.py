"""The sketch moves as the robot does: a product of exponentials against the kinematics."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import load_cell
from gcode2krl.cell.definition import resolve_cell
from gcode2krl.report.page.sketch import joint_axes, robot_sketch
from gcode2krl.robot.kinematics import flange_pose


def moved(point, q_rad, axes):
    """Return a point of the last link after the turns about the axes, the last first."""
    for angle, (on_axis, along) in reversed(list(zip(q_rad, axes, strict=True))):
        point = on_axis + Rotation.from_rotvec(angle * along).apply(point - on_axis)
    return point


@pytest.fixture(scope="module")
def cell():
    return load_cell()


def test_the_last_link_goes_where_the_kinematics_say(cell):
    geometry = cell.robot.geometry.array()
    axes, last = joint_axes(geometry), robot_sketch(cell, [1])["links"][-1]
    q_rad = np.random.default_rng(2).uniform(-2.0, 2.0, (50, 6))
    position, _ = flange_pose(q_rad, geometry)
    for one, wanted in zip(q_rad, position, strict=True):
        assert moved(np.array(last["to"]), one, axes) == pytest.approx(wanted, abs=1e-8)


def test_the_tip_goes_where_the_tool_is(cell):
    geometry = cell.robot.geometry.array()
    axes, tool = joint_axes(geometry), robot_sketch(cell, [1])["tools"]["1"]
    q_rad = np.random.default_rng(3).uniform(-2.0, 2.0, (20, 6))
    position, rotation = flange_pose(q_rad, geometry)
    frame = cell.tool_matrix(1)
    for one, p, r in zip(q_rad, position, rotation, strict=True):
        assert moved(np.array(tool["tip"]), one, axes) == pytest.approx(p + r @ frame[:3, 3], abs=1e-8)


def test_the_links_hang_together(cell):
    """Each joint centre lies in the links on both of its sides."""
    links = robot_sketch(cell, [1])["links"]
    ends = {one["link"]: (np.array(one["from"]), np.array(one["to"])) for one in links}
    for k in (2, 3, 4, 5):
        assert ends[k][0] == pytest.approx(ends[k - 1][1])


def test_the_root_lies_where_the_base_is_not(cell):
    root = np.array(robot_sketch(cell, [1])["root"]).reshape(4, 4).T
    assert root @ cell.base_matrix() == pytest.approx(np.eye(4), abs=1e-12)


def test_without_a_robot_or_a_tool_nothing_is_made_up():
    assert robot_sketch(None, [1]) is None
    assert robot_sketch(resolve_cell({}), [1]) is None
    assert robot_sketch(load_cell(), [9999])["tools"] == {"9999": None}
