"""The free turn about the tool axis: a mill is symmetric, so the robot may choose it.

``auto`` keeps away from joint limits and singularities. One angle is used for the whole program where it is
good enough (the smoothest choice); otherwise an angle that changes slowly along the path, found by dynamic
programming over a grid. It is chosen at targets; on a long move it goes evenly from one to the other, as the
controller turns the tool, and the points in between count with the angle there. ``stiffest`` takes the angle
at which the arm bends least, within the same limits.
"""

from collections.abc import Callable

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
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


def smooth_spin(
    position_mm: Floats, quality: Quality, axis: Floats | None = None, is_target: Bools | None = None
) -> Floats | float:
    """Return the spin in rad: one number, or (p,) where no constant angle is good enough.

    ``quality(rows, spin)`` gives (len(rows), branches): the distance to the nearest limit or
    singularity, 1 = 30° and more, 0 = at it, negative = impossible. One branch serves the whole program.
    Where the tool axis (p, 3) is given, its outermost directions are judged too. Positions that are not
    ``is_target`` (p,) are points on straight moves between targets; the first and the last position are
    targets. Where nothing is possible throughout, the angle is taken that is impossible at the fewest.
    """
    rows = _judged_rows(position_mm, axis, is_target)
    spins = _grid()
    table = np.stack([quality(rows, float(spin)) for spin in spins])  # (spins, rows, branches)
    worst = np.minimum(table.min(axis=1).max(axis=1), GOOD_ENOUGH + 0.1)
    best = int(np.argmax(np.round(worst, 2)))
    spins = np.round(spins, 12) + 0.0
    if worst[best] >= GOOD_ENOUGH or len(rows) < 3:
        return float(spins[best])
    order, costs = np.argsort(spins), _costs(table)
    changing = _changing(_Judged(position_mm, rows, is_target), spins[order], costs[order])
    if changing is not None:
        return changing
    if worst[best] < 0.0:
        best = int(np.argmin(np.round(costs.sum(axis=1).min(axis=1), 6)))
    return float(spins[best])


def stiffest_spin(
    position_mm: Floats,
    quality: Quality,
    bending: Quality,
    axis: Floats | None = None,
    is_target: Bools | None = None,
) -> Floats | float:
    """Return the spin in rad that bends least: one number, or (p,) where a changing angle saves more.

    ``quality`` as in `smooth_spin`; ``bending(rows, spin)`` gives (len(rows), branches) in mm, under
    any load, NaN where the pose is impossible. One branch serves the whole program.
    """
    rows, spins = _judged_rows(position_mm, axis, is_target), _grid()
    comfort = np.stack([quality(rows, float(spin)) for spin in spins])
    bend_mm = np.stack([bending(rows, float(spin)) for spin in spins])
    possible = (comfort >= STIFF_QUALITY) & np.isfinite(bend_mm)
    constant = np.where(possible, bend_mm, np.inf).mean(axis=1)  # (spins, branches)
    best = np.unravel_index(np.argmin(constant), constant.shape)
    if not np.isfinite(constant[best]):
        return smooth_spin(position_mm, quality, axis, is_target)
    order = np.argsort(spins)
    judged, branch = _Judged(position_mm, rows, is_target), int(best[1])
    cost = np.where(possible, bend_mm / constant[best], 1e3)[order][:, :, branch]
    total, track = judged.cheapest_track(cost)
    if total < (1.0 - _WORTH_TURNING) * len(rows):
        return judged.along(spins[order][track])
    return float(np.round(spins[best[0]], 12) + 0.0)


def _grid() -> Floats:
    """Return the spins that are tried, the smallest turn first, so that it wins a tie."""
    spins = np.arange(-np.pi, np.pi - 1e-9, GRID_RAD)
    return spins[np.argsort(np.abs(spins), kind="stable")]


