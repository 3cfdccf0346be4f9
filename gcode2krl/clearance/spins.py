"""How free arm and spindle are at single poses, which decides the turn about the tool axis; and a map of it.

The cutter and its holder are round: whether they hit something does not depend on the turn, so they are left
out but for the arm itself.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl import program, robot
from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import at_rest, standing
from gcode2krl.clearance.beside import watch_of
from gcode2krl.tables import Joints, Motion, rows_at
from gcode2krl.units import RAD_PER_DEG, RAD_PER_REV

ENOUGH = 3.0
"""Distance in clearances from which a pose counts as wholly free: a clearance is worth a third of that."""
_MAP_ROWS = 400
_MAP_STEP_RAD = 5.0 * RAD_PER_DEG


def freedom(
    position_mm: Floats,
    rotation: Floats,
    tool: Ints32,
    cell: Cell,
    comfort: Floats,
    external: Floats | None = None,
) -> Floats:
    """Return how free each branch (n, 8) of tool poses is: 0 = touching, -1 = in it, 1 = `ENOUGH` away.

    Poses (n) in ``$BASE`` as seen with the external axes at rest, rotations as quaternions; ``external``
    (n, 6) is where E1 to E6 are, at rest by default. Only branches with a ``comfort`` (n, 8) above 0 are
    looked at, the others are 1; so are all where the cell describes nothing that may be hit.
    """
    free = np.ones((len(position_mm), 8))
    watch = watch_of(cell)
    if watch is None:
        return free
    enough_mm = ENOUGH * cell.collision.clearance_mm
    for number in np.unique(tool).tolist():
        rows = np.flatnonzero(tool == number)
        q_rad = robot.inverse(position_mm[rows], rotation[rows], cell, int(number))
        looked, branch = np.nonzero((comfort[rows] > 0.0) & np.isfinite(q_rad).all(axis=2))
        at = None if external is None else external[rows[looked]]
        gap_mm = watch.poses(q_rad[looked, branch], int(number), enough_mm, at)
        free[rows[looked], branch] = np.where(gap_mm <= 0.0, -1.0, np.minimum(gap_mm / enough_mm, 1.0))
    return free


class SpinMap(NamedTuple):
    """The turn about the tool axis along a motion, and what others would be in the same branch."""

    path_mm: Floats
    """(n,)"""
    spin_rad: Floats
    """(s,) rising, from -pi."""
    comfort: Floats
    """(s, n) 1 = 30° from limits and singularities, 0 = at one, -1 = impossible."""
    free: Floats
    """(s, n) as `freedom`."""
    chosen_rad: Floats
    """(n,)"""


def spin_map(motion: Motion, joints: Joints, cell: Cell) -> SpinMap:
    """Return the map of a motion, at up to 400 of its samples and every 5 degrees.

    Where external axes move, the turn is that which the robot sees.
    """
    moves = bool(cell.external) and bool((motion.external != motion.external[0]).any())
    if cell.external and not moves:
        cell = standing(cell, motion.external[0])
    rows = np.unique(np.linspace(0, len(motion) - 1, min(_MAP_ROWS, len(motion))).astype(np.int64))
    rows = rows[np.isfinite(joints.q_rad[rows]).all(axis=1)]
    shown, q_rad = rows_at(motion, rows), joints.q_rad[rows]
    if moves:
        position, rotation = at_rest(shown.position_mm, shown.rotation, shown.external, cell)
        shown = replace(shown, position_mm=position, rotation=rotation)
    turned = fr.rotation_from_quaternion(np.ascontiguousarray(shown.rotation))
    axis, x = turned[:, :, 2], turned[:, :, 0]
    start = fr.rotation_from_quaternion(program.tool_rotation(axis, 0.0))
    chosen = np.arctan2(np.einsum("ni,ni->n", x, start[:, :, 1]), np.einsum("ni,ni->n", x, start[:, :, 0]))
    branch = _branches(shown, q_rad, cell)
    spins = np.arange(-np.pi, np.pi - 1e-9, _MAP_STEP_RAD)
    comfort, free = np.empty((2, len(spins), len(rows)))
    own = np.arange(len(rows)), branch
    for k, spin in enumerate(spins):
        rotation = program.tool_rotation(axis, float(spin))
        pose = (shown.position_mm, rotation, shown.tool, cell)
        quality = np.full((len(rows), 8), -1.0)
        quality[own] = robot.pose_quality(*pose)[own]
        comfort[k] = quality[own]
        free[k] = freedom(*pose, quality, shown.external if moves else None)[own]
    return SpinMap(shown.path_mm, spins, comfort, free, chosen)


def _branches(motion: Motion, q_rad: Floats, cell: Cell) -> Ints32:
    """Return the number (n,) of the branch that joints (n, 6) are in, whatever their whole turns."""
    found = np.zeros(len(q_rad), dtype=np.int32)
    for number in np.unique(motion.tool).tolist():
        rows = np.flatnonzero(motion.tool == number)
        all_rad = robot.inverse(motion.position_mm[rows], motion.rotation[rows], cell, int(number))
        apart = np.abs((all_rad - q_rad[rows, None] + np.pi) % RAD_PER_REV - np.pi).max(axis=2)
        found[rows] = np.nanargmin(np.where(np.isnan(apart), np.inf, apart), axis=1)
    return found
