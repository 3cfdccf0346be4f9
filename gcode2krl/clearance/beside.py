"""Collisions on the ways that a Motion does not show.

A Motion is watched while its samples pass by. The ways that are not in it, or that it models otherwise, are
watched at the targets: PTP as straight ways of the joints, and beside each PTP the lines up to the programmed
ones.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gcode2krl import collision, robot
from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import standing
from gcode2krl.cell.checked_parts import checks_collisions
from gcode2krl.clearance.meshes import triangles_of
from gcode2krl.clearance.proposals import Ptp, proposal, ptp_way
from gcode2krl.errors import Issue
from gcode2krl.tables import Targets


class _Added(NamedTuple):
    """A motion that is watched at its target."""

    row: int
    line: int
    words: str


def watch_of(cell: Cell, *, tells: bool = False) -> collision.Watch | None:
    """Return the watch over a program, None where the cell describes nothing that may hit or be hit."""
    if not checks_collisions(cell) or not cell.robot.geometry.known:
        return None
    return collision.Watch(cell, triangles_of, tells=tells)


def collisions_beside(targets: Targets, q_rad: Floats, cell: Cell) -> tuple[Issue, ...]:
    """Return the collisions of all motions that a Motion does not show, from the joints (p, 6) at targets.

    PTP goes straight in the joints; how fast each of them is does not matter.
    """
    watch = watch_of(cell)
    if watch is None:
        return ()
    first = int(np.flatnonzero(targets.move >= 0)[0])
    for added in _added(targets):
        before, after = q_rad[added.row - 1], q_rad[added.row]
        tool = int(targets.tool[added.row])
        if np.isnan(before).any() or np.isnan(after).any():
            continue  # out of reach, which is a finding of its own
        if targets.ptp[added.row]:
            way = ptp_way(before, after)
        else:
            way = np.concatenate([before[None], robot.line_angles(targets, added.row, before, cell)])
        stood, stands = targets.external[added.row - 1 : added.row + 1]
        external = stood + np.linspace(0.0, 1.0, len(way))[:, None] * (stands - stood)
        is_ptp, is_uncut = bool(targets.ptp[added.row]), added.row <= first and targets.restart is None
        held = {"is_ptp": is_ptp, "against_raw": is_uncut, "external": external}
        found = watch.way(way, tool, added.line, added.words, **held)
        if is_ptp and found.hits:
            ptp = Ptp(targets, added.row, before, after)
            watch.advise(added.line, added.words, _advice(ptp, cell, against_raw=is_uncut))
    return watch.issues()


def _advice(ptp: Ptp, cell: Cell, *, against_raw: bool) -> str:
    """Return what would be free instead of a PTP."""
    tool = int(ptp.targets.tool[ptp.row])
    there = standing(cell, ptp.targets.external[ptp.row]) if cell.external else cell

    def is_free(way: Floats) -> bool:
        watch = watch_of(there)
        if watch is None:
            return True
        return not watch.way(way, tool, 0, "", is_ptp=True, against_raw=against_raw).hits

    stays = (ptp.targets.external[ptp.row] == ptp.targets.external[ptp.row - 1]).all()
    found = proposal(ptp, cell, is_free) if stays else ""
    at_home = ptp.targets.home[ptp.row] or ptp.targets.home[ptp.row - 1]
    other = "put HOME elsewhere" if at_home else "cut in another order"
    return found or f"{other}, or move what is hit: no higher [clearance] z_mm or turn of A1 alone is free"


def _added(targets: Targets) -> Iterator[_Added]:
    """Yield the motions into each target that a Motion does not show as they are."""
    line = targets.source_line
    programmed = np.flatnonzero(targets.move >= 0)
    for row in np.flatnonzero(shown_otherwise(targets)).tolist():
        if row == 0:
            continue
        if targets.home[row]:
            words = " on the PTP to HOME"
        elif targets.ptp[row]:
            words = " on the PTP from HOME" if targets.home[row - 1] else " on a PTP"
        elif row <= programmed[0]:
            words = " on the approach"
        else:
            words = " on the retract" if row > programmed[-1] else ""
        before = np.flatnonzero(line[:row])
        known = int(line[row]) or (int(line[before[-1]]) if len(before) else 0)
        yield _Added(row, known, words)


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
    return np.unique(_owners(targets.move)[targets.ptp & inside])


def _owners(move: Ints32) -> Ints32:
    """Return the row of the Toolpath (p,) of each motion; added motions have that of the next one."""
    programmed = np.flatnonzero(move >= 0)
    after = np.minimum(np.searchsorted(programmed, np.arange(len(move))), len(programmed) - 1)
    owner: Ints32 = move[programmed[after]]
    return owner
