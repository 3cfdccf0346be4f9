"""How good poses of the tool are, each of the eight branches by itself, and which of two is the better one.

A pose out of reach is worse than any in which something is hit, and that is worse than any that is free; of
poses of one kind the one farther from limits, singularities and obstacles is better. How far the robot bends
is found apart from that, at the few poses that are in question: it takes longer than all the rest.
"""

from collections.abc import Callable
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from gcode2krl import compliance, robot
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.clearance import watch_of
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.inputs import distinct
from gcode2krl.frames import rotation_from_quaternion
from gcode2krl.units import RAD_PER_DEG

Choice = TypeVar("Choice")
COMFORTABLE_RAD = 30.0 * RAD_PER_DEG
"""Distance from joint limits and singularities from which nothing is gained by more."""
ENOUGH = 3.0
"""Distance from obstacles from which nothing is gained by more, in clearances."""
_ACROSS_N = 100.0
_ROWS = 8192


class Poses(NamedTuple):
    """Poses of the tool as the robot sees them: in ``$BASE``, with the external axes at rest."""

    position_mm: Floats
    """(n, 3)"""
    rotation: Floats
    """(n, 4) quaternions."""
    tool: Ints32
    """(n,)"""
    external: Floats | None = None
    """(n, 6) where E1 to E6 really are, which is what obstacles depend on; None at rest."""


class Quality(NamedTuple):
    """How good poses are: columns of one shape, the last axis of most are the eight branches."""

    reachable: Bools
    """The arm gets there, within its joint limits."""
    collides: Bools
    """Arm or spindle hit something there."""
    margin: Floats
    """1 = 30° and more from limits and singularities, three clearances and more from obstacles; 0 = at one.
    Where something is hit, half of that of limits and singularities: how deep is not known."""

    def rank(self) -> Any:
        """Return the kind of each pose: 0 out of reach, 1 hits something, 2 free."""
        return self.reachable.astype(np.int8) + (self.reachable & ~self.collides)

    def free_margin(self) -> Floats:
        """Return the margin of poses that are free, -1 of all others."""
        return np.where(self.reachable & ~self.collides, self.margin, -1.0)

    def map(self, of: Callable[[Any], Any]) -> "Quality":
        """Return the columns with a function of an array applied to each."""
        return Quality(*map(of, self))

    def at(self, index: Any) -> "Quality":
        """Return the columns at an index of theirs."""
        return self.map(lambda column: column[index])

    def worst(self, axis: int) -> "Quality":
        """Return the worst of the poses along an axis."""
        return self._extreme(np.minimum, axis, np.inf)

    def best(self, axis: int) -> "Quality":
        """Return the best of the poses along an axis."""
        return self._extreme(np.maximum, axis, -np.inf)

    def _extreme(self, extreme: np.ufunc, axis: int, out_of_question: float) -> "Quality":
        rank = self.rank()
        of_all = extreme.reduce(rank, axis=axis, keepdims=True)
        margin = extreme.reduce(np.where(rank == of_all, self.margin, out_of_question), axis=axis)
        kind = of_all.squeeze(axis)
        return Quality(kind > 0, kind == 1, margin)


class Judge(NamedTuple, Generic[Choice]):
    """What judges choices at rows (r,) of a path: turns about the tool axis, or places of external axes."""

    quality: Callable[[Ints, Choice], Quality]
    """(r, 8)"""
    bending_mm: Callable[[Ints, Choice], Floats] | None = None
    """(r, 8), NaN out of reach; None where stiffness does not count."""
    coupling: Callable[[Ints, Choice], Floats] | None = None
    """(r, 8) index of mode coupling of a usual cut, see `chatter`; None where nothing is known of cuts."""


def stacked(qualities: list[Quality]) -> Quality:
    """Return qualities of one shape as one, along a new first axis."""
    return Quality(*(np.stack(columns) for columns in zip(*qualities, strict=True)))


def quality_of(poses: Poses, cell: Cell) -> Quality:
    """Return the quality (n, 8) of poses in each branch."""
    q_rad, count = np.empty((len(poses.tool), 8, 6)), len(poses.tool)

    def solve(start: int, end: int) -> None:
        rows = slice(start, end)
        q_rad[rows] = robot.inverse(poses.position_mm[rows], poses.rotation[rows], cell, poses.tool[rows])

    in_chunks(solve, chunk_borders(count, _ROWS))
    external = None if poses.external is None else np.repeat(poses.external, 8, axis=0)
    flat = quality_at(q_rad.reshape(-1, 6), np.repeat(poses.tool, 8), external, cell)
    return flat.map(lambda column: column.reshape(count, 8))


def quality_at(q_rad: Floats, tool: Ints32, external: Floats | None, cell: Cell) -> Quality:
    """Return the quality (k,) of joints (k, 6), each in the best of its whole turns; NaN is out of reach."""
    margin, reachable = np.zeros(len(q_rad)), np.zeros(len(q_rad), dtype=np.bool_)

    def judge(start: int, end: int) -> None:
        limit_rad, sine = robot.pose_margins(q_rad[start:end], cell)
        reachable[start:end] = limit_rad >= 0.0  # NaN is not
        comfort = np.minimum(np.minimum(limit_rad / COMFORTABLE_RAD, 1.0), 2.0 * sine)
        margin[start:end] = np.where(reachable[start:end], comfort, 0.0)

    in_chunks(judge, chunk_borders(len(q_rad), _ROWS))
    collides, watch = np.zeros(len(q_rad), dtype=np.bool_), watch_of(cell)
    if watch is None:
        return Quality(reachable, collides, margin)
    enough_mm = ENOUGH * cell.collision.clearance_mm
    for number in distinct(tool).tolist():
        rows = np.flatnonzero((tool == number) & (margin > 0.0))
        gap_mm = watch.poses(q_rad[rows], number, enough_mm, None if external is None else external[rows])
        collides[rows] = gap_mm <= 0.0
        plain = margin[rows]
        margin[rows] = np.where(gap_mm <= 0.0, 0.5 * plain, np.minimum(plain, gap_mm / enough_mm))
    return Quality(reachable, collides, margin)


def bending_mm(poses: Poses, cell: Cell) -> Floats:
    """Return how far each branch (n, 8) bends under a load of 100 N across the tool, whichever way it points.

    The root mean square over all directions across the axis; NaN where a branch has no solution.
    """
    axis = rotation_from_quaternion(poses.rotation)[:, :, 2]
    across = np.cross(axis, np.where(np.abs(axis[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    result = np.full((len(poses.tool), 8), np.nan)
    for number in distinct(poses.tool).tolist():
        rows = np.flatnonzero(poses.tool == number)
        q = robot.inverse(poses.position_mm[rows], poses.rotation[rows], cell, number).reshape(-1, 6)
        square = np.zeros(len(q))
        for direction in (across[rows], np.cross(axis[rows], across[rows])):
            load_N = np.repeat(_ACROSS_N * direction, 8, axis=0)
            bent_mm, _ = compliance.deflection_of(q, load_N, np.zeros(3), np.zeros(3), cell, number)
            square += np.einsum("ij,ij->i", bent_mm, bent_mm)
        result[rows] = np.sqrt(square / 2.0).reshape(-1, 8)
    return result
