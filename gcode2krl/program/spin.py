"""The free turn about the tool axis: a mill is symmetric, so the robot may choose it.

``auto`` keeps away from joint limits and singularities. One angle is used for the whole program where it is
good enough (the smoothest choice); otherwise an angle that changes slowly along the path, found by dynamic
programming over a grid. ``stiffest`` takes the angle at which the arm bends least, within the same limits.
"""

from collections.abc import Callable

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.units import RAD_PER_DEG

Quality = Callable[[Ints, float], Floats]

GRID_RAD = 5.0 * RAD_PER_DEG
GOOD_ENOUGH = 0.3
"""Quality (1 = 30° from limits and singularities) at which a constant angle is taken."""
STEP_MM = 25.0
"""Path over which a changing angle may move by one step of the grid."""
STIFF_QUALITY = 0.15
"""Least quality of a pose that `stiffest_spin` may take."""
_WORTH_TURNING = 0.02
"""Fraction of the mean deflection that a changing angle must save compared with a constant one."""
_CHANGE_COST = 0.05
_SAMPLES = 400


def smooth_spin(position_mm: Floats, quality: Quality, axis: Floats | None = None) -> Floats | float:
    """Return the spin in rad: one number, or (p,) where no constant angle is good enough.

    ``quality(rows, spin)`` gives (len(rows), branches): the distance to the nearest limit or
    singularity, 1 = 30° and more, 0 = at it, negative = impossible. One branch serves the whole program.
    Where the tool axis (p, 3) is given, its outermost directions are judged too.
    """
    rows = _judged_rows(position_mm, axis)
    spins = _grid()
    table = np.stack([quality(rows, float(spin)) for spin in spins])  # (spins, rows, branches)
    worst = np.minimum(table.min(axis=1).max(axis=1), GOOD_ENOUGH + 0.1)
    best = int(np.argmax(np.round(worst, 2)))
    spins = np.round(spins, 12) + 0.0
    if worst[best] >= GOOD_ENOUGH or len(rows) < 3:
        return float(spins[best])
    changing = _changing(position_mm, rows, spins, table)
    return float(spins[best]) if changing is None else changing


def stiffest_spin(
    position_mm: Floats, quality: Quality, bending: Quality, axis: Floats | None = None
) -> Floats | float:
    """Return the spin in rad that bends least: one number, or (p,) where a changing angle saves more.

    ``quality`` as in `smooth_spin`; ``bending(rows, spin)`` gives (len(rows), branches) in mm, under
    any load, NaN where the pose is impossible. One branch serves the whole program.
    """
    rows, spins = _judged_rows(position_mm, axis), _grid()
    comfort = np.stack([quality(rows, float(spin)) for spin in spins])
    bend_mm = np.stack([bending(rows, float(spin)) for spin in spins])
    possible = (comfort >= STIFF_QUALITY) & np.isfinite(bend_mm)
    constant = np.where(possible, bend_mm, np.inf).mean(axis=1)  # (spins, branches)
    best = np.unravel_index(np.argmin(constant), constant.shape)
    if not np.isfinite(constant[best]):
        return smooth_spin(position_mm, quality, axis)
    order = np.argsort(spins)
    path = _way(position_mm)
    branch = int(best[1])
    cost = np.where(possible, bend_mm / constant[best], 1e3)[order][:, :, branch]
    total, track = _cheapest_track(cost, _allowed_steps(path, rows))
    if total < (1.0 - _WORTH_TURNING) * len(rows):
        spin: Floats = np.interp(path, path[rows], spins[order][track])
        return spin
    return float(np.round(spins[best[0]], 12) + 0.0)


def _grid() -> Floats:
    """Return the spins that are tried, the smallest turn first, so that it wins a tie."""
    spins = np.arange(-np.pi, np.pi - 1e-9, GRID_RAD)
    return spins[np.argsort(np.abs(spins), kind="stable")]


def _judged_rows(position_mm: Floats, axis: Floats | None = None) -> Ints:
    """Return rows spread over the program, its outermost points and tilts among them."""
    rows = np.linspace(0, len(position_mm) - 1, min(_SAMPLES, len(position_mm))).astype(np.int64)
    tables = [position_mm] if axis is None or axis.strides[0] == 0 else [position_mm, axis]
    extremes = [op(table[:, k]) for table in tables for k in range(3) for op in (np.argmin, np.argmax)]
    return np.unique(np.concatenate([rows, extremes]))


def _way(position_mm: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position_mm, axis=0), axis=1))])


def _allowed_steps(path: Floats, rows: Ints) -> Ints:
    """Return how many steps of the grid the spin may take between judged rows."""
    return np.maximum(1, ((path[rows[1:]] - path[rows[:-1]]) / STEP_MM).astype(np.int64))


def _changing(position_mm: Floats, rows: Ints, spins: Floats, table: Floats) -> Floats | None:
    """Dynamic programming along the path, per branch; None where it is no better than a constant."""
    order = np.argsort(spins)
    spins, table = spins[order], table[order]
    path = _way(position_mm)
    allowed = _allowed_steps(path, rows)
    best_cost, best_track = np.inf, None
    for branch in range(table.shape[2]):
        cost_here = np.where(table[:, :, branch] > 0, 1.0 - np.minimum(table[:, :, branch], 1.0), 1e3)
        cost, track = _cheapest_track(cost_here, allowed)
        if cost < best_cost:
            best_cost, best_track = cost, track
    constant_cost = np.where(table > 0, 1.0 - np.minimum(table, 1.0), 1e3).sum(axis=1).min()
    if best_track is None or best_cost >= constant_cost:
        return None
    spin: Floats = np.interp(path, path[rows], spins[best_track])
    return spin


def _cheapest_track(cost_here: Floats, allowed: Ints) -> tuple[float, Ints]:
    """Return (cost, grid index per sample) of the cheapest track through the grid (spins, samples).

    It does not wrap at ±180°: a full turn about the tool would wind up A6.
    """
    size, samples = cost_here.shape
    distance = np.abs(np.arange(size)[:, None] - np.arange(size)[None, :])
    total = cost_here[:, 0].copy()
    came_from = np.zeros((samples, size), dtype=np.int64)
    for k in range(1, samples):
        step = np.where(distance <= allowed[k - 1], _CHANGE_COST * distance, np.inf)
        through = total[None, :] + step
        came_from[k] = np.argmin(through, axis=1)
        total = through[np.arange(size), came_from[k]] + cost_here[:, k]
    track = np.empty(samples, dtype=np.int64)
    track[-1] = int(np.argmin(total))
    for k in range(samples - 1, 0, -1):
        track[k - 1] = came_from[k, track[k]]
    return float(total.min()), track
