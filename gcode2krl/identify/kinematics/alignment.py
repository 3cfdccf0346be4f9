"""Where the instrument stands and where its targets are on the tool, before any small error is known.

A target p on the flange is seen at m = R·(F p + o) + t, with the flange F, o by the joints. With X = Rᵀ and y
= Rᵀ t this is linear, X m - y - F p = o, for any scale and handedness of X: they tell a wrong unit and a
mirrored table (Shah 2013 solves the like for hand and eye). Readings that are far off are left out by taking
the best of many small draws.
"""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats

_DRAWS, _DRAWN, _KEPT = 60, 12, 0.8
"""Small draws of poses that are tried, poses of each, and the share of rows that must fit."""


class Alignment(NamedTuple):
    """The robot's root in the instrument's frame, and the targets on the flange."""

    place_mm: Floats
    """(3,)"""
    rotation: Floats
    """(3, 3)"""
    targets_mm: Floats
    """(t, 3)"""
    scale: float
    """Size of a unit of the instrument in mm, as the arm's lengths tell it."""
    is_mirrored: bool
    off_mm: float
    """Median distance of what is seen from where the arm should be."""


def aligned(measured_mm: Floats, target: np.ndarray, flange_mm: Floats, rotation: Floats) -> Alignment:
    """Return frames that fit points (n, 3) of targets (n,) on an arm with flanges (n, 3), (n, 3, 3)."""
    design, wanted = _design(measured_mm, target, rotation), flange_mm
    rng = np.random.default_rng(1)
    best, kept = np.inf, np.ones(len(wanted), dtype=bool)
    drawn = min(_DRAWN + 3 * int(target.max(initial=0)), len(wanted))
    for _ in range(_DRAWS if len(wanted) > drawn else 1):
        rows = rng.choice(len(wanted), drawn, replace=False)
        off = _off(design, wanted, _solved(design[rows], wanted[rows]))
        reached = float(np.quantile(off, _KEPT))
        if reached < best:
            best, kept = reached, off <= reached
    for _ in range(5):
        off = _off(design, wanted, _solved(design[kept], wanted[kept]))
        kept = off <= 4.0 * np.quantile(off, _KEPT)
    solution = _solved(design[kept], wanted[kept])
    return _alignment(solution, measured_mm, target, flange_mm, rotation, kept)


def _design(measured: Floats, target: np.ndarray, rotation: Floats) -> Floats:
    """Return the derivatives (n, 3, 12 + 3 t) of X m - y - F p."""
    count, targets = len(measured), int(target.max(initial=0)) + 1
    design = np.zeros((count, 3, 12 + 3 * targets))
    for axis in range(3):
        design[:, axis, 3 * axis : 3 * axis + 3] = measured
        design[:, axis, 9 + axis] = -1.0
    for number in range(targets):
        rows = target == number
        design[rows, :, 12 + 3 * number : 15 + 3 * number] = -rotation[rows]
    return design


def _solved(design: Floats, wanted: Floats) -> Floats:
    flat = design.reshape(-1, design.shape[2])
    scale = np.maximum(np.linalg.norm(flat, axis=0), 1e-12)
    solution: Floats = np.linalg.lstsq(flat / scale, wanted.reshape(-1), rcond=1e-9)[0] / scale
    return solution


def _off(design: Floats, wanted: Floats, solution: Floats) -> Floats:
    off: Floats = np.linalg.norm(design @ solution - wanted, axis=1)
    return off


def _alignment(
    solution: Floats,
    measured: Floats,
    target: np.ndarray,
    flange: Floats,
    rotation: Floats,
    kept: Bools,
) -> Alignment:
    """Return the frames with a true rotation, then place and targets for it."""
    free = solution[:9].reshape(3, 3)
    u, sizes, vt = np.linalg.svd(free)
    scale = float(sizes.mean())
    is_mirrored = bool(np.linalg.det(u @ vt) < 0.0)
    turn = vt.T @ np.diag([1.0, 1.0, -1.0 if is_mirrored else 1.0]) @ u.T
    targets = int(target.max(initial=0)) + 1
    design = np.zeros((len(measured), 3, 3 + 3 * targets))
    design[:, range(3), range(3)] = 1.0
    for number in range(targets):
        rows = target == number
        design[rows, :, 3 + 3 * number : 6 + 3 * number] = turn @ rotation[rows]
    wanted = measured - flange @ turn.T
    shifts = _solved(design[kept], wanted[kept])
    off = float(np.median(_off(design, wanted, shifts)))
    return Alignment(shifts[:3], turn, shifts[3:].reshape(-1, 3), scale, is_mirrored, off)
