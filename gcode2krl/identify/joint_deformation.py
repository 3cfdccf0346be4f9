"""Angles and moment of the virtual joint between a pair of measuring cubes.

The transform from the lower to the upper cube is A·B unloaded and A·R*·B loaded, with A from the lower cube
to the joint's frame and B from there to the upper cube; so R* = A⁻¹·(loaded)·B⁻¹, the transform from G_i^l to
G_i^l* of Hähn & Weigold 2020, fig. 6, exact for finite angles. Joints between the same cubes whose stiffness
is known are part of A and B, turned by the load.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS, VirtualJoint
from gcode2krl.errors import input_error
from gcode2krl.identify.arm_frames import joint_frames
from gcode2krl.identify.cubes import carried, motion_covariance, motion_of
from gcode2krl.identify.measurements import Cube, Measurements, Setup
from gcode2krl.units import RAD_PER_DEG

Known = dict[str, tuple[VirtualJoint, str]]
"""Stiffness taken as known, and its source."""


class Load(NamedTuple):
    """A test load along the axes of the robot root, (m, 3) each."""

    force_N: Floats
    point_mm: Floats
    """Where the force acts."""
    moment_Nmm: Floats
    """In addition to that of the force."""


@dataclass(frozen=True)
class JointReadings:
    """Readings of one pair of cubes, along the axes of the joint's frame."""

    row: Ints
    """(m,) lines in the file."""
    angle_rad: Floats
    """(m, 3) about x, y and z, eq. 4."""
    offset_mm: Floats
    """(m, 3) translation at the joint's origin: 0 in the model."""
    moment_Nmm: Floats
    """(m, 3) of the load on the joint, eq. 5-6."""
    covariance: Floats
    """(m, 6, 6) of angles and offset for 1 mm noise of a distance."""


def joint_readings(
    pair: str, joint: str, known: Known, measurements: Measurements, cell: Cell
) -> JointReadings:
    """Return the deformation of a pair's joint for each of its rows.

    Parameters
    ----------
    pair : its name in the head of the measurements.
    joint : the virtual joint whose deformation is sought; others between the two cubes must be in `known`.

    Raises
    ------
    NotUnderstoodError
        No point of the load in head and cell; six distances that are not a motion.
    """
    setup = measurements.setup
    at = np.flatnonzero(measurements.pair == pair)
    frames = joint_frames(measurements.q_rad[at], cell)
    load = _load(measurements, at, frames, cell)
    joint_frame = frames[:, VIRTUAL_JOINTS.index(joint)]
    cubes = setup.pair[pair]
    lower, upper = (_cube_pose(setup.cube[name], frames, setup, cell) for name in (cubes.lower, cubes.upper))
    below, above = _turns_of_known(joint, setup.joints_between(pair), known, frames, load)
    before, after = fr.invert(lower) @ below @ joint_frame, fr.invert(joint_frame) @ above @ upper
    moved = [
        _motion(change[at], measurements, at) for change in (measurements.lower_mm, measurements.upper_mm)
    ]
    loaded = fr.invert(moved[0]) @ fr.invert(lower) @ upper @ moved[1]
    deformed = fr.invert(before) @ loaded @ fr.invert(after)
    noise = motion_covariance(setup.lasers.layout())
    of_lower, of_upper = carried(fr.invert(before)), carried(after)
    covariance = of_lower @ noise @ of_lower.swapaxes(1, 2) + of_upper @ noise @ of_upper.swapaxes(1, 2)
    angle = fr.abc_from_rotation(deformed[:, :3, :3])[:, ::-1]  # R* = Rz·Ry·Rx, eq. 4
    return JointReadings(
        measurements.row[at], angle, deformed[:, :3, 3], _moment(joint_frame, load), np.asarray(covariance)
    )


def _turns_of_known(
    joint: str, between: tuple[str, ...], known: Known, frames: Floats, load: Load
) -> tuple[Floats, Floats]:
    """Return the motions (m, 4, 4) of the known joints below and above the sought one, in the root."""
    below = above = np.broadcast_to(np.eye(4), (len(frames), 4, 4))
    for name in between:  # from the root outwards: each turns what follows
        if name == joint:
            continue
        frame = frames[:, VIRTUAL_JOINTS.index(name)]
        k = np.array([known[name][0].k_c, known[name][0].k_b, known[name][0].k_a])
        rotation = fr.rotation_from_abc((_moment(frame, load) / k)[:, ::-1])  # eq. 4 and 7
        turn = frame @ fr.transform(np.zeros(3), rotation) @ fr.invert(frame)
        if VIRTUAL_JOINTS.index(name) < VIRTUAL_JOINTS.index(joint):
            below = below @ turn
        else:
            above = above @ turn
    return below, above


def _load(measurements: Measurements, at: Ints, frames: Floats, cell: Cell) -> Load:
    """Return the load along the axes of the robot root."""
    load = measurements.setup.load
    flange = frames[:, VIRTUAL_JOINTS.index("A6")]
    if load.point_flange_mm is not None:
        point = np.array(load.point_flange_mm)
    else:
        tool = cell.usual_tool
        if tool is None:
            raise input_error(
                "measurement-key",
                "load.point_flange_mm: missing, and the cell has no tool",
                "state the point in the flange frame where the load acts",
                source=measurements.source,
            )
        point = cell.tool_matrix(tool)[:3, 3]
    point_mm = flange[:, :3, :3] @ point + flange[:, :3, 3]
    force, moment = measurements.force_N[at], measurements.moment_Nmm[at]
    if load.along == "flange":
        force, moment = (np.einsum("nij,nj->ni", flange[:, :3, :3], v) for v in (force, moment))
    return Load(force, point_mm, moment)


def _moment(frame: Floats, load: Load) -> Floats:
    """Return the moment (m, 3) of the load on a joint along the axes of its frame, eq. 5-6."""
    total = np.cross(load.point_mm - frame[:, :3, 3], load.force_N) + load.moment_Nmm
    along: Floats = np.einsum("nji,nj->ni", frame[:, :3, :3], total)
    return along


def _cube_pose(cube: Cube, frames: Floats, setup: Setup, cell: Cell) -> Floats:
    """Return the pose (m, 4, 4) of an unloaded cube in the root; it moves with the body it is fixed to."""
    pose = cube.matrix()
    if cube.number() == 0:
        return np.broadcast_to(pose, (len(frames), 4, 4))
    tracked = joint_frames(np.array(setup.tracker.q_deg) * RAD_PER_DEG, cell)[0, cube.number() - 1]
    return frames[:, cube.number() - 1] @ fr.invert(tracked) @ pose


def _motion(change_mm: Floats, measurements: Measurements, at: Ints) -> Floats:
    motion = motion_of(change_mm, measurements.setup.lasers.layout())
    lost = np.flatnonzero(np.isnan(motion[:, 0, 0]))
    if len(lost):
        row = int(measurements.row[at[lost[0]]])
        raise input_error(
            "table-change",
            f"row {row}: its six distances are not those of a moved cube",
            "check the order of the lasers",
            line=row,
            source=measurements.source,
        )
    return motion
