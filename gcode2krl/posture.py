"""How good poses are, wherever the external axes stand: far from limits and obstacles, and stiff.

Of a turn about the tool axis that is searched the best one counts.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gcode2krl import compliance, program, robot
from gcode2krl import frames as fr
from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import at_rest, standing
from gcode2krl.clearance import freedom
from gcode2krl.units import RAD_PER_DEG

_HITS = -0.9
"""Quality of a pose that hits something, but for half its comfort: above that of one that is out of reach."""
_ACROSS_N = 100.0
_TRIED_SPINS = np.arange(-180.0, 180.0, 30.0) * RAD_PER_DEG


class Poses(NamedTuple):
    """Poses of the tool in ``$BASE``."""

    position_mm: Floats
    """(n, 3)"""
    rotation: Floats
    """(n, 4) quaternions."""
    tool: Ints32
    """(n,)"""

    def at(self, rows: Ints) -> "Poses":
        """Return those at rows."""
        return Poses(self.position_mm[rows], self.rotation[rows], self.tool[rows])


def quality_at(poses: Poses, external: Floats, cell: Cell, *, table_follows: bool) -> Floats:
    """Return the quality (r, 8) of poses with the external axes at (r, 6), in the best turn."""
    there, position, turned = _turned_at(poses, external, cell, table_follows)
    at, tool = None if is_one(external) else external, poses.tool
    best: Floats = np.max([quality_of(position, each, tool, there, at) for each in turned], axis=0)
    return best


def bending_at(poses: Poses, external: Floats, cell: Cell, *, table_follows: bool) -> Floats:
    """Return how far each branch (r, 8) bends with the external axes at (r, 6), in the stiffest turn."""
    there, position, turned = _turned_at(poses, external, cell, table_follows)
    tool = poses.tool
    axes = ((each, fr.rotation_from_quaternion(each)[:, :, 2]) for each in turned)
    stiffest: Floats = np.fmin.reduce([bending_mm(position, each, axis, tool, there) for each, axis in axes])
    return stiffest


def _turned_at(
    poses: Poses, external: Floats, cell: Cell, table_follows: bool
) -> tuple[Cell, Floats, Iterator[Floats]]:
    """Return the cell with external axes at (r, 6), positions (r, 3) in it, and the orientations to try."""
    position, rotation = poses.position_mm, poses.rotation
    if is_one(external):
        there = standing(cell, external[0])
    else:
        there = cell
        position, rotation = at_rest(position, rotation, external, cell)
    spin = cell.frames.spin
    if not isinstance(spin, str) and not table_follows:
        return there, position, iter([rotation])
    axis = fr.rotation_from_quaternion(rotation)[:, :, 2]
    tried = _TRIED_SPINS if isinstance(spin, str) else np.array([spin * RAD_PER_DEG])
    return there, position, (program.tool_rotation(axis, float(each)) for each in tried)


def quality_of(
    position: Floats, rotation: Floats, tool: Ints32, cell: Cell, external: Floats | None
) -> Floats:
    """Return how far from limits, singularities and obstacles each branch (n, 8) is, the worst of them.

    Poses as the robot sees them; ``external`` (n, 6) is where E1 to E6 are, at rest where None.
    """
    plain = robot.pose_quality(position, rotation, tool, cell)
    free = freedom(position, rotation, tool, cell, plain, external)
    return np.where((free < 0.0) & (plain >= 0.0), _HITS + 0.5 * plain, np.minimum(plain, free))


def bending_mm(position: Floats, rotation: Floats, axis: Floats, tool: Ints32, cell: Cell) -> Floats:
    """Return how far each branch (n, 8) bends under a load of 100 N across the tool, whichever way it points.

    The root mean square over all directions across the axis; NaN where a branch has no solution.
    """
    across = np.cross(axis, np.where(np.abs(axis[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    result = np.full((len(position), 8), np.nan)
    for number in np.unique(tool):
        rows = np.flatnonzero(tool == number)
        q = robot.inverse(position[rows], rotation[rows], cell, int(number)).reshape(-1, 6)
        square = np.zeros(len(q))
        for direction in (across[rows], np.cross(axis[rows], across[rows])):
            load_N = np.repeat(_ACROSS_N * direction, 8, axis=0)
            bent_mm, _ = compliance.deflection_of(q, load_N, np.zeros(3), np.zeros(3), cell, int(number))
            square += np.einsum("ij,ij->i", bent_mm, bent_mm)
        result[rows] = np.sqrt(square / 2.0).reshape(-1, 8)
    return result


def is_one(external: Floats) -> bool:
    """Tell whether E1 to E6 (r, 6) are the same in all rows."""
    return external.strides[0] == 0 or bool((external == external[0]).all())
