"""A long LIN in collinear pieces, so that triggers find motions to stand before; the way stays the same."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Rows
from gcode2krl.cell import Cell
from gcode2krl.cell.tool_tips import external_starts, motion_starts
from gcode2krl.compiled.core import BOOLS, FLOAT, FLOATS, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.tables import Joints, Table, Targets

_align = core_function("krl_align", FLOATS, BOOLS, FLOATS, FLOATS, BOOLS, FLOATS, FLOAT, OUT_INTS, OUT_FLOATS)


@dataclass(frozen=True)
class Pieces:
    """Additional ends of motions (q), in the order in which they are passed."""

    row: Rows
    """(q,) row of Targets whose motion is cut."""
    share: Floats
    """(q,) share of that motion at which it is cut."""
    cdis_mm: Floats

    def __len__(self) -> int:
        return len(self.row)

    def before(self, row: int) -> "Pieces":
        """Return the pieces of motions before a row of Targets."""
        kept = self.row < row
        return Pieces(self.row[kept], self.share[kept], self.cdis_mm[kept])


def split(targets: Targets, joints: Joints, pieces: Pieces, cell: Cell) -> tuple[Targets, Joints, Rows]:
    """Return targets and joints with the pieces as rows, each before the row whose motion it cuts.

    A piece has that row's speed, tool and line, is no row of the Toolpath and does not stop. Its joints are
    those of the row, and only fill the table. The third result (p,) says where the rows have gone.
    """
    count = np.bincount(pieces.row, minlength=len(targets)) + 1
    order = np.repeat(np.arange(len(targets)), count)
    last = np.cumsum(count) - 1
    new = np.ones(len(order), dtype=np.bool_)
    new[last] = False
    start, from_rotation = (column[pieces.row] for column in motion_starts(targets, cell))
    way = targets.position_mm[pieces.row] - start
    rows = _taken(targets, order)
    rows["position_mm"][new] = start + pieces.share[:, None] * way
    rows["rotation"][new] = fr.slerp(from_rotation, targets.rotation[pieces.row], pieces.share)
    if cell.external:
        begins = external_starts(targets)[pieces.row]
        rows["external"][new] = begins + pieces.share[:, None] * (targets.external[pieces.row] - begins)
    rows["cdis_mm"][new], rows["wait_s"][new], rows["move"][new] = pieces.cdis_mm, 0.0, -1
    events = tuple(event._replace(row=int(last[event.row])) for event in targets.events)
    return replace(targets, events=events, **rows), replace(joints, **_taken(joints, order)), last


def _taken(table: Table, rows: Rows) -> dict[str, Any]:
    """Return the columns of a table at rows."""
    return {spec.name: getattr(table, spec.name)[rows] for spec in fields(table) if "tail" in spec.metadata}


def pieces_in(
    position_mm: Floats,
    ptp: Bools,
    cdis_mm: Floats,
    targets: Targets,
    cell: Cell,
    limit_mm: float,
) -> Pieces:
    """Return what a program says more than its targets: blended motions that end on the way of others."""
    start_mm, _ = motion_starts(targets, cell)
    row = np.full(len(position_mm), -1, dtype=np.int64)
    share = np.zeros(len(position_mm))
    position, target, start = (
        np.ascontiguousarray(column) for column in (position_mm, targets.position_mm, start_mm)
    )
    _align(position, ptp, cdis_mm, target, targets.ptp, start, limit_mm, row, share)
    more = np.flatnonzero(row >= 0)
    return Pieces(row[more], share[more], cdis_mm[more])
