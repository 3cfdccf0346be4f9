"""The robot's reaction to a correction: dead time, lag, and drives with backlash."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.effects.arm import tip_mm
from gcode2krl.effects.operators import lag, play, since_reversal


def reaction(sent: Floats, time_s: Floats, dead_s: float, lag_s: float) -> Floats:
    """Return the motion (n, w) that follows a correction: dead time, then a first-order lag.

    Structural modes and the overshoot of the position controller are not modelled.
    """
    if len(sent) == 0:
        return sent
    columns = [np.interp(time_s - dead_s, time_s, column, left=0.0) for column in sent.T]
    return np.stack([lag(column, time_s, lag_s) for column in columns], axis=1)


def with_backlash(
    drives_rad: Floats, known_rad: Floats, time_s: Floats, gap_rad: Floats, closed: float = 0.0
) -> Floats:
    """Return the joints (n, 6) behind the gears when the drives are sent ``drives_rad`` (n, 6).

    Each drive has a play of ``gap_rad`` (6,) with memory. The controller takes it out by the direction of
    the motion that it knows, ``known_rad`` (n, 6). As long as the drives move the same way nothing is lost.
    The load keeps the share ``closed`` of the play closed, which the controller does not know.
    """
    behind = np.empty_like(drives_rad)
    for axis, gap in enumerate(gap_rad.tolist()):
        if gap == 0.0:
            behind[:, axis] = drives_rad[:, axis]
            continue
        direction, _ = since_reversal(known_rad[:, axis], time_s)
        behind[:, axis] = play(drives_rad[:, axis] + 0.5 * gap * direction, 0.5 * gap * (1.0 - closed))
    return behind


def tip_shift_mm(q_rad: Floats, q_program_rad: Floats, cell: Cell, tool: int) -> Floats:
    """Return the offset (n, 3) in ``$BASE`` of the tip from where the program's joints put it."""
    lengths, tools = cell.robot.geometry.array(), np.full(len(q_rad), tool, dtype=np.int32)
    shift: Floats = tip_mm(q_rad, lengths, cell, tools) - tip_mm(q_program_rad, lengths, cell, tools)
    return shift
