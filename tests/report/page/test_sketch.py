"""The sketch moves as the robot does: a product of exponentials against the kinematics."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import load_cell
from gcode2krl.cell import resolve_cell
from gcode2krl.collision import Carried
from gcode2krl.report.page.sketch import joint_axes, robot_sketch
from gcode2krl.robot.kinematics import flange_pose
from tests.cells import over_demonstration


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
    bare = cell.model_copy(update={"robot": cell.robot.model_copy(update={"body": type(cell.robot.body)()})})
    axes, last = joint_axes(geometry), robot_sketch(bare, [1])["links"][-1]
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
    """Where no capsules are stated each joint centre lies in the links on both of its sides."""
    bare = cell.model_copy(update={"robot": cell.robot.model_copy(update={"body": type(cell.robot.body)()})})
    links = robot_sketch(bare, [1])["links"]
    ends = {one["link"]: (np.array(one["from"]), np.array(one["to"])) for one in links}
    for k in (2, 3, 4, 5):
        assert ends[k][0] == pytest.approx(ends[k - 1][1])


def test_the_capsules_go_where_they_are_checked():
    """All that the page turns about its axes, against the ends by which collisions are found."""
    cell = over_demonstration(
        {
            "spindle": {
                "body": {
                    "capsules": [
                        {"from_mm": [75.0, 0, 250], "to_mm": [-150.0, 0, 250], "radius_mm": 75},
                    ]
                }
            }
        }
    )
    sketch, carried = robot_sketch(cell, [1]), Carried(cell)
    axes = joint_axes(cell.robot.geometry.array())
    links = [one for one in sketch["links"] if one["link"] > 0]
    assert [one["name"] for one in links] == carried.names
    q_rad = np.random.default_rng(4).uniform(-2.0, 2.0, (10, 6))
    for q, ends in zip(q_rad, carried.ends_mm(q_rad), strict=True):
        for one, wanted in zip(links, ends, strict=True):
            own = axes[: one["link"]]
            for end, at in (("from", wanted[:3]), ("to", wanted[3:])):
                assert moved(np.array(one[end]), q[: one["link"]], own) == pytest.approx(at, abs=1e-8)


def test_cables_hang_between_the_forearm_and_the_flange():
    """Their ends, against a capsule of A3 and one of the spindle at the same places."""
    on_a3, on_flange = [180.0, 60.0, -240.0], [-30.0, 20.0, 90.0]

    def point(at):
        return {"from_mm": at, "to_mm": at, "radius_mm": 40.0}

    demonstration = load_cell()
    body = {**demonstration.robot.body.model_dump(), "capsules": [{"link": "A3", **point(on_a3)}]}
    cell = over_demonstration(
        {
            "robot": {"body": body},
            "spindle": {"body": {"capsules": [point(on_flange)]}},
            "cables": {"capsules": [{"from_mm": on_a3, "to_mm": on_flange, "radius_mm": 40.0}]},
        }
    )
    (drawn,), axes, carried = (
        robot_sketch(cell, [1])["cables"],
        joint_axes(cell.robot.geometry.array()),
        Carried(cell),
    )
    assert drawn["radius"] == 40.0
    q_rad = np.random.default_rng(5).uniform(-2.0, 2.0, (10, 6))
    for q, (first, second) in zip(q_rad, carried.ends_mm(q_rad), strict=True):
        assert moved(np.array(drawn["from"]), q[:3], axes[:3]) == pytest.approx(first[:3], abs=1e-8)
        assert moved(np.array(drawn["to"]), q, axes) == pytest.approx(second[3:], abs=1e-8)


def test_what_stands_in_the_cell_is_drawn_where_it_is():
    cell = over_demonstration(
        {
            "table": {"z_mm": -60.0},
            "obstacle": [
                {"name": "vice", "box_mm": [[1.0, 2, 3], [4, 6, 8]], "frame": "robroot"},
                {"name": "fence", "plane": {"point_mm": [0.0, -900, 0], "normal": [0.0, 2, 0]}},
            ],
        }
    )
    sketch = robot_sketch(cell, [1])
    world = np.array(sketch["world"]).reshape(4, 4).T
    table, vice, fence = sketch["obstacles"]
    assert [one["stands"] for one in (table, vice, fence)] == [False, True, False]
    frames = [np.array(one["frame"]).reshape(4, 4).T for one in (table, vice, fence)]
    assert frames[0][:3, 3].tolist() == [0.0, 0.0, -60.0]
    assert world @ frames[1] @ cell.base_matrix() == pytest.approx(np.eye(4), abs=1e-12)
    assert (vice["low"], vice["high"]) == ([1.0, 2.0, 3.0], [4.0, 6.0, 8.0])
    assert frames[2][:3, 2].tolist() == [0.0, 1.0, 0.0]
    assert frames[2][:3, 3].tolist() == [0.0, -900.0, 0.0]
    assert np.linalg.det(frames[2][:3, :3]) == pytest.approx(1.0)
    assert fence["high"][2] == 0.0


def test_the_root_lies_where_the_base_is_not(cell):
    root = np.array(robot_sketch(cell, [1])["root"]).reshape(4, 4).T
    assert root @ cell.base_matrix() == pytest.approx(np.eye(4), abs=1e-12)


def test_without_a_robot_or_a_tool_nothing_is_made_up():
    assert robot_sketch(None, [1]) is None
    assert robot_sketch(resolve_cell({}), [1]) is None
    assert robot_sketch(load_cell(), [9999])["tools"] == {"9999": None}
