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
from the balance of forces; `benchmarks/mode_coupling.py` holds them against a simulation in time.

Left out: regeneration (`cutting.lobes`), mass that differs with direction, damping other than `DAMPING`, the
part of the force that follows the tip's velocity, the bending of spindle and tool themselves.
"""

import math

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.compliance.deflection import displace

DAMPING = 0.02
"""Damping ratio of the arm's modes, an assumption: tap tests of milling robots find 0.01 to 0.05."""
MOST_GAIN = 16.0
"""Gain up to which an instability is looked for: an index below 1/16 is told as 0."""
_LEAST_GAIN, _STEP = 1.0 / 16.0, math.sqrt(2.0)
_HALVINGS = 7
_ONE, _TWO = np.array([1, 2, 0]), np.array([2, 0, 1])
_MINORS = [
    (rows[None, :], columns[:, None])
    for rows, columns in ((_ONE, _ONE), (_TWO, _TWO), (_ONE, _TWO), (_TWO, _ONE))
]
"""The numbers of a 3x3 matrix of which the minors of its transpose are made."""
_LOAD_N = 1.0
_LEAST_MM_N = 1e-12
"""Flexibility of a rigid arm, so that it has a stiffness."""


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

    def grows(rows: Ints, gain: Floats) -> Bools:
        return ~_dies_out(drag[rows], stiffness[rows] - gain[:, None, None] * process[rows])

    low, high = np.zeros(len(scale)), np.full(len(scale), np.inf)
    gain = _LEAST_GAIN
    while gain <= most_gain * (1.0 + 1e-9):
        rows = np.flatnonzero(np.isinf(high))
        unstable = grows(rows, np.full(len(rows), gain))
        high[rows[unstable]], low[rows[~unstable]] = gain, gain
        gain *= _STEP
    swings = np.isfinite(high)
    rows = np.flatnonzero(swings)
    for _ in range(_HALVINGS):
        middle = (low[rows] + high[rows]) / 2.0
        unstable = grows(rows, middle)
        high[rows[unstable]], low[rows[~unstable]] = middle[unstable], middle[~unstable]
    return np.where(finite, np.where(swings, 1.0 / np.where(swings, high, 1.0), 0.0), np.nan)


def _dies_out(drag: Floats, stiffness: Floats) -> Bools:
    """Tell (n,) where all solutions of u'' + C·u' + A·u = 0 die out, for C, A (n, 3, 3).

    Routh's array of det(s²·I + s·C + A), whose first column has no change of sign (Routh 1877). The
    polynomial's coefficients are the mixed principal minors of C and A.
    """
    rows = np.zeros((7, len(drag)))
    sums = np.trace(drag, axis1=1, axis2=2), np.trace(stiffness, axis1=1, axis2=2)
    minors = [_adjugate(each) for each in (drag, stiffness)]
    rows[0], rows[1] = 1.0, sums[0]
    rows[2] = np.trace(minors[0], axis1=1, axis2=2) + sums[1]
    rows[3] = _det(drag, minors[0]) + sums[0] * sums[1] - _along(drag, stiffness)
    rows[4] = np.trace(minors[1], axis1=1, axis2=2) + _along(minors[0], stiffness)
    rows[5], rows[6] = _along(minors[1], drag), _det(stiffness, minors[1])
    nothing = np.zeros(len(drag))
    upper, lower, stable = rows[::2], np.vstack([rows[1::2], nothing]), np.ones(len(drag), dtype=np.bool_)
    for _ in range(6):
        stable &= lower[0] > 0.0
        ratio = upper[0] / np.where(stable, lower[0], 1.0)
        upper, lower = lower, np.vstack([upper[1:] - ratio * lower[1:], nothing])
    return stable


def _along(a: Floats, b: Floats) -> Floats:
    """Return the traces (n,) of products of matrices (n, 3, 3)."""
    return np.asarray(np.einsum("nij,nji->n", a, b))


def _det(matrix: Floats, adjugate: Floats) -> Floats:
    return np.asarray(np.einsum("nj,nj->n", matrix[:, 0], adjugate[:, :, 0]))


def _adjugate(matrix: Floats) -> Floats:
    """Return the adjugates of matrices (n, 3, 3)."""
    a, b, c, d = (matrix[:, rows, columns] for rows, columns in _MINORS)
    return a * b - c * d
