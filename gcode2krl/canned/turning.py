"""Poses that G-code of three axes cannot say: tilts about a point, and moves of a single joint."""

from dataclasses import dataclass

import numpy as np

from gcode2krl import frames as fr
from gcode2krl import robot
from gcode2krl.arrays import Floats
from gcode2krl.canned.place import ProgramPlace
from gcode2krl.cell import Cell
from gcode2krl.units import RAD_PER_DEG

TILTS: tuple[tuple[tuple[float, float, float], tuple[float, ...]], ...] = (
    ((0.0, 0.0, 1.0), (30.0, 15.0)),
    ((0.0, 0.0, -1.0), (30.0, 15.0)),
    ((0.0, 1.0, 0.0), (30.0, 15.0)),
    ((0.0, -1.0, 0.0), (30.0, 15.0)),
    ((1.0, 0.0, 0.0), (90.0, 60.0, 30.0)),
    ((-1.0, 0.0, 0.0), (90.0, 60.0, 30.0)),
)
"""Directions as A, B, C about the tool's axes, and by how many degrees the tool turns: the first angle that
keeps clear of limits and of the wrist's singularity, else the last. Every angle parts a tool's error from a
frame's; a wide one also what looks nearly the same within a few degrees, as an angle of A6 and an eccentric
A6 do."""
_CLEAR_RAD = 10.0 * RAD_PER_DEG
"""From limits, and of A5 from zero."""
_WAY = np.linspace(0.0, 1.0, 7)[1:]
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


def tilts(pose: Pose, place: ProgramPlace, cell: Cell) -> Turn:
    """Return turns of the tool about its tip, each from the pose and back to it.

    Half of each turn is made on the way up and half on the way down: on the spot it would be as fast as the
    wrist can.
    """
    position_mm, rotation = [], []
    above_mm = pose.position_mm + np.array([0.0, 0.0, _LIFT_MM])
    for direction, angles_deg in TILTS:
        tilt = _widest(np.array(direction), np.array(angles_deg) * RAD_PER_DEG, pose, place, cell)
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


def _widest(direction: Floats, angles_rad: Floats, pose: Pose, place: ProgramPlace, cell: Cell) -> Floats:
    """Return the first tilt A, B, C (3,) in rad whose way is clear, or the last one."""
    for angle_rad in angles_rad[:-1]:
        if _is_clear(angle_rad * direction, pose, place, cell):
            return np.asarray(angle_rad * direction)
    return np.asarray(angles_rad[-1] * direction)


def _is_clear(tilt_rad: Floats, pose: Pose, place: ProgramPlace, cell: Cell) -> bool:
    """Tell whether a tilt about the tip stays in the pose's branch, off its limits and its singularity."""
    rotation = pose.rotation @ fr.rotation_from_abc(_WAY[:, None] * tilt_rad)
    quaternion = fr.quaternion_from_rotation(np.concatenate([pose.rotation[None], rotation]))
    position_mm = np.repeat(pose.position_mm[None], len(quaternion), axis=0)
    branches = robot.inverse(position_mm, quaternion, cell, place.tool)
    off = branches[0] - pose.q_rad
    branch = int(np.nanargmin(np.abs(np.sin(off / 2.0)).sum(axis=1)))
    q_rad = np.unwrap(np.concatenate([pose.q_rad[None], branches[1:, branch]]), axis=0)
    if not np.isfinite(q_rad).all() or (np.abs(q_rad[:, 4]) < _CLEAR_RAD).any():
        return False
    limits_deg = cell.robot.limits.q_deg
    if limits_deg is None:
        return True
    low, high = (np.array(limits_deg) * RAD_PER_DEG).T
    return bool((q_rad > low + _CLEAR_RAD).all() and (q_rad < high - _CLEAR_RAD).all())


def joint_reversals(joint: int, pose: Pose, place: ProgramPlace, cell: Cell) -> Turn:
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


def _lever_mm(joint: int, pose: Pose, place: ProgramPlace, cell: Cell) -> float:
    """Return how far the tip moves for a turn of a joint, mm/rad."""
    jacobian = robot.jacobian(pose.q_rad[None], cell, place.tool)[0]
    return float(np.linalg.norm(jacobian[:3, joint]))
