"""How one recorded signal relates to another: columns, units, signs, frame, clock."""

import math
from typing import Literal, NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.compiled.core import BOOLS, FLOATS, INT, OUT_BOOLS, OUT_FLOATS, core_function
from gcode2krl.units import DEG_PER_RAD, MM_PER_INCH, MM_PER_M, RAD_PER_DEG

LENGTH_FACTORS = {
    1.0 / MM_PER_M: "metres",
    MM_PER_M: "micrometres",
    1.0 / MM_PER_INCH: "inches",
    MM_PER_INCH: "millimetres taken for inches",
}
ANGLE_FACTORS = {RAD_PER_DEG: "radians", DEG_PER_RAD: "degrees converted twice"}
_GRID_S = 0.04
_MOST_GRID = 8000
_MOST_COMPARED = 1000
_LEAST_GRID = 10
_LEAST_OVERLAP = 0.6
_BAD, _SAME = 0.3, 0.2
_CORRELATED = 0.98
_FACTOR_SLACK = 0.1
_RCOND = 1e-10
"""Of normal equations: four digits are plenty, and they are solved once for each offset."""

_fill_products = core_function(
    "runs_products", *(FLOATS, FLOATS, BOOLS, INT, INT), *(OUT_FLOATS, OUT_BOOLS), *(OUT_FLOATS,) * 3
)


class Odd(NamedTuple):
    """A column that does not follow its own reference but has an explanation."""

    kind: Literal["unit", "swapped", "sign"]
    column: int
    other: int
    """Column of the reference that it follows."""
    factor: float
    """Measured over reference, rounded to a known ratio of units."""


class Shift(NamedTuple):
    """measured(t + seconds) belongs to reference(t)."""

    seconds: float
    share: float
    """Fraction of the measured columns' variance that an affine map of the reference explains."""


def odd_columns(reference: Floats, measured: Floats, floor: float, factors: dict[float, str]) -> list[Odd]:
    """Return the columns of ``measured`` (n, k) that are in another unit, swapped, or of the other sign.

    Means are removed. A column is odd if it differs from its own reference by more than ``floor`` and by 30 %
    of the larger motion; it is explained if it is correlated with a reference column by more than 0.98 and
    has the slope of a known factor (within 10 %), or equals another column five times better than its own.
    """
    r, m = reference - reference.mean(axis=0), measured - measured.mean(axis=0)
    moves_r, moves_m = np.sqrt(np.mean(r**2, axis=0)), np.sqrt(np.mean(m**2, axis=0))
    covariance = m.T @ r / len(r)
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = np.nan_to_num(covariance / np.outer(moves_m, moves_r))
        slope = np.nan_to_num(covariance / moves_r**2)
    off = np.sqrt(np.maximum(moves_m[:, None] ** 2 + moves_r**2 - 2.0 * covariance, 0.0))
    odd = []
    for j in range(r.shape[1]):
        if off[j, j] <= max(floor, _BAD * max(moves_r[j], moves_m[j])):
            continue
        unit = _unit_of(slope[j, j], factors) if abs(correlation[j, j]) > _CORRELATED else 0.0
        k = int(np.argmin(off[j]))
        if unit:
            odd.append(Odd("unit", j, j, unit))
        elif k != j and off[j, k] < _SAME * off[j, j] and correlation[j, k] > _CORRELATED:
            odd.append(Odd("swapped", j, k, 1.0))
        elif correlation[j, j] < -_CORRELATED and abs(slope[j, j] + 1.0) < _FACTOR_SLACK:
            odd.append(Odd("sign", j, j, -1.0))
    return odd


def _unit_of(slope: float, factors: dict[float, str]) -> float:
    """Return the known factor that a slope is close to, 0.0 if none."""
    for factor in factors:
        if abs(abs(slope) / factor - 1.0) < _FACTOR_SLACK:
            return math.copysign(factor, slope)
    return 0.0