def _judged_rows(position_mm: Floats, axis: Floats | None, is_target: Bools | None) -> Ints:
    """Return rows spread over the program, its outermost points and tilts among them.

    With a point between two targets these are judged too.
    """
    rows = np.linspace(0, len(position_mm) - 1, min(_SAMPLES, len(position_mm))).astype(np.int64)
    tables = [position_mm] if axis is None or axis.strides[0] == 0 else [position_mm, axis]
    extremes = [op(table[:, k]) for table in tables for k in range(3) for op in (np.argmin, np.argmax)]
    rows = np.unique(np.concatenate([rows, extremes]))
    if is_target is None:
        return rows
    targets = np.flatnonzero(is_target)
    behind = np.searchsorted(targets, rows[~is_target[rows]])
    return np.unique(np.concatenate([rows, targets[behind - 1], targets[behind]]))


class _Judged:
    """The judged rows of a path: targets, at which the angle is chosen, and points between them."""

    def __init__(self, position_mm: Floats, rows: Ints, is_target: Bools | None) -> None:
        """Take the positions (p, 3), the rows (n,) of them that are judged, and which are targets (p,)."""
        steps = np.linalg.norm(np.diff(position_mm, axis=0), axis=1)
        self._path_mm = np.concatenate([[0.0], np.cumsum(steps)])
        at_mm = self._path_mm[rows]
        chosen = np.arange(len(rows)) if is_target is None else np.flatnonzero(is_target[rows])
        self._chosen, self._knots_mm = chosen, at_mm[chosen]
        self._allowed = np.maximum(1, (np.diff(self._knots_mm) / STEP_MM).astype(np.int64))
        self._passed: dict[int, tuple[Ints, Floats]] = {}
        for knot in (np.flatnonzero(np.diff(chosen) > 1) + 1).tolist():
            points = np.arange(chosen[knot - 1] + 1, chosen[knot])
            start, end = self._knots_mm[knot - 1 : knot + 1]
            self._passed[knot] = points, (at_mm[points] - start) / max(end - start, 1e-9)

    def along(self, spin_rad: Floats) -> Floats:
        """Return the angle (p,) along the path from those at the targets that were judged."""
        return np.asarray(np.interp(self._path_mm, self._knots_mm, spin_rad))

    def cheapest_track(self, cost: Floats) -> tuple[float, Ints]:
        """Return (cost, grid index per judged target) of the cheapest track through the grid (spins, n).

        It does not wrap at ±180°: a full turn about the tool would wind up A6.
        """
        size = len(cost)
        here, before = np.arange(size)[:, None], np.arange(size)[None, :]
        distance = np.abs(here - before)
        total = cost[:, self._chosen[0]].copy()
        came_from = np.zeros((len(self._chosen), size), dtype=np.int64)
        for k in range(1, len(self._chosen)):
            through = total[None, :] + np.where(
                distance <= self._allowed[k - 1], _CHANGE_COST * distance, np.inf
            )
            if k in self._passed:
                for point, share in zip(*self._passed[k], strict=True):
                    spins = np.round(before + share * (here - before), 9)
                    beside = (np.floor(spins), np.ceil(spins))
                    through += np.maximum(*(cost[each.astype(np.int64), point] for each in beside))
            came_from[k] = np.argmin(through, axis=1)
            total = through[np.arange(size), came_from[k]] + cost[:, self._chosen[k]]
        track = np.empty(len(self._chosen), dtype=np.int64)
        track[-1] = int(np.argmin(total))
        for k in range(len(track) - 1, 0, -1):
            track[k - 1] = came_from[k, track[k]]
        return float(total.min()), track


def _costs(table: Floats) -> Floats:
    """Return what a quality (spins, n, branches) costs."""
    return np.where(table > 0, 1.0 - np.minimum(table, 1.0), 1e3)


def _changing(judged: _Judged, spins: Floats, costs: Floats) -> Floats | None:
    """Dynamic programming along the path, per branch; None where it is no better than a constant.

    ``costs`` (spins, n, branches) are those at rising angles ``spins``.
    """
    best_cost, best_track = np.inf, None
    for branch in range(costs.shape[2]):
        cost, track = judged.cheapest_track(costs[:, :, branch])
        if cost < best_cost:
            best_cost, best_track = cost, track
    if best_track is None or best_cost >= costs.sum(axis=1).min():
        return None
    return judged.along(spins[best_track])
