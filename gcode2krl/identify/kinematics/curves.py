"""What each joint errs by over its angle: the error curve of its gear and its encoder, beside all numbers.

A wave gear errs by an arcminute and more, with periods of its teeth and of its motor, and so does an encoder;
no number of the chain does that. Where the poses show such curves, they and a change of all numbers follow
from one linear problem around the fit: the curves are sums of hats over the angle within a turn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.identify.kinematics.fit import Fit, steps_of
from gcode2krl.identify.kinematics.parameters import ArmPoses, Model
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG

_HAT_RAD = 4.0 * RAD_PER_DEG
"""Half-width of a hat, finer than the waves that a UR10 shows (12-20 deg)."""
_CURVE_RAD = RAD_PER_DEG / 60.0
"""Makers of wave gears state 0.5-1.5 arcmin of transmission error."""
_BRINGS = 0.8
"""Of the error at places left out, what may be left for the curves to be told."""
_ROUNDS = 4


class Curve(NamedTuple):
    """The error of one joint at some of its angles within a turn, both (c,) in its controller's sense."""

    angle_deg: Floats
    error_deg: Floats


@dataclass(frozen=True, eq=False)
class Curves:
    """The curves of six joints, and how far the points are off with them."""

    joints: tuple[Curve, ...]
    after_mm: Floats
    """(n,) at places left out of both the numbers and the curves."""


def curves_of(
    model: Model, fit: Fit, poses: ArmPoses, places: Ints, after_mm: Floats, signs: Sequence[float]
) -> Curves | None:
    """Return the curves; None where they bring less than a fifth at places left out, or the poses are few.

    ``after_mm`` (n,): how far the points are off at places left out without them; ``signs`` (6,) of joints.
    """
    good: Bools = ~fit.is_outlier
    hats = [_hats(angle) for angle in poses.own_rad.T]
    tip, slopes = model.slopes(fit.theta)
    plain, _, acts = model.chain.walk(fit.theta)
    bends = []
    for joint, (_, basis) in enumerate(hats):
        axis, place = acts[f"A{joint + 1}"]
        turned = signs[joint] * np.cross(axis, plain - place)
        bends.append(turned[:, :, None] * basis[:, None, :])
    columns = np.concatenate([slopes * steps_of(model), *(_CURVE_RAD * bend for bend in bends)], axis=2)
    if 3 * int(good.sum()) < 2 * columns.shape[2]:
        return None
    off = poses.measured_mm - tip
    blocks = {int(k): _normal(columns, off, good & (places == k)) for k in np.unique(places)}
    gram, score = (sum(parts) for parts in zip(*blocks.values(), strict=True))
    solution = _solved(columns[good], off[good], gram, score, fit.sigma_mm)
    curved_mm = np.empty(len(off))
    for number, (own_gram, own_score) in blocks.items():
        out = places == number
        rows = good & ~out
        known = _solved(columns[rows], off[rows], gram - own_gram, score - own_score, fit.sigma_mm)
        curved_mm[out] = np.linalg.norm(off[out] - columns[out] @ known, axis=1)
    if np.mean(curved_mm[good] ** 2) > _BRINGS**2 * np.mean(after_mm[good] ** 2):
        return None
    sizes = np.cumsum([slopes.shape[2], *(len(angle) for angle, _ in hats)])
    return Curves(
        tuple(
            Curve(angle * DEG_PER_RAD, _CURVE_RAD * DEG_PER_RAD * solution[start:end])
            for (angle, _), start, end in zip(hats, sizes[:-1], sizes[1:], strict=True)
        ),
        curved_mm,
    )


def _hats(angle_rad: Floats) -> tuple[Floats, Floats]:
    """Return the middles (c,) of hats over the angles that are visited, and the hats (n, c)."""
    within = np.mod(angle_rad, 2.0 * np.pi)
    count = round(2.0 * np.pi / _HAT_RAD)
    middles = np.arange(count) * 2.0 * np.pi / count
    away = np.abs(np.mod(within[:, None] - middles + np.pi, 2.0 * np.pi) - np.pi)
    hats = np.maximum(1.0 - away * count / (2.0 * np.pi), 0.0)
    visited = hats.any(axis=0)
    return middles[visited], hats[:, visited]


def _normal(columns: Floats, off_mm: Floats, rows: Bools) -> tuple[Floats, Floats]:
    flat = columns[rows].reshape(-1, columns.shape[2])
    return flat.T @ flat, flat.T @ off_mm[rows].reshape(-1)


def _solved(columns: Floats, off_mm: Floats, gram: Floats, score: Floats, sigma_mm: float) -> Floats:
    """Return the numbers (p,) in units of their widths; the noise is what they leave."""
    solution = np.zeros(len(score))
    for _ in range(_ROUNDS):
        covariance = np.linalg.inv(gram + sigma_mm**2 * np.eye(len(gram)))
        solution = covariance @ score
        freedom = max(off_mm.size - float(np.sum(covariance * gram)), 1.0)
        sigma_mm = float(np.sqrt(np.sum((off_mm - columns @ solution) ** 2) / freedom))
    return solution
