"""Where each motion of a chain begins: at the end of the one before, as a pose of the tool that moves."""

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell.definition import Cell
from gcode2krl.tables import Targets

Rows = slice | Ints


def motion_starts(targets: Targets, cell: Cell, rows: Rows = slice(None)) -> tuple[Floats, Floats]:
    """Return position (p, 3) in mm and rotation (p, 4) at which each motion begins; row 0 where it ends.

    At a tool change between two rows the flange rests, and the motion begins at the new tip. ``rows``
    chooses motions; the columns may be views of the targets, so they are not to be written to.
    """
    here, before = _with_predecessors(rows, len(targets))
    position, rotation = targets.position_mm[before], targets.rotation[before]
    changes = np.flatnonzero(targets.tool[here] != targets.tool[before])
    if len(changes):
        position, rotation = np.array(position), np.array(rotation)
    numbers = np.arange(len(targets))[here] if len(changes) else changes
    for k, row in zip(changes, numbers[changes], strict=True):
        old = fr.transform(position[k], fr.rotation_from_quaternion(rotation[k]))
        old_tool, new_tool = (cell.tool_matrix(int(targets.tool[at])) for at in (row - 1, row))
        new = old @ fr.invert(old_tool) @ new_tool
        position[k], rotation[k] = new[:3, 3], fr.quaternion_from_rotation(new[:3, :3])
    return position, rotation


def external_starts(targets: Targets, rows: Rows = slice(None)) -> Floats:
    """Return E1 to E6 (p, 6) at which each motion begins; row 0 where it ends."""
    if targets.external.strides[0] == 0:
        return targets.external[rows]
    _, before = _with_predecessors(rows, len(targets))
    return targets.external[before]


def _with_predecessors(rows: Rows, count: int) -> tuple[Rows, Rows]:
    """Return an index of the rows and one of those before them, as slices (no copy) where possible."""
    if not isinstance(rows, slice):
        return rows, np.maximum(rows - 1, 0)
    start, end, _ = rows.indices(count)
    if start > 0:
        return slice(start, end), slice(start - 1, end - 1)
    return slice(0, end), np.maximum(np.arange(end) - 1, 0)
