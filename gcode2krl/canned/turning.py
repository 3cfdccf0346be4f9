"""Poses that G-code of three axes cannot say: tilts about a point, and moves of a single joint."""

from dataclasses import dataclass

import numpy as np

from gcode2krl import frames as fr
from gcode2krl import robot
from gcode2krl.arrays import Floats
from gcode2krl.canned.place import Place
from gcode2krl.cell import Cell
from gcode2krl.units import RAD_PER_DEG

TILTS_DEG = (
    (0.0, 0.0, 15.0),
    (0.0, 0.0, -15.0),
    (0.0, 15.0, 0.0),
    (0.0, -15.0, 0.0),
    (30.0, 0.0, 0.0),
    (-30.0, 0.0, 0.0),
)
"""A, B, C about the tool's axes: enough to part a tool's error from a frame's, and near for the wrist."""
TILT_DWELL_S = 3.0
_TILT_SPEED_MM_S = 25.0
_LIFT_MM = 20.0
JOINT_SPEEDS_MM_S = (10.0, 25.0)
"""Of the tip."""
_MOST_JOINT_RAD = 6.0 * RAD_PER_DEG
_REACH_SHARE = 0.25
"""Of the program's size that the tip moves to either side."""
_STEP_RAD = 0.5 * RAD_PER_DEG
"""Between two poses of a joint's move, so that lines keep the other joints still (0.02 mm at 2 m)."""
_BLEND_SHARE = 0.4
"""Of the way between two poses: the corners of one move leave a bit of each line."""
_MOST_BLEND_MM = 5.0
_JOINT_REVERSALS = 2
_REST_S = 0.5


@dataclass(frozen=True, kw_only=True)
class Pose:
    """Where the robot stands."""

    position_mm: Floats
    """(3,) tip in ``$BASE``."""
    rotation: Floats
    """(3, 3) of the tool frame."""
    q_rad: Floats
    """(6,)"""


@dataclass(frozen=True, kw_only=True)
class Turn:
    """Motions that follow a pose; the last one leads back to it."""

    position_mm: Floats
    """(k, 3) in ``$BASE``."""
    rotation: Floats
    """(k, 3, 3)"""
    speed_mm_s: Floats
    """(k,)"""
    cdis_mm: Floats
    """(k,) blending at the end of each, 0 = stop."""
    wait_s: Floats
    """(k,)"""


def tilts(pose: Pose, place: Place, cell: Cell) -> Turn:
    """Return turns of the tool about its tip, each from the pose and back to it.

    Half of each turn is made on the way up and half on the way down: on the spot it would be as fast as the
    wrist can.
    """
    position_mm, rotation = [], []
    above_mm = pose.position_mm + np.array([0.0, 0.0, _LIFT_MM])
    for tilt in np.array(TILTS_DEG) * RAD_PER_DEG:
        half, whole = (pose.rotation @ turn for turn in fr.rotation_from_abc(np.stack([0.5 * tilt, tilt])))
        position_mm += [above_mm, pose.position_mm] * 2
        rotation += [half, whole, half, pose.rotation]
    count = len(rotation)
    return Turn(
        position_mm=np.array(position_mm),
        rotation=np.array(rotation),
        speed_mm_s=np.full(count, _TILT_SPEED_MM_S * place.share),
        cdis_mm=np.zeros(count),
        wait_s=np.where(np.arange(count) % 2 == 1, TILT_DWELL_S, 0.0),
    )


def joint_reversals(joint: int, pose: Pose, place: Place, cell: Cell) -> Turn:
    """Return moves of one joint to both sides of a pose, at each speed."""
    lever_mm = max(_lever_mm(joint, pose, place, cell), 1.0)
    reach_rad = min(_MOST_JOINT_RAD, _REACH_SHARE * place.size_mm / lever_mm)
    steps = int(np.ceil(reach_rad / _STEP_RAD))
    side = np.arange(1, steps + 1)
    once = np.concatenate([side, side[-2::-1], [0], -side, -side[-2::-1], [0]])
    number = np.tile(once, _JOINT_REVERSALS * len(JOINT_SPEEDS_MM_S))
    stops = np.abs(number) == steps
    stops[-1] = True
    q_rad = np.repeat(pose.q_rad[None], len(number), axis=0)
    q_rad[:, joint] += number * reach_rad / steps
    position_mm, quaternion = robot.forward(q_rad, cell, place.tool)
    blend_mm = min(_BLEND_SHARE * lever_mm * reach_rad / steps, _MOST_BLEND_MM)
    speed_mm_s = np.repeat(JOINT_SPEEDS_MM_S, len(once) * _JOINT_REVERSALS) * place.share
    return Turn(
        position_mm=position_mm,
        rotation=fr.rotation_from_quaternion(quaternion),
        speed_mm_s=speed_mm_s,
        cdis_mm=np.where(stops, 0.0, np.round(blend_mm, 3)),
        wait_s=np.where(stops, _REST_S, 0.0),
    )


def _lever_mm(joint: int, pose: Pose, place: Place, cell: Cell) -> float:
    """Return how far the tip moves for a turn of a joint, mm/rad."""
    jacobian = robot.jacobian(pose.q_rad[None], cell, place.tool)[0]
    return float(np.linalg.norm(jacobian[:3, joint]))
