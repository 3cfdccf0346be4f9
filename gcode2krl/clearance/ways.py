"""The ways of a program that its Motion does not show, or models otherwise, taken from the targets.

Before its first and behind its last programmed target, PTP, and beside a PTP the lines that belong to the
same row of the Toolpath. PTP goes straight in the joints; how fast each of them is does not matter.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gcode2krl import robot
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.checked_parts import checks_collisions
from gcode2krl.clearance.proposals import ptp_way
from gcode2krl.compiled.inputs import distinct
from gcode2krl.tables import Targets

BEHIND_ALL = int(np.iinfo(np.int32).max)


class Beside(NamedTuple):
    """A way that a Motion does not show, with the joints along it."""

    row: int
    """Target that it leads to."""
    line: int
    words: str
    """Which one, `` on the PTP to HOME``."""
    tool: int
    q_rad: Floats
    """(n, 6)"""
    external: Floats
    """(n, 6) E1 to E6."""
    is_ptp: bool
    is_uncut: bool
    """Nothing has been cut before it."""
    before: int
    """Row of the Toolpath whose samples come next; `BEHIND_ALL` behind the last."""


def ways_beside(targets: Targets, q_rad: Floats, cell: Cell) -> Iterator[Beside]:
    """Yield the ways from the joints (p, 6) at targets, none where the cell is not checked for collisions.

    Those from or to where no joints are known are left out.
    """
    if not checks_collisions(cell) or not cell.robot.geometry.known:
        return
    line, owner = targets.source_line, _owners(targets.move)
    programmed = np.flatnonzero(targets.move >= 0)
    for row in np.flatnonzero(shown_otherwise(targets)).tolist():
        start, end = q_rad[max(row - 1, 0)], q_rad[row]
        if row == 0 or np.isnan(start).any() or np.isnan(end).any():
            continue  # out of reach is a finding of its own
        is_ptp = bool(targets.ptp[row])
        way = ptp_way(start, end) if is_ptp else _line(targets, row, start, cell)
        stood, stands = targets.external[row - 1 : row + 1]
        before = np.flatnonzero(line[:row])
        yield Beside(
            row=row,
            line=int(line[row]) or (int(line[before[-1]]) if len(before) else 0),
            words=_words(targets, row, programmed),
            tool=int(targets.tool[row]),
            q_rad=way,
            external=stood + np.linspace(0.0, 1.0, len(way))[:, None] * (stands - stood),
            is_ptp=is_ptp,
            is_uncut=row <= programmed[0] and targets.restart is None,
            before=int(owner[row]) if row <= programmed[-1] else BEHIND_ALL,
        )


def shown_otherwise(targets: Targets) -> Bools:
    """Mark the targets (p) whose motion is not that of the Motion: before and behind it, PTP, and beside PTP.

    Beside a PTP are the lines that belong to the same row of the Toolpath, as a Motion tells its samples by
    that row alone.
    """
    programmed = np.flatnonzero(targets.move >= 0)
    first, last = int(programmed[0]), int(programmed[-1])
    place = np.arange(len(targets))
    outside = (place <= first) | (place > last)
    owner = _owners(targets.move)
    with_ptp = np.unique(owner[targets.ptp & ~outside])
    marked: Bools = outside | targets.ptp | np.isin(owner, with_ptp)
    return marked


def moves_watched_at_targets(targets: Targets) -> Ints32:
    """Return the rows of the Toolpath whose samples in a Motion are not the way that the robot goes."""
    programmed = np.flatnonzero(targets.move >= 0)
    inside = np.zeros(len(targets), dtype=np.bool_)
    inside[programmed[0] + 1 : programmed[-1] + 1] = True
    return distinct(_owners(targets.move)[targets.ptp & inside])


def _owners(move: Ints32) -> Ints32:
    """Return the row of the Toolpath (p,) of each motion; added motions have that of the next one."""
    programmed = np.flatnonzero(move >= 0)
    after = np.minimum(np.searchsorted(programmed, np.arange(len(move))), len(programmed) - 1)
    owner: Ints32 = move[programmed[after]]
    return owner


def _line(targets: Targets, row: int, start_rad: Floats, cell: Cell) -> Floats:
    return np.concatenate([start_rad[None], robot.line_angles(targets, row, start_rad, cell)])


def _words(targets: Targets, row: int, programmed: Ints) -> str:
    if targets.home[row]:
        return " on the PTP to HOME"
    if targets.ptp[row]:
        return " on the PTP from HOME" if targets.home[row - 1] else " on a PTP"
    if row <= programmed[0]:
        return " on the approach"
    return " on the retract" if row > programmed[-1] else ""
