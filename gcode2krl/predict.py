"""The pipeline, and whatever needs two stages: targets with their spin search, joints of targets."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcode2krl import program, robot
from gcode2krl.cell import Cell
from gcode2krl.errors import input_error
from gcode2krl.tables import Joints, Targets, Toolpath
from gcode2krl.units import RAD_PER_DEG

Floats = NDArray[np.float64]


def set_targets(toolpath: Toolpath, cell: Cell, tolerance_mm: float | None = None) -> Targets:
    """Return what the KRL program will say: poses, spin about the tool axis, CDIS, speeds, stops.

    ``tolerance_mm`` is the blend tolerance at corners: below ``G64 P``, above the cell's own. The findings
    of the G-code, of the cell and of the robot (reach, limits, singularities) travel with the table; the
    writer refuses what is an error.

    Raises
    ------
    NotUnderstoodError
        Where the program has no motion, or the tolerance is not positive.
    """
    if tolerance_mm is not None and not (np.isfinite(tolerance_mm) and tolerance_mm > 0):
        raise input_error("option-value", f"tolerance {tolerance_mm} mm is not positive")
    targets = program.plan_targets(toolpath, cell, _home_pose(cell), _spin_of(cell), tolerance_mm)
    _, findings = robot.follow(targets, cell)
    return replace(targets, issues=(*targets.issues, *findings))


def solve_joints(targets: Targets, cell: Cell) -> Joints:
    """Return the joints at each target: one branch for the whole program, KUKA's signs, S and T.

    ``qd_rad_s`` is NaN; findings on reach, limits and singularities are in ``issues``.
    """
    joints, findings = robot.follow(targets, cell)
    return replace(joints, issues=findings)


def _home_pose(cell: Cell) -> Callable[[int], tuple[Floats, Floats]]:
    def home_pose(tool: int) -> tuple[Floats, Floats]:
        position, rotation = robot.forward(cell.home_q_rad(), cell, tool)
        return position[0], rotation[0]

    return home_pose


def _spin_of(cell: Cell) -> Callable[[Floats, Floats, NDArray[np.int32]], Floats | float]:
    spin = cell.frames.spin
    if spin != "auto":
        return lambda position, axis, tool: float(spin) * RAD_PER_DEG

    def automatic(position: Floats, axis: Floats, tool: NDArray[np.int32]) -> Floats | float:
        def quality(rows: NDArray[np.int64], spin_rad: float) -> Floats:
            rotation = program.tool_rotation(axis[rows], spin_rad)
            return robot.pose_quality(position[rows], rotation, tool[rows], cell)

        return program.smooth_spin(position, quality)

    return automatic
