"""Collisions on the ways that a Motion does not show.

A Motion is watched while its samples pass by. The ways that are not in it, or that it models otherwise, are
watched at the targets: PTP as straight ways of the joints, and beside each PTP the lines up to the programmed
ones.
"""

from collections.abc import Iterable

from gcode2krl import collision
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import standing
from gcode2krl.cell.checked_parts import checks_collisions
from gcode2krl.clearance.meshes import triangles_of
from gcode2krl.clearance.proposals import Ptp, proposal
from gcode2krl.clearance.ways import Beside
from gcode2krl.errors import Issue
from gcode2krl.tables import Targets


def watch_of(cell: Cell, *, tells: bool = False) -> collision.Watch | None:
    """Return the watch over a program, None where the cell describes nothing that may hit or be hit."""
    if not checks_collisions(cell) or not cell.robot.geometry.known:
        return None
    return collision.Watch(cell, triangles_of, tells=tells)


def collisions_beside(ways: Iterable[Beside], targets: Targets, cell: Cell) -> tuple[Issue, ...]:
    """Return the collisions on the ways to targets that a Motion does not show."""
    watch = watch_of(cell)
    if watch is None:
        return ()
    for way in ways:
        clearances = watch.way(
            way.q_rad,
            way.tool,
            way.line,
            way.words,
            is_ptp=way.is_ptp,
            against_raw=way.is_uncut,
            external=way.external,
        )
        if way.is_ptp and clearances.hits:
            ptp = Ptp(targets, way.row, way.q_rad[0], way.q_rad[-1])
            watch.advise(way.line, way.words, _advice(ptp, cell, against_raw=way.is_uncut))
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
    remedy = proposal(ptp, cell, is_free) if stays else ""
    at_home = ptp.targets.home[ptp.row] or ptp.targets.home[ptp.row - 1]
    other = "put HOME elsewhere" if at_home else "cut in another order"
    return remedy or f"{other}, or move what is hit: no higher [clearance] z_mm or turn of A1 alone is free"
