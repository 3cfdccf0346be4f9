"""A table of another exporter beside the prediction: which unit, which order and which clock fit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from gcode2krl.arrays import Floats
from gcode2krl.runs import matching
from gcode2krl.units import DEG_PER_RAD, MM_PER_M

_FOLLOWS, _REACH_S = 0.9, 10.0
_NEAR_DEG, _MUCH_WORSE = 5.0, 3.0
"""A joint that is nearer follows the predicted one; the next best must be so many times worse."""
_ALIKE = (0.2, 5.0)
"""Ratio of the lengths of two recordings of one run, or of their extents."""
_MOVES_DEG = 0.05


@dataclass(frozen=True, eq=False)
class Plan:
    """The predicted motion."""

    time_s: Floats
    q_deg: Floats | None
    """(m, 6)"""
    position_mm: Floats
    """(m, 3)"""

    @classmethod
    def of(cls, prediction: Any) -> "Plan | None":
        """Return the plan of a prediction with a motion."""
        if prediction is None or prediction.motion is None:
            return None
        joints = prediction.joints
        return cls(
            prediction.motion.time_s,
            None if joints is None else joints.q_rad * DEG_PER_RAD,
            prediction.motion.position_mm,
        )


class JointFit(NamedTuple):
    """The unit and order of joints that are nearest to the prediction's."""

    unit: str
    order: tuple[int, ...]
    """Of each column the joint it follows, from 0."""
    certain: bool
    clock_s: float


def joint_fit(
    time_s: Floats, values: Floats, plan: Plan, factors: Mapping[str, float], units: Sequence[str]
) -> JointFit | None:
    """Return how columns (n, 6) fit the predicted joints; None where the motion is another one.

    Clocks are found whatever the unit and order (an affine map); then each column is compared with each
    joint, levels included, and columns are assigned to joints by the least sum of squares.
    """
    good = np.isfinite(values).all(axis=1) & np.isfinite(time_s)
    if plan.q_deg is None or np.count_nonzero(good) < 10 or not np.isfinite(plan.q_deg).all():
        return None
    own_s, measured = time_s[good], values[good]
    if (np.diff(own_s) <= 0.0).any():
        return None
    reach_s = _REACH_S + abs(float(np.ptp(own_s)) - float(np.ptp(plan.time_s)))
    shift = matching.best_shift(plan.time_s, plan.q_deg, own_s, measured, reach_s)
    if shift.share < _FOLLOWS:
        return None
    at_s = plan.time_s + shift.seconds
    inside = (at_s >= own_s[0]) & (at_s <= own_s[-1])
    wanted, logged = plan.q_deg[inside], matching.at(at_s[inside], own_s, measured)
    fits = []
    for unit in units:
        apart = _apart(logged * factors[unit], wanted)
        rows, order = linear_sum_assignment(apart**2)
        fits.append((float(np.sqrt(np.mean(apart[rows, order] ** 2))), unit, order, apart))
    fits.sort(key=lambda fit: fit[0])
    least, unit, order, apart = fits[0]
    moves = np.ptp(wanted, axis=0) > _MOVES_DEG
    others = np.where(np.arange(6)[None, :] == order[:, None], np.inf, apart)
    clear = bool((others.min(axis=1) > _MUCH_WORSE * apart[np.arange(6), order])[moves[order]].all())
    other = len(fits) < 2 or fits[1][0] > _MUCH_WORSE * least
    near = bool((apart[np.arange(6), order] < _NEAR_DEG).all())
    if not near or not other:
        return JointFit(unit if near and other else "", tuple(range(6)), False, shift.seconds)
    kept = tuple(int(joint) for joint in order)
    return JointFit(unit, kept, clear, shift.seconds)


def _apart(logged: Floats, wanted: Floats) -> Floats:
    """Return (6, 6) the rms between each column and each joint."""
    difference = logged[:, :, None] - wanted[:, None, :]
    apart: Floats = np.sqrt(np.mean(difference**2, axis=0))
    return apart


def length_unit(values: Floats, plan: Plan) -> str:
    """Return mm or m, by how far positions (n, 3) spread beside the predicted ones; "" where neither fits."""
    spread = float(np.linalg.norm(np.nanstd(values, axis=0)))
    planned = float(np.linalg.norm(plan.position_mm.std(axis=0)))
    if planned <= 0.0:
        return ""
    sizes = {"mm": 1.0, "m": MM_PER_M}
    fit = [unit for unit, size in sizes.items() if _ALIKE[0] < spread * size / planned < _ALIKE[1]]
    return fit[0] if len(fit) == 1 else ""


def time_units(values: Floats, plan: Plan) -> list[str]:
    """Return the units in which a recording is about as long as the prediction."""
    span, planned_s = float(np.nanmax(values) - np.nanmin(values)), float(np.ptp(plan.time_s))
    sizes = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    return [unit for unit, size in sizes.items() if _ALIKE[0] < span * size / planned_s < _ALIKE[1]]
