"""Mode coupling: when the force that follows the tip's own displacement makes it swing by itself.

A tip of stiffness K is displaced by u, depth and width of cut change with it, and so does the mean force, by
Kp·u (the *process stiffness*, `cutting.stiffness`). With one mass m for all directions

    m·u'' + C·u' + (K - g·Kp)·u = 0,    C = 2·zeta·sqrt(m)·sqrt(K)

at the gain g = 1. K is symmetric, Kp is not: two stiffnesses near each other are coupled into one growing
oscillation (flutter), and a part of Kp that is larger than K pulls the tool in. Neither needs waves that the
tooth before left on the surface, so it happens at the arm's own low frequency at any spindle speed.

Sources, known from their abstracts: Pan, Zhang, Zhu & Wang 2006 (Chatter analysis of robotic machining
process): K - Kp of an arm; Cen & Melkote 2017 (CCT-based mode coupling chatter avoidance in robotic milling):
choice of the pose; Mousavi, Gagnol, Bouzgarrou & Ray 2018 (Stability optimization in robotic milling through
the control of functional redundancies): choice of the turn about the tool axis. The equations here follow
from the balance of forces; `tests/pose/two_modes.py` holds them against a simulation in time.

Left out: regeneration (`cutting.lobes`), mass that differs with direction, damping other than `DAMPING`, the
part of the force that follows the tip's velocity, the bending of spindle and tool themselves.
"""

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import FLOAT, FLOATS, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import contiguous
from gcode2krl.compliance import chain, model

DAMPING = 0.02
"""Damping ratio of the arm's modes, an assumption: tap tests of milling robots find 0.01 to 0.05."""
MOST_GAIN = 16.0
"""Gain up to which an instability is looked for: an index below 1/16 is told as 0."""
_LEAST_MM_N = 1e-12
"""Flexibility of a rigid arm, so that it has a stiffness."""
_coupling_index = core_function("compliance_coupling_index", FLOATS, FLOATS, FLOAT, FLOAT, OUT_FLOATS)


def tip_flexibility(q_rad: Floats, cell: Cell, tool: npt.ArrayLike | None = None) -> Floats:
    """Return the displacement (n, 3, 3) in mm of the tip by small forces, per N, along ``$BASE``.

    ``q_rad`` (n, 6). Raises `NotUnderstoodError` where the cell does not state the stiffness.
    """
    flexibility, base = np.empty((len(q_rad), 9)), contiguous(cell.base_matrix()[:3, :3])
    arm = (model.frames(cell), model.softness(cell), base)
    chain.flexibility_rows(contiguous(q_rad), *arm, *model.tips(cell, tool, len(q_rad)), flexibility)
    flexibility[:, ::4] += _LEAST_MM_N
    return flexibility.reshape(-1, 3, 3)


def coupling_index(
    flexibility_mm_N: Floats, process_N_mm: Floats, damping: float = DAMPING, most_gain: float = MOST_GAIN
) -> Floats:
    """Return the index (n,) of mode coupling: 1/g of the least gain g > 0 at which the tip swings by itself.

    From 1 on the cut is unstable as predicted; at 0.5 it would be at twice the force. Frequency and mass drop
    out. NaN where the flexibility is not finite.

    Parameters
    ----------
    flexibility_mm_N : (n, 3, 3) of the tip, the inverse of its stiffness K: symmetric and positive.
    process_N_mm : (n, 3, 3) change of the mean force on the tool by a displacement of its tip.
    damping : ratio, that of each mode, above 0.
    most_gain : up to which an instability is looked for; an index below its inverse is 0.
    """
    index = np.empty(len(process_N_mm))
    flat = (contiguous(matrices).reshape(-1, 9) for matrices in (flexibility_mm_N, process_N_mm))
    _coupling_index(*flat, damping, most_gain, index)
    return index