def corrected(measured: Floats, odd: list[Odd]) -> Floats:
    """Return the columns with odd ones corrected; the rest of a swap fills the columns that are free."""
    order = {entry.other: entry.column for entry in odd}
    free = [j for j in range(measured.shape[1]) if j not in order.values()]
    for column in range(measured.shape[1]):
        if column not in order and column in free:
            order[column] = column
            free.remove(column)
    for column in range(measured.shape[1]):
        if column not in order:
            order[column] = free.pop(0)
    factor = np.ones(measured.shape[1])
    for entry in odd:
        factor[entry.other] = entry.factor
    result: Floats = measured[:, [order[column] for column in range(measured.shape[1])]] / factor
    return result


def agree(reference: Floats, measured: Floats, like: float) -> bool:
    """Tell whether two signals (n, k) move alike: rms difference below ``like`` times that of the motion."""
    r, m = reference - reference.mean(axis=0), measured - measured.mean(axis=0)
    return bool(np.sum((m - r) ** 2) < like**2 * np.sum(r**2))


def best_shift(
    reference_s: Floats, reference: Floats, own_s: Floats, measured: Floats, reach_s: float
) -> Shift:
    """Return the clock offset within ± ``reach_s`` at which an affine map explains the most variance.

    The map absorbs units, signs, swapped columns and frames, so that the clock is found whatever else is
    wrong. At least 60 % of the shorter recording must overlap. Among equal offsets the smallest is taken.
    """
    first, last = max(reference_s[0], own_s[0] - reach_s), min(reference_s[-1], own_s[-1] + reach_s)
    grid = np.arange(first, last, _GRID_S)[:_MOST_GRID]
    if len(grid) < _LEAST_GRID:
        return Shift(0.0, 0.0)
    wanted = at(grid, reference_s, reference)
    most = int(reach_s / _GRID_S)
    around = grid[0] + _GRID_S * np.arange(-most, len(grid) + most)
    inside = (around >= own_s[0]) & (around <= own_s[-1])
    shifted = at(around, own_s, measured)
    least = max(_LEAST_GRID, int(_LEAST_OVERLAP * min(len(grid), int(np.count_nonzero(inside)))))
    every = max(1, len(grid) // _MOST_COMPARED)
    shares = _shares(wanted - wanted.mean(axis=0), shifted - shifted.mean(axis=0), inside, every, least)
    best = shares.max()
    if best < 0.0:
        return Shift(0.0, 0.0)
    good = np.flatnonzero(1.0 - shares <= 1.5 * (1.0 - best) + 1e-6)
    coarse = _GRID_S * (int(good[np.argmin(np.abs(good - most))]) - most)
    return _finer(Shift(coarse, float(best)), grid, wanted, own_s, measured)


def _finer(coarse: Shift, grid: Floats, wanted: Floats, own_s: Floats, measured: Floats) -> Shift:
    """Return the offset refined to a millisecond."""
    best = coarse
    for step_s in (1e-2, 1e-3):
        for seconds in best.seconds + step_s * np.arange(-5, 6):
            both = (grid + seconds >= own_s[0]) & (grid + seconds <= own_s[-1])
            if np.count_nonzero(both) >= _LEAST_GRID:
                share = explained(wanted[both], at(grid[both] + seconds, own_s, measured))
                best = Shift(float(seconds), share) if share > best.share else best
    return best


def _shares(reference: Floats, measured: Floats, inside: Bools, every: int, least: int) -> Floats:
    """Return `explained` of reference (n, k) at each row from which it can be laid on measured rows (m, j).

    Of the rows that are ``inside`` (m,) one in ``every`` is taken; -1 where fewer than ``least`` are inside.
    """
    enough, products, squares, total = _products(reference, measured, inside, every, least)
    inverse = np.linalg.pinv(squares, rcond=_RCOND, hermitian=True)
    parts = np.sum(products * (inverse @ products), axis=(1, 2))
    moves = total > 0.0
    shares: Floats = np.where(enough, np.where(moves, parts / np.where(moves, total, 1.0), 0.0), -1.0)
    return shares


def _products(
    reference: Floats, measured: Floats, inside: Bools, every: int, least: int
) -> tuple[Bools, Floats, Floats, Floats]:
    """Return for each offset whether rows are enough, and rᵀ·m, rᵀ·r and the sum of m² about their means."""
    k, j, offsets = reference.shape[1], measured.shape[1], len(measured) - len(reference) + 1
    enough, total = np.zeros(offsets, dtype=np.bool_), np.zeros(offsets)
    products, squares = np.zeros((offsets, k, j)), np.zeros((offsets, k, k))
    r, m = np.ascontiguousarray(reference), np.ascontiguousarray(measured)
    _fill_products(r, m, inside, every, least, np.empty(k + j), enough, products, squares, total)
    return enough, products, squares, total


def explained(reference: Floats, measured: Floats) -> float:
    """Return the fraction of the variance of ``measured`` (n, k) that an affine map of the other explains."""
    m = measured - measured.mean(axis=0)
    total = float(np.sum(m**2))
    if total == 0.0:
        return 0.0
    r = reference - reference.mean(axis=0)
    products = r.T @ m
    return (
        float(np.sum(products * (np.linalg.pinv(r.T @ r, rcond=_RCOND, hermitian=True) @ products))) / total
    )


def rotation_between(reference_mm: Floats, measured_mm: Floats) -> tuple[Floats, Floats]:
    """Return R (3, 3) and shift (3,) of measured = R·reference + shift by least squares (Kabsch 1976)."""
    centre_r, centre_m = reference_mm.mean(axis=0), measured_mm.mean(axis=0)
    r, m = reference_mm - centre_r, measured_mm - centre_m
    u, _, vt = np.linalg.svd(r.T @ m)
    mirror = np.diag([1.0, 1.0, float(np.sign(np.linalg.det(vt.T @ u.T)))])
    rotation = vt.T @ mirror @ u.T
    return rotation, centre_m - rotation @ centre_r


def at(times_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return ``values`` (n, k) at other times, by linear interpolation, held at the ends."""
    return np.stack([np.interp(times_s, own_s, column) for column in values.T], axis=1)


class PathCourse(NamedTuple):
    """The moving part of a path as points at equal times, with speed and direction."""

    position: Floats
    """(n, k)"""
    speed: Floats
    """(n,)"""
    direction: Floats
    """(n, k) unit vectors."""
    steady: Bools
    """(n,) True where the speed changes by less than 5 % within ± 0.16 s."""


def course(time_s: Floats, position: Floats, most: int) -> PathCourse:
    """Return the moving part of a path, at most ``most`` points; speeds are those over 0.16 s."""
    grid = np.arange(time_s[0], time_s[-1], _GRID_S)
    if len(grid) < _LEAST_GRID:
        grid = np.linspace(time_s[0], time_s[-1], _LEAST_GRID)
    points = at(grid, time_s, position)
    velocity = np.zeros_like(points)
    velocity[2:-2] = (points[4:] - points[:-4]) / (grid[4:] - grid[:-4])[:, None]
    speed = np.linalg.norm(velocity, axis=1)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(speed, 4, mode="edge"), 9)
    steady = np.ptp(around, axis=1) < 0.05 * speed
    moving = np.flatnonzero(speed > 0.1 * np.quantile(speed, 0.95))
    chosen = moving[:: max(1, math.ceil(len(moving) / most))]
    with np.errstate(invalid="ignore"):
        direction = np.nan_to_num(velocity[chosen] / speed[chosen, None])
    return PathCourse(points[chosen], speed[chosen], direction, steady[chosen])


def nearest(points: Floats, others: Floats) -> tuple[Ints, Floats]:
    """Return for each of ``points`` (n, k) the nearest of ``others`` (p, k), and its distance."""
    squares = np.sum(points**2, axis=1)[:, None] + np.sum(others**2, axis=1) - 2.0 * points @ others.T
    index = np.argmin(squares, axis=1)
    return index, np.linalg.norm(points - others[index], axis=1)
