"""Poses with external axes as the arm sees them: in ``$BASE`` with every external axis at rest.

The arm does not know whether its rail or the part moves: a pose of the tool in ``$BASE`` while E1 to E6
stand somewhere is one more pose in ``$BASE`` at rest, and everything behind it (joints, limits,
singularities) is as without external axes.
"""

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.cell.definition import Cell
from gcode2krl.cell.sections.external import EXTERNAL_NAMES
from gcode2krl.errors import Issue, RefusedError


def to_rest(external: Floats, cell: Cell) -> Floats | None:
    """Return what takes poses in ``$BASE`` to those at rest: (n, 4, 4), one (1, 4, 4) where all are alike.

    ``external`` (n, 6) in mm and degrees. None where every axis rests.
    """
    if not cell.external or not len(external):
        return None
    alike = external.strides[0] == 0 or bool((external == external[0]).all())
    at = external[:1] if alike else external
    if alike and np.array_equal(at[0], cell.external_rest()):
        return None
    return np.asarray(fr.invert(cell.base_matrix()) @ cell.base_in_root(at))


def standing(cell: Cell, external: Floats) -> Cell:
    """Return the cell whose external axes stand at E1 to E6 (6,) and stay there."""
    axes = {
        name: axis.model_copy(update={"position": float(external[EXTERNAL_NAMES.index(name)])})
        for name, axis in cell.external.items()
    }
    return cell.model_copy(update={"external": axes})


def stays(cell: Cell, external: Floats, what: str) -> Cell:
    """Return the cell whose external axes stand where E1 to E6 (n, 6) have them throughout.

    Raises `RefusedError` where they move, and ``what`` does not know of that.
    """
    if not cell.external or not len(external):
        return cell
    moves = [name for name in sorted(cell.external) if np.ptp(external[:, EXTERNAL_NAMES.index(name)]) > 0.0]
    if moves:
        raise RefusedError(_moving(moves[0], what, "the program moves"))
    return standing(cell, external[0])


def require_still(cell: Cell, what: str, *, rails: bool = True) -> None:
    """Raise `RefusedError` where external axes may move and ``what`` does not know; without rails, tables."""
    free = [
        name for name, axis in sorted(cell.external.items()) if axis.moves and (rails or not axis.is_rail)
    ]
    if free:
        raise RefusedError(_moving(free[0], what, "a program may move"))


def _moving(name: str, what: str, moves: str) -> Issue:
    sentence = f"{what} needs external axes that stay where they are, and {moves} {name}"
    return Issue("error", "external-moves", 0, sentence, f"state [external.{name}] position")


def at_rest(position_mm: Floats, rotation: Floats, external: Floats, cell: Cell) -> tuple[Floats, Floats]:
    """Return tool poses in ``$BASE``, positions (n, 3) and quaternions (n, 4), as seen at rest."""
    return moved(position_mm, rotation, to_rest(external, cell))


def from_rest(position_mm: Floats, rotation: Floats, external: Floats, cell: Cell) -> tuple[Floats, Floats]:
    """Return poses that are seen at rest as those in ``$BASE`` where the external axes stand."""
    by = to_rest(external, cell)
    return moved(position_mm, rotation, None if by is None else fr.invert(by))


def moved(position_mm: Floats, rotation: Floats, by: Floats | None) -> tuple[Floats, Floats]:
    """Return poses moved by frames (n, 4, 4) or (1, 4, 4); None moves nothing."""
    if by is None:
        return position_mm, rotation
    position, turn = points_moved(position_mm, by), by[:, :3, :3]
    if np.abs(turn - np.eye(3)).max() < 1e-15:  # rails alone: the orientation stays one column in memory
        return position, rotation
    turned = turn @ fr.rotation_from_quaternion(rotation)
    return position, fr.quaternion_from_rotation(turned)


def points_moved(position_mm: Floats, by: Floats) -> Floats:
    """Return points (n, 3) moved by frames (n, 4, 4) or (1, 4, 4)."""
    return np.asarray(vectors_turned(position_mm, by) + by[:, :3, 3])


def vectors_turned(vector: Floats, by: Floats) -> Floats:
    """Return vectors (n, 3) turned by frames (n, 4, 4) or (1, 4, 4)."""
    turned: Floats = np.einsum("nij,nj->ni", np.broadcast_to(by[:, :3, :3], (len(vector), 3, 3)), vector)
    return turned
