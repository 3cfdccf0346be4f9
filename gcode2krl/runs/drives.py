"""Motor angles of the drives → axis angles, by the commanded angles of the interpolator.

axis_n(t) = sum of c_k · motor_k(t + lag) + zero, with k = n for A1 to A4 and k = 4 … n for A5 and A6, whose
motors turn with the wrist axes before them (``$COUP_COMP``). c and zero come from least squares over the
whole recording; all axes have one lag: the interpolator is ahead of the drives, by 40-100 ms on a KRC.
Commanded and actual angle of a drive get the same c and zero, so that the fit does not remove their
difference, the servo error.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats

_AXIS_RANGE_DEG = 370.0
"""No axis of the robots here turns further; a motor does."""
_LONGEST_LAG_S = 0.2
_LEAST_TURN_DEG = 0.2
_SAME_SCALE = 0.02
_WORST_FIT_DEG = 0.05
_MOST_SAMPLES = 2000


class Angles(NamedTuple):
    """Angles in degrees over time, NaN columns where a joint was not recorded."""

    time_s: Floats
    """(n,)"""
    deg: Floats
    """(n, 6)"""


class _Fit(NamedTuple):
    factors: Floats
    """(6,)"""
    zero_deg: float
    rms_deg: float


def axis_angles(
    drive: Angles, actual_deg: Floats, wanted: Angles | None, gear_ratio: Sequence[float] | None
) -> tuple[Floats, Floats, list[str]]:
    """Return commanded and actual axis angles (n, 6) in degrees, and a text for each axis on what was done.

    Parameters
    ----------
    drive : commanded angles of the drives.
    actual_deg : (n, 6) actual angles of the drives, at the same times.
    wanted : the interpolator's commanded axis angles, where they were recorded.
    gear_ratio : (6,) used where there is no other source; sign and zero are then unknown.

    Columns that cannot be turned into axis angles become NaN.
    """
    command, actual, words = drive.deg.copy(), actual_deg.copy(), []
    without_command = np.isnan(drive.deg).all(axis=0)
    motor = Angles(drive.time_s, np.where(without_command, actual_deg, drive.deg))
    lag_s = _common_lag(motor, wanted) if wanted is not None else 0.0
    for axis in range(6):
        both = np.stack([drive.deg[:, axis], actual_deg[:, axis]])
        if np.isnan(both).all():
            continue
        fit, text = _axis(axis, motor, float(np.nanmax(np.abs(both))), wanted, lag_s, gear_ratio)
        if text:
            words.append(f"A{axis + 1}: {text}")
        command[:, axis], actual[:, axis] = _applied(fit, drive.deg), _applied(fit, actual_deg)
    return command, actual, words


def _axis(
    axis: int,
    drive: Angles,
    largest_deg: float,
    wanted: Angles | None,
    lag_s: float,
    gear_ratio: Sequence[float] | None,
) -> tuple[_Fit, str]:
    """Return the map from motor angles to the angle of one axis, NaN where it is unknown."""
    as_is, unknown = _Fit(np.eye(6)[axis], 0.0, 0.0), _Fit(np.full(6, np.nan), 0.0, 0.0)
    if wanted is not None and _moves(wanted.deg[:, axis]) and _moves(drive.deg[:, axis]):
        alone = _fit(axis, [axis], drive, wanted, lag_s)
        if abs(alone.factors[axis] - 1.0) < _SAME_SCALE and alone.rms_deg < _WORST_FIT_DEG:
            return as_is, ""
        fit = _fit(axis, list(range(min(axis, 3), axis + 1)), drive, wanted, lag_s)
        if fit.rms_deg > _WORST_FIT_DEG or fit.factors[axis] == 0.0:
            return unknown, "the drive does not follow the interpolator's angle, left out"
        ratio = 1.0 / fit.factors[axis]
        return fit, f"motor angle, gear ratio {ratio:.6g} found with {fit.rms_deg:.2g} deg rms"
    if largest_deg <= _AXIS_RANGE_DEG:
        return as_is, ""
    if gear_ratio is None:
        return unknown, "motor angle of unknown gear ratio, left out; record AxisPos_CmdIpo of a moving axis"
    fit = _Fit(np.eye(6)[axis] / gear_ratio[axis], 0.0, 0.0)
    return fit, f"motor angle over the cell's gear ratio {gear_ratio[axis]:g}; sign and zero unknown"


def _common_lag(drive: Angles, wanted: Angles) -> float:
    """Return the lag with the smallest sum of squared relative misfits."""
    moving = [n for n in range(6) if _moves(wanted.deg[:, n]) and _moves(drive.deg[:, n])]
    if not moving:
        return 0.0

    def misfit(lag_s: float) -> float:
        fits = [(n, _fit(n, list(range(min(n, 3), n + 1)), drive, wanted, lag_s)) for n in moving]
        return sum((fit.rms_deg / _range(wanted.deg[:, n])) ** 2 for n, fit in fits)

    lags = np.arange(0.0, _LONGEST_LAG_S, 4e-3)
    lags = lags[int(np.argmin([misfit(float(lag)) for lag in lags]))] + np.arange(-4e-3, 4.1e-3, 2.5e-4)
    return float(lags[int(np.argmin([misfit(float(lag)) for lag in lags]))])


def _fit(axis: int, motors: list[int], drive: Angles, wanted: Angles, lag_s: float) -> _Fit:
    """Return the least squares fit of one axis to some motors; motors at rest are ignored."""
    motors = [n for n in motors if _moves(drive.deg[:, n])]
    every = max(1, len(wanted.time_s) // _MOST_SAMPLES)
    time_s, y = wanted.time_s[::every] + lag_s, wanted.deg[::every, axis]
    x = np.stack([np.interp(time_s, drive.time_s, drive.deg[:, n]) for n in motors], axis=1)
    good = (time_s >= drive.time_s[0]) & (time_s <= drive.time_s[-1]) & np.isfinite(y + x.sum(axis=1))
    if np.count_nonzero(good) <= len(motors) + 1:
        return _Fit(np.zeros(6), 0.0, float("inf"))
    x, y = x[good], y[good]
    factors = np.linalg.lstsq(x - x.mean(axis=0), y - y.mean(), rcond=None)[0]
    zero = float(y.mean() - x.mean(axis=0) @ factors)
    spread = np.zeros(6)
    spread[motors] = factors
    return _Fit(spread, zero, float(np.sqrt(np.mean((y - x @ factors - zero) ** 2))))


def _applied(fit: _Fit, motor_deg: Floats) -> Floats:
    used = np.flatnonzero(fit.factors)
    result: Floats = motor_deg[:, used] @ fit.factors[used] + fit.zero_deg
    return result


def _moves(deg: Floats) -> bool:
    return _range(deg) > _LEAST_TURN_DEG


def _range(deg: Floats) -> float:
    known = deg[np.isfinite(deg)]
    return float(np.ptp(known)) if len(known) else 0.0
