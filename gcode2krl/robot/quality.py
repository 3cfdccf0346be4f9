"""Quality of a pose: distance from joint limits and from the wrist and elbow singularities."""

import functools

import numpy as np

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.robot.inverse_kinematics import all_branches
from gcode2krl.robot.poses import flange_frames
from gcode2krl.robot.standing import limits_rad
from gcode2krl.units import RAD_PER_DEG, RAD_PER_REV

_ROWS = 8192
COMFORTABLE_RAD = 30.0 * RAD_PER_DEG


def pose_quality(position_mm: Floats, rotation: Floats, tool: Ints32, cell: Cell) -> Floats:
    """Return (n, 8) per branch: 1 = 30° from limits and singularities, 0 = at one, -1 = impossible.

    Each joint counts with its best whole turn; the elbow by A3's distance from the stretched arm.
    """
    geometry = cell.robot.geometry.array()
    flange_position, flange_rotation = flange_frames(position_mm, rotation, tool, cell)
    rotations = np.broadcast_to(flange_rotation, (len(position_mm), 3, 3))
    limits, stretched = limits_rad(cell), np.arctan2(geometry[1], geometry[4])
    result = np.empty((len(position_mm), 8))

    def part(start: int, end: int) -> None:
        q = all_branches(flange_position[start:end], rotations[start:end], geometry)
        margin = functools.reduce(np.minimum, (_margin(q[..., k], *limits[k]) for k in range(6)))
        wrist, elbow = np.abs(np.sin(q[..., 4])), np.abs(np.sin(q[..., 2] + stretched))
        comfort = np.minimum(np.minimum(margin / COMFORTABLE_RAD, 1.0), 2.0 * np.minimum(wrist, elbow))
        result[start:end] = np.where(np.isnan(comfort) | (margin < 0), -1.0, comfort)

    in_chunks(part, chunk_borders(len(position_mm), _ROWS))
    return result


def _margin(q_rad: Floats, low: float, high: float) -> Floats:
    """Return the distance of angles to the nearer limit, in the best of their whole turns."""
    turns = (q_rad + turn for turn in (0.0, -RAD_PER_REV, RAD_PER_REV))
    return functools.reduce(np.maximum, (np.minimum(q - low, high - q) for q in turns))
