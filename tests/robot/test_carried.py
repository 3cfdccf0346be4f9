"""The arm on rails and the part on tables, against transformations of another library."""

import numpy as np
import pytest
from trimesh import transformations as tf

from gcode2krl.cell.carried import at_rest, from_rest, points_moved, standing, to_rest, vectors_turned
from gcode2krl.frames import quaternion_from_rotation, rotation_from_quaternion
from gcode2krl.robot import forward, inverse
from tests.cells import over_demonstration

ROOT = {"x_mm": 100.0, "y_mm": -50.0, "z_mm": 300.0, "a_deg": 10.0, "b_deg": -5.0, "c_deg": 180.0}
BASE = {"x_mm": -50.0, "y_mm": 120.0, "z_mm": 60.0, "a_deg": 30.0, "b_deg": 10.0, "c_deg": -20.0}
RAIL = {"x_mm": 20.0, "y_mm": 30.0, "z_mm": -40.0, "a_deg": 15.0, "b_deg": 3.0, "c_deg": -2.0}
TILT = {"x_mm": 1500.0, "y_mm": 200.0, "z_mm": 800.0, "a_deg": -30.0, "b_deg": 8.0, "c_deg": 4.0}
TURN = {"x_mm": 5.0, "y_mm": -12.0, "z_mm": 110.0, "a_deg": 3.0, "b_deg": -6.0, "c_deg": 9.0}
AXES = {
    "E1": {"kind": "rail", "axis": [0.0, 1.0, 0.2], "origin": RAIL, "limits": [-2000.0, 6000.0]},
    "E2": {"kind": "tilt", "axis": "-x", "origin": TILT, "limits": [-120.0, 120.0]},
    "E4": {"kind": "turntable", "axis": [0.1, 0.0, 1.0], "origin": TURN, "limits": [-720.0, 720.0]},
    "E5": {"kind": "rail", "axis": "x", "limits": [-500.0, 500.0]},
}
CELL = over_demonstration({"external": AXES, "frames": {"base": BASE, "robroot": ROOT}})
COUNT = 1_000


def frame(six):
    """A KUKA frame, A about z, B about y, C about x, by the other library."""
    a, b, c = (np.radians(six[key]) for key in ("a_deg", "b_deg", "c_deg"))
    place = tf.translation_matrix([six["x_mm"], six["y_mm"], six["z_mm"]])
    return place @ tf.euler_matrix(a, b, c, "rzyx")


def arm(q, geometry):
    """The flange in the robot root: turns about the six axes as they lie at zero, the last one first."""
    a1, a2, c1, c2, c3, c4 = geometry
    wrist = np.array([a1 + c2 + c3, 0.0, c1 - a2])
    flange = tf.translation_matrix(wrist + np.array([c4, 0.0, 0.0])) @ tf.rotation_matrix(
        np.pi / 2, [0, 1, 0]
    )
    axes = [
        ([0, 0, -1], [0, 0, 0]),
        ([0, 1, 0], [a1, 0, c1]),
        ([0, 1, 0], [a1 + c2, 0, c1]),
        ([-1, 0, 0], wrist),
        ([0, 1, 0], wrist),
        ([-1, 0, 0], wrist),
    ]
    turns = [tf.rotation_matrix(angle, axis, point) for angle, (axis, point) in zip(q, axes, strict=True)]
    return tf.concatenate_matrices(*turns, flange)


def tip_in_base(q, external):
    """The tool in $BASE, through $WORLD: down the robot's carriers and up those of the part."""
    e1, e2, e4, e5 = external[[0, 1, 3, 4]]
    rail = np.array(AXES["E1"]["axis"]) / np.linalg.norm(AXES["E1"]["axis"])
    root = frame(RAIL) @ tf.translation_matrix(e1 * rail) @ tf.translation_matrix([e5, 0, 0]) @ frame(ROOT)
    table = frame(TILT) @ tf.rotation_matrix(np.radians(-e2), [1, 0, 0])
    table = table @ frame(TURN) @ tf.rotation_matrix(np.radians(e4), AXES["E4"]["axis"])
    flange = arm(q, CELL.robot.geometry.array())
    return np.linalg.inv(table @ frame(BASE)) @ root @ flange @ CELL.tool_matrix(1)


def drawn(count, seed):
    """Joints (n, 6), external axes (n, 6) and the tool in $BASE (n, 4, 4) by the other library."""
    random = np.random.default_rng(seed)
    low, high = [-180, -130, -100, -300, -120, -300], [180, -5, 140, 300, 120, 300]
    q = np.radians(random.uniform(low, high, (count, 6)))
    external = np.zeros((count, 6))
    for name, axis in AXES.items():
        external[:, int(name[1]) - 1] = random.uniform(*axis["limits"], count)
    return q, external, np.array([tip_in_base(*row) for row in zip(q, external, strict=True)])


@pytest.fixture(scope="module")
def poses():
    return drawn(COUNT, 7)


def test_the_tool_is_where_another_library_has_it(poses):
    q, external, wanted = poses
    position, rotation = from_rest(*forward(q, CELL), external, CELL)
    assert np.abs(position - wanted[:, :3, 3]).max() < 1e-9
    assert np.abs(rotation_from_quaternion(rotation) - wanted[:, :3, :3]).max() < 1e-9


def test_the_joints_come_back(poses):
    q, external, wanted = poses
    rotation = quaternion_from_rotation(wanted[:, :3, :3])
    found = inverse(*at_rest(wanted[:, :3, 3], rotation, external, CELL), CELL)
    apart = np.abs((found - q[:, None] + np.pi) % (2.0 * np.pi) - np.pi).max(axis=2)
    nearest = np.nanmin(apart, axis=1)
    away = np.abs(np.sin(q[:, 4])) > 1e-2  # at the wrist's singularity A4 and A6 are not unique
    assert nearest[away].max() < 1e-9
    assert away.sum() > 0.98 * COUNT


def test_a_cell_that_stands_there_sees_the_same(poses):
    q, external, wanted = poses
    for row in range(0, COUNT, 500):
        there = standing(CELL, external[row])
        assert np.allclose(forward(q[row], there)[0][0], wanted[row, :3, 3], atol=1e-8)
        assert to_rest(external[row][None], there) is None


def test_points_and_vectors_move_row_by_row(poses):
    _, external, _ = poses
    by = to_rest(external[:50], CELL)
    points = np.random.default_rng(1).normal(size=(50, 3))
    assert np.allclose(
        points_moved(points, by), [m[:3, :3] @ p + m[:3, 3] for m, p in zip(by, points, strict=True)]
    )
    assert np.allclose(vectors_turned(points, by), [m[:3, :3] @ p for m, p in zip(by, points, strict=True)])
