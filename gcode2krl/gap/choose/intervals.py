"""Intervals of parameters: curvature of chi2, with a sandwich over stretches of time for coloured rests."""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.choose.selection import Examination
from gcode2krl.gap.fit.gram import PRIOR, stretches_of_all
from gcode2krl.gap.fit.numbers import FIXED
from gcode2krl.gap.fit.sensitivity import unbounded_jacobian
from gcode2krl.gap.fit.signatures import PHASE

_DRAWS = 400
_MODEL, _LAW = 0.03, 0.1
"""Shares of a number that models are off by, whatever the noise: of all effects, of those that plan anew.

As half-widths of 90 % intervals; from calibration runs of `tests/plant`, not from those that are scored.
"""
_INSIDE = 0.9
"""Of a uniform draw nine in ten are within this share of its bound."""
_SHARED = ("tau_s", "gap_deg", "amplitude_deg")
_LEAST_STRETCHES = 8


class Interval(NamedTuple):
    """A value and its 90 % interval."""

    value: float
    low: float
    high: float


def intervals_of(found: Examination) -> list[dict[str, Interval]]:
    """Return the interval of every parameter of every accepted effect.

    The covariance of the fit's numbers is H⁻¹·B·H⁻¹ with H the curvature and B the sum over stretches of time
    of the outer products of their scores (White 1980, by clusters); never less than H⁻¹ alone. H holds what
    was known before: a size is expected within `PRIOR` typical ones.
    """
    if not found.applied:
        return []
    covariance = _covariance(found)
    generator = np.random.default_rng(0)
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2.0)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = found.fitted.x + generator.standard_normal((_DRAWS, len(found.fitted.x))) @ root.T
    result, at = [], 0
    for number, free in enumerate(found.fitted.free):
        width = len(free.names)
        mine = np.clip(draws[:, at : at + width], free.low, free.high)
        at += width
        drawn = [free.applied(x).values for x in mine]
        own = found.applied[number].values
        share = _LAW if free.effect.plans_anew else _MODEL
        usual = _usual(found, number)
        result.append(
            {
                name: _interval(
                    name,
                    own[name],
                    np.array([d[name] for d in drawn]),
                    float(np.hypot(share * own[name], usual.get(name, 0.0))),
                )
                for name in own
            }
        )
    return result


def _usual(found: Examination, number: int) -> dict[str, float]:
    """Return what normal mismatch of the same form adds to the numbers of an effect in a joint, nine in ten.

    It is a nuisance of the fit at its own small size, which at the size of the effect has another shape.
    """
    if not found.link.of_joints or found.link.tells_time:
        return {}
    limits = found.question.mismatch.limits(found.applied[number], 1.0)
    return {name: _INSIDE * limit for name, limit in limits.items() if name in _SHARED}


def _interval(name: str, value: float, drawn: Floats, model: float) -> Interval:
    """Return the 90 % interval of draws (d,), an angle's about its value, and of what the model is off by."""
    away = drawn - value
    model = 0.0 if name in FIXED else model
    if name == PHASE:
        away = (away + np.pi) % (2.0 * np.pi) - np.pi
    low, high = np.quantile(away, [0.05, 0.95]).tolist()
    return Interval(value, value - float(np.hypot(low, model)), value + float(np.hypot(high, model)))


def _covariance(found: Examination) -> Floats:
    residual = found.target.residual(found.applied)
    scale = np.concatenate([free.scale for free in found.fitted.free])
    scaled = unbounded_jacobian(found.target, found.fitted) * scale
    # what the data do not see at all is as uncertain as it was before them
    inverse = np.linalg.inv(scaled.T @ scaled + PRIOR**-2 * np.eye(len(scale)))
    clusters = stretches_of_all(found.traces)
    rows = len(clusters)
    scores = scaled[:rows] * residual[:rows, None]
    names = np.unique(clusters)
    sums = np.stack([scores[clusters == name].sum(axis=0) for name in names])
    plain: Floats = inverse * np.outer(scale, scale)
    if len(names) < _LEAST_STRETCHES:
        return plain
    meat = sums.T @ sums * len(names) / (len(names) - 1.0)
    robust: Floats = inverse @ meat @ inverse * np.outer(scale, scale)
    grown = np.sqrt(np.maximum(np.diag(robust) / np.maximum(np.diag(plain), 1e-300), 1.0))
    widened: Floats = plain * np.outer(grown, grown)
    return widened
