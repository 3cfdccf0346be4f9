"""90 % intervals of parameters: the covariance of a fit by clusters, and what the model itself is off by."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import stats

from gcode2krl.arrays import Floats
from gcode2krl.effects import Parameter, Role
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.constancy import spread_between_runs
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.fit.clusters import clustered_covariance
from gcode2krl.gap.fit.fitted import Fitted, Numbers
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
_DRAWS = 400
"""Quantiles at 5 and 95 % are then known to a tenth of a deviation."""
_ENDS = (0.05, 0.95)


class Interval(NamedTuple):
    """A value and its 90 % interval."""

    value: float
    low: float
    high: float


def intervals_of(found: Examination) -> list[dict[str, Interval]]:
    """Return the interval of every parameter of every accepted effect.

    Quantiles of draws from the fit's covariance, added in quadrature to the errors of models and to what the
    effect's size differs by from run to run. A size that was held has the interval that it would have if it
    were free; a shape that was held was not found, and has none.
    """
    if not found.applied:
        return []
    draws = _draws(found.fitted, covariance_of(found.likelihood, found.fitted))
    intervals = [_effect_intervals(found, number, draws) for number in range(len(found.applied))]
    if not any(each.held for each in found.applied):
        return intervals
    free = replace(found, fitted=_freed(found.fitted, found.traces[0]))
    wide = intervals_of(free)
    return [
        {
            name: wide[number][name] if name in applied.held else own
            for name, own in intervals[number].items()
            if name not in applied.held or not applied.effect.parameter(name).is_shape
        }
        for number, applied in enumerate(found.applied)
    ]


def _freed(fitted: Fitted, trace: Trace) -> Fitted:
    """Return a fit at the same numbers with those free that were held."""
    applied = tuple(replace(each, held=frozenset()) for each in fitted.applied)
    numbers = Numbers.of(applied, trace)
    x = numbers.start(applied)
    return Fitted(applied, fitted.chi2, numbers, x, np.zeros((len(x), len(x))))


def _draws(fitted: Fitted, covariance: Floats) -> Floats:
    """Return draws (d, p) of the numbers."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2.0)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    normal = np.random.default_rng(0).standard_normal((_DRAWS, len(fitted.x)))
    draws: Floats = fitted.x + normal @ root.T
    return draws


def _effect_intervals(found: Examination, number: int, draws: Floats) -> dict[str, Interval]:
    """Return the interval of each parameter of an accepted effect."""
    numbers, values = found.fitted.numbers, found.applied[number].values
    free, own = numbers.free[number], draws[:, numbers.slices[number]]
    drawn = [free.applied(x).values for x in np.clip(own, free.low, free.high)]
    share = _LIMITS.law_error if free.effect.plans_anew else _LIMITS.model_error
    mismatch, between = _mismatch(found, number), _between_runs(found, number)
    return {
        name: _interval(
            free.effect.parameter(name),
            value,
            np.array([each[name] for each in drawn]),
            float(np.linalg.norm([share * value, mismatch.get(name, 0.0), between * value])),
        )
        for name, value in values.items()
    }


def _between_runs(found: Examination, number: int) -> float:
    """Return the half-width, as a share, that the spread between runs adds to a clock.

    Student's quantile of the mean over the runs.
    """
    applied = found.applied[number]
    if not applied.effect.is_clock or not found.likelihood.own_alike(applied):
        return 0.0
    spread, runs = spread_between_runs(found, number)
    return float(stats.t.ppf(_ENDS[1], runs - 1) * spread / runs**0.5) if runs > 1 else 0.0


def _mismatch(found: Examination, number: int) -> dict[str, float]:
    """Return the half-widths that normal mismatch of the same form adds to an effect in a joint.

    It is nuisance of the covariance at its own small size, which at that of the effect has another shape.
    """
    effect = found.applied[number].effect
    if not found.link.of_joints or found.link.tells_time or not effect.is_nuisance:
        return {}
    bounds = effect.usual(found.question.mismatch, 1.0)
    return {name: _LIMITS.inside_bound * bound for name, bound in bounds.items()}


def _interval(parameter: Parameter, value: float, drawn: Floats, model: float) -> Interval:
    """Return the interval of draws (d,), an angle's about its value, and of what the model is off by."""
    away = drawn - value
    model = 0.0 if parameter.role in (Role.COUNT, Role.MOMENT) else model
    if parameter.role is Role.PHASE:
        away = (away + np.pi) % (2.0 * np.pi) - np.pi
    low, high = np.quantile(away, _ENDS).tolist()
    return Interval(value, value - float(np.hypot(low, model)), value + float(np.hypot(high, model)))


def covariance_of(likelihood: Likelihood, fitted: Fitted) -> Floats:
    """Return the covariance (p, p) of a fit's numbers by stretches of time.

    The information holds the prior of `prior_sizes`: what the data do not see stays as uncertain as it was.
    Fewer stretches than `least_stretches` cannot tell how scores scatter.
    """
    scale = fitted.numbers.box.scale
    jacobian = likelihood.jacobian(fitted.numbers, fitted.x, bounded=False)
    information = jacobian.T @ jacobian + THRESHOLDS.fit.prior_sizes**-2 * np.eye(len(scale))
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    scores = likelihood.scores(jacobian, likelihood.residual(fitted.applied))
    if len(scores) >= _LIMITS.least_stretches:
        covariance = clustered_covariance(covariance, scores, small_sample=True)
    scaled: Floats = covariance * np.outer(scale, scale)
    return scaled
