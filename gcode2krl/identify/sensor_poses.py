"""Readings of an unloaded force sensor in several orientations, read from CSV."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.errors import input_error
from gcode2krl.identify.arm_frames import joint_frames
from gcode2krl.identify.measurements import ANGLES, FORCE, MOMENT
from gcode2krl.identify.table_file import FIRST_ROW, MeasuredTable
from gcode2krl.units import RAD_PER_DEG

ABC = ("a_deg", "b_deg", "c_deg")
QUATERNION = ("qx", "qy", "qz", "qw")
_UNIT = 1e-3


@dataclass(frozen=True)
class SensorPoses:
    """Readings of an unloaded sensor; a row for each orientation."""

    rotation: Floats
    """(n, 4) unit quaternions x, y, z, w of the sensor frame in the robot root."""
    force_N: Floats
    """(n, 3) along the sensor's axes."""
    moment_Nmm: Floats
    """(n, 3) about its origin."""
    source: str = ""


def read_poses(path: str | Path, cell: Cell) -> SensorPoses:
    """Read orientations and readings of a sensor from CSV.

    Columns: fx_N … mz_Nmm, and the orientation of the sensor frame in the robot root as a_deg, b_deg, c_deg
    or as qx, qy, qz, qw, or the joint angles q1_deg … q6_deg (the sensor then is parallel to the flange).

    Raises
    ------
    NotUnderstoodError
        Names file, row and column.
    """
    table = MeasuredTable(path)
    table.require([*FORCE, *MOMENT])
    if table.has(QUATERNION):
        rotation = _unit(table)
    elif table.has(ABC):
        abc = table.numbers(ABC) * RAD_PER_DEG
        rotation = fr.quaternion_from_rotation(fr.rotation_from_abc(abc))
    elif table.has(ANGLES):
        frames = joint_frames(table.numbers(ANGLES) * RAD_PER_DEG, cell)
        rotation = fr.quaternion_from_rotation(frames[:, VIRTUAL_JOINTS.index("sensor"), :3, :3])
    else:
        raise input_error(
            "table-column",
            f"no orientation; the file has {', '.join(table.columns[:12])}",
            f"columns {', '.join(ABC)}, or {', '.join(QUATERNION)}, or {ANGLES[0]} … {ANGLES[-1]}",
            line=1,
            source=table.source,
        )
    return SensorPoses(rotation, table.numbers(FORCE), table.numbers(MOMENT), table.source)


def _unit(table: MeasuredTable) -> Floats:
    quaternion = table.numbers(QUATERNION)
    length = np.linalg.norm(quaternion, axis=1)
    wrong = np.flatnonzero(np.abs(length - 1.0) > _UNIT)
    if len(wrong):
        row = int(wrong[0]) + FIRST_ROW
        raise input_error(
            "table-number",
            f"row {row}, columns {', '.join(QUATERNION)}: length {length[wrong[0]]:.4g}, allowed: 1",
            "x, y, z, w of a unit quaternion",
            line=row,
            source=table.source,
        )
    unit: Floats = quaternion / length[:, None]
    return unit
