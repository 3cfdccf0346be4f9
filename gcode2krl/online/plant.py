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


def with_backlash(q_program_rad: Floats, q_shift_rad: Floats, time_s: Floats, gap_rad: Floats) -> Floats:
    """Return the joints (n, 6) behind the gears when the program and a correction of the axes move them.

    Each drive has a play of ``gap_rad`` (6,) with memory. The controller compensates it by the direction in
    which the *program* moves an axis; it does not know a correction sent directly to the axes (the
    assumption of Haehn & Weigold 2020, section 3.3). As long as both move the same way nothing is lost.
    """
    total = q_program_rad + q_shift_rad
    behind = np.empty_like(total)
    for axis, gap in enumerate(gap_rad.tolist()):
        if gap == 0.0:
            behind[:, axis] = total[:, axis]
            continue
        direction, _ = since_reversal(q_program_rad[:, axis], time_s)
        behind[:, axis] = play(total[:, axis] + 0.5 * gap * direction, 0.5 * gap)
    return behind


def tip_shift_mm(q_rad: Floats, q_program_rad: Floats, cell: Cell, tool: int) -> Floats:
    """Return the offset (n, 3) in ``$BASE`` of the tip from where the program's joints put it."""
    lengths, tools = cell.robot.geometry.array(), np.full(len(q_rad), tool, dtype=np.int32)
    shift: Floats = tip_mm(q_rad, lengths, cell, tools) - tip_mm(q_program_rad, lengths, cell, tools)
    return shift
