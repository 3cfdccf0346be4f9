"""Where each motion of a chain begins: at the end of the one before, seen from the tool that moves."""

import numpy as np
from numpy.typing import NDArray

from gcode2krl import frames as fr
from gcode2krl.cell import Cell
from gcode2krl.tables import Targets

Floats = NDArray[np.float64]


def motion_starts(targets: Targets, cell: Cell) -> tuple[Floats, Floats]:
    """Return position (p, 3) in mm and rotation (p, 4) at which each motion begins; row 0 where it ends.

    Where the tool changes between two rows the flange rests and another tip begins the motion.
    """
    before = np.maximum(np.arange(len(targets)) - 1, 0)
    position, rotation = targets.position_mm[before], targets.rotation[before]
    for row in np.flatnonzero(targets.tool != targets.tool[before]):
        old = fr.transform(position[row], fr.rotation_from_quaternion(rotation[row]))
        old_tool, new_tool = (cell.tool_matrix(int(targets.tool[k])) for k in (row - 1, row))
        new = old @ fr.invert(old_tool) @ new_tool
        position[row], rotation[row] = new[:3, 3], fr.quaternion_from_rotation(new[:3, :3])
    return position, rotation
