"""Where long motions are cut so that few triggers wait at a time, without slowing the robot down.

Triggers wait from when the advance run has read them until they act: those of a few motions in a row. More
motions in the same way let fewer wait. Cuts keep away from each other and from the ends of their motion by as
much as the look-ahead needs to see in order not to brake.
"""

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import FLOATS, INT, INTS, OUT_FLOATS, core_function
from gcode2krl.krc4 import Chain
from gcode2krl.krl.advance import view
from gcode2krl.krl.pieces import Pieces
from gcode2krl.krl.triggers import Triggers
from gcode2krl.krl.windows import Windows
from gcode2krl.tables import Motion, PilotForce, Targets
from gcode2krl.units import MM_PER_M

_CDIS_MM = 0.1
"""Approximation where pieces meet, in a cell that has none of its own."""
_CDIS_STEP_MM = 1e-3
_LEAST_PIECE_MM = 0.02
_ROOM = 1.25
"""Length of a piece over what a change of speed at its end needs."""
_EARLIER_S = 0.8
"""How long before the instant of a trigger a motion is still cut for it."""

_cut = core_function(
    "krl_cut",
    *(INTS, FLOATS, FLOATS, INTS, FLOATS, FLOATS, FLOATS, FLOATS, INT, INT, OUT_FLOATS),
    returns=INT,
)


def cut_for(
    triggers: Triggers,
    windows: Windows,
    chain: Chain,
    targets: Targets,
    motion: Motion | PilotForce,
    cell: Cell,
) -> Pieces | None:
    """Return cuts that bring the number of waiting triggers towards ``[pilot] max_active``.

    Of as many triggers as may wait and the next, the first and the last must be as many motions apart as are
    in view. Motions between the two are cut; where they are too short, those shortly before, so that the
    first can be announced earlier. None without any cut, as where the controller stops at every end.
    """
    if cell.controller.advance == 0:
        return None
    low, high, apart = _zones(windows, chain, cell)
    fire_s = triggers.fire_s
    before_mm, here_mm = np.interp([fire_s - _EARLIER_S, fire_s], motion.time_s, motion.path_mm)
    room = np.floor(np.maximum(high - low, 0.0) / apart).sum() + len(low)
    cuts = np.empty(int(min(room, len(fire_s) * view(cell))) + 1)
    count = _cut(
        triggers.order,
        here_mm,
        before_mm,
        np.searchsorted(windows.row, triggers.row),
        windows.begin_mm,
        low,
        high,
        apart,
        cell.pilot.max_active,
        view(cell),
        cuts,
    )
    return _pieces(cuts[:count], windows, targets, cell) if count else None


def _zones(windows: Windows, chain: Chain, cell: Cell) -> tuple[Floats, Floats, Floats]:
    """Return the path (w,) from which and up to which a motion may be cut, and how far apart cuts must be.

    By the model of `krc4`, a stop must be possible in view of a vertex, v·(v/a + k)/2, also of the vertices
    before; and a change of speed at a vertex reaches v·k/2 into the motion, which needs a piece that is
    longer by a quarter. A corner at an end keeps twice its distance. So speeds and corners stay as they are.
    """
    controller = cell.controller
    at = windows.row - chain.first - 1
    speed = chain.speed_mm_s * chain.scale
    need = speed * (speed / (controller.acc_cp_m_s2 * MM_PER_M) + controller.k_s) / 2.0
    smear = speed[at] * controller.k_s / 2.0
    after_stop = np.concatenate([[True], chain.stop])[at]
    if controller.advance == "unlimited":
        least, seen = np.full(len(at), _LEAST_PIECE_MM), need
    else:
        least = np.maximum(need[at] / controller.advance, _LEAST_PIECE_MM)
        seen = _largest_before(need, chain.stop, int(controller.advance))
    head = np.where(after_stop, least, np.maximum(seen[at], _ROOM * (windows.head_mm + smear)))
    tail = np.maximum(need[at], _ROOM * (windows.tail_mm + smear))
    head, tail = np.maximum(head, windows.head_mm), np.maximum(tail, windows.tail_mm)
    return windows.begin_mm + head, windows.end_mm - tail, least


def _largest_before(values: Floats, stop: Bools, count: int) -> Floats:
    """Return the largest value (n,) of each motion and so many before it, back to the last stop."""
    largest = values.copy()
    for _ in range(count):
        before = np.where(stop[:-1], 0.0, largest[:-1])
        largest[1:] = np.maximum(largest[1:], before)
    return largest


def _pieces(cuts_mm: Floats, windows: Windows, targets: Targets, cell: Cell) -> Pieces:
    """Return cuts at paths as pieces; their approximation stays within a quarter of a piece."""
    at = np.searchsorted(windows.begin_mm, cuts_mm, side="right") - 1
    row = windows.row[at]
    length_mm = windows.head_mm[at] + windows.end_mm[at] - windows.begin_mm[at] + windows.tail_mm[at]
    share = (windows.head_mm[at] + cuts_mm - windows.begin_mm[at]) / length_mm
    ends_mm = np.minimum(cuts_mm - windows.begin_mm[at], windows.end_mm[at] - cuts_mm)
    close_mm = np.minimum(np.diff(cuts_mm, prepend=-np.inf), np.diff(cuts_mm, append=np.inf))
    quarter_mm = np.minimum(ends_mm, close_mm) / 4.0
    own, before = targets.cdis_mm[row], targets.cdis_mm[np.maximum(row - 1, 0)]
    cdis_mm = np.where(own > 0, own, np.where(before > 0, before, cell.controller.cdis_mm or _CDIS_MM))
    narrow_mm = np.maximum(np.floor(quarter_mm / _CDIS_STEP_MM) * _CDIS_STEP_MM, _CDIS_STEP_MM)
    return Pieces(row, share, np.minimum(cdis_mm, narrow_mm))
