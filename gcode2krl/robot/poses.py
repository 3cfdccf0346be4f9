"""Tool poses in ``$BASE`` to joint angles and back, for a cell."""

import numpy as np
from numpy.typing import ArrayLike

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.inputs import distinct
from gcode2krl.robot.inverse_kinematics import all_branches
from gcode2krl.robot.kinematics import flange_pose
from gcode2krl.robot.velocity_kinematics import jacobian as tip_jacobian


def forward(q_rad: ArrayLike, cell: Cell, tool: int = 1) -> tuple[Floats, Floats]:
    """Return tool poses in ``$BASE`` for joints (n, 6) in rad: position (n, 3) in mm, quaternion (n, 4)."""
    position, rotation = flange_pose(
        np.atleast_2d(np.asarray(q_rad, dtype=float)), cell.robot.geometry.array()
    )
    flange = fr.transform(position, rotation)
    pose = fr.invert(cell.base_matrix()) @ flange @ cell.tool_matrix(tool)
    return pose[:, :3, 3], fr.quaternion_from_rotation(pose[:, :3, :3])


def inverse(position_mm: ArrayLike, rotation: ArrayLike, cell: Cell, tool: int | Ints32 = 1) -> Floats:
    """Return the joints (n, 8, 6) in rad of all branches for tool poses in ``$BASE``; NaN where out of reach.

    ``position_mm`` (n, 3), ``rotation`` (n, 4) quaternions x, y, z, w; one tool or (n,) of them. The branch's
    index is KUKA's status S.
    """
    position = np.atleast_2d(np.asarray(position_mm, dtype=float))
    quaternion = np.atleast_2d(np.asarray(rotation, dtype=float))
    tools = np.broadcast_to(np.asarray(tool, dtype=np.int32), (len(position),))
    flange_position, flange_rotation = flange_frames(position, quaternion, tools, cell)
    rotations = np.broadcast_to(flange_rotation, (len(position), 3, 3))
    return all_branches(flange_position, rotations, cell.robot.geometry.array())


def jacobian(q_rad: ArrayLike, cell: Cell, tool: int = 1) -> Floats:
    """Return the Jacobian (n, 6, 6) of the tool tip along the robot root's axes: mm/rad over rad/rad."""
    q = np.atleast_2d(np.asarray(q_rad, dtype=float))
    return tip_jacobian(q, cell.robot.geometry.array(), cell.tool_matrix(tool)[:3, 3])


def flange_frames(position_mm: Floats, rotation: Floats, tool: Ints32, cell: Cell) -> tuple[Floats, Floats]:
    """Return the flange in the robot root, (n, 3) and (n, 3, 3): ``$BASE``·pose·``$TOOL``⁻¹.

    One tool in one orientation gives one rotation, (1, 3, 3).
    """
    base = cell.base_matrix()
    constant = len(rotation) > 0 and fr.all_alike(rotation)
    turned = base[:3, :3] @ fr.rotation_from_quaternion(rotation[:1] if constant else rotation)
    if constant and fr.all_alike(tool):
        tool_inverse = fr.invert(cell.tool_matrix(int(tool[0])))
        lever = base[:3, 3] + turned[0] @ tool_inverse[:3, 3]
        return position_mm @ base[:3, :3].T + lever, turned @ tool_inverse[:3, :3]
    flange_position = np.empty((len(position_mm), 3))
    flange_rotation = np.empty((len(position_mm), 3, 3))
    for number in distinct(tool):
        rows = slice(None) if (tool == number).all() else tool == number
        tool_inverse = fr.invert(cell.tool_matrix(int(number)))
        tip_rotation = turned if constant else turned[rows]
        flange_rotation[rows] = tip_rotation @ tool_inverse[:3, :3]
        flange_position[rows] = (
            position_mm[rows] @ base[:3, :3].T + base[:3, 3] + tip_rotation @ tool_inverse[:3, 3]
        )
    return flange_position, flange_rotation
