"""Quality of a pose: distance from joint limits and from the wrist and elbow singularities."""

import numpy as np

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.robot.inverse_kinematics import all_branches
from gcode2krl.robot.poses import flange_frames
from gcode2krl.robot.standing import limits_rad
from gcode2krl.units import RAD_PER_DEG, RAD_PER_REV

COMFORTABLE_RAD = 30.0 * RAD_PER_DEG


def pose_quality(position_mm: Floats, rotation: Floats, tool: Ints32, cell: Cell) -> Floats:
    """Return (n, 8) per branch: 1 = 30° from limits and singularities, 0 = at one, -1 = impossible.

    Each joint counts with its best whole turn; the elbow by A3's distance from the stretched arm.
    """
    geometry = cell.robot.geometry.array()
    flange_position, flange_rotation = flange_frames(position_mm, rotation, tool, cell)
    rotations = np.broadcast_to(flange_rotation, (len(position_mm), 3, 3))
    q = all_branches(flange_position, rotations, geometry)
    limits = limits_rad(cell)
    turns = RAD_PER_REV * np.array([0.0, -1.0, 1.0])
    candidates = q[..., None] + turns  # (n, 8, 6, 3)
    margin = (
        np.minimum(candidates - limits[:, 0, None], limits[:, 1, None] - candidates).max(axis=-1).min(axis=-1)
    )
    wrist = np.abs(np.sin(q[..., 4]))
    stretched = np.arctan2(geometry[1], geometry[4])
    elbow = np.abs(np.sin(q[..., 2] + stretched))
    comfort = np.minimum(np.minimum(margin / COMFORTABLE_RAD, 1.0), 2.0 * np.minimum(wrist, elbow))
    result: Floats = np.where(np.isnan(comfort) | (margin < 0), -1.0, comfort)
    return result
