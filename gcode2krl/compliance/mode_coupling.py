"""Mode coupling: when the force that follows the tip's own displacement makes it swing by itself.

A tip of stiffness K is displaced by u, depth and width of cut change with it, and so does the mean force, by
Kp·u (the *process stiffness*, `cutting.process_stiffness`). With one mass m for all directions

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
from gcode2krl.compliance.deflection import displace

DAMPING = 0.02
"""Damping ratio of the arm's modes, an assumption: tap tests of milling robots find 0.01 to 0.05."""
MOST_GAIN = 16.0
"""Gain up to which an instability is looked for: an index below 1/16 is told as 0."""
_LOAD_N = 1.0
_LEAST_MM_N = 1e-12
"""Flexibility of a rigid arm, so that it has a stiffness."""
_coupling_index = core_function("compliance_coupling_index", FLOATS, FLOATS, FLOATS, FLOAT, OUT_FLOATS)


def tip_stiffness(q_rad: Floats, cell: Cell, tool: npt.ArrayLike | None = None) -> Floats:
    """Return the stiffness (n, 3, 3) in N/mm of the tip against forces, along the axes of ``$BASE``.

    ``q_rad`` (n, 6). Raises `NotUnderstoodError` where the cell does not state the stiffness.
    """
    root_from_base = cell.base_matrix()[:3, :3]
    bent = [
        displace(q_rad, _LOAD_N * root_from_base[:, axis], np.zeros(3), cell, tool)[0] @ root_from_base
        for axis in range(3)
    ]
    flexibility = np.stack(bent, axis=2) / _LOAD_N + _LEAST_MM_N * np.eye(3)
    return np.asarray(np.linalg.inv((flexibility + flexibility.transpose(0, 2, 1)) / 2.0))


def coupling_index(
    stiffness_N_mm: Floats, process_N_mm: Floats, damping: float = DAMPING, most_gain: float = MOST_GAIN
) -> Floats:
    """Return the index (n,) of mode coupling: 1/g of the least gain g > 0 at which the tip swings by itself.

    From 1 on the cut is unstable as predicted; at 0.5 it would be at twice the force. Frequency and mass drop
    out. NaN where the stiffness is not finite.

    Parameters
    ----------
    stiffness_N_mm : (n, 3, 3) of the tip, symmetric and positive.
    process_N_mm : (n, 3, 3) change of the mean force on the tool by a displacement of its tip.
    damping : ratio, that of each mode, above 0.
    most_gain : up to which an instability is looked for; an index below its inverse is 0.
    """
    finite = np.asarray(np.isfinite(stiffness_N_mm + process_N_mm).all(axis=(1, 2)))
    scale = np.where(finite, np.trace(stiffness_N_mm, axis1=1, axis2=2) / 3.0, 1.0)[:, None, None]
    stiffness = np.where(finite[:, None, None], stiffness_N_mm / scale, np.eye(3))
    process = np.where(finite[:, None, None], process_N_mm / scale, 0.0)
    values, modes = np.linalg.eigh(stiffness)
    drag = 2.0 * damping * (modes * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ modes.transpose(0, 2, 1)
    index = np.empty(len(scale))
    flat = (np.ascontiguousarray(matrices.reshape(-1, 9)) for matrices in (drag, stiffness, process))
    _coupling_index(*flat, float(most_gain), index)
    return np.where(finite, index, np.nan)
