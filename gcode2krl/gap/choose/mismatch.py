"""Which accepted effects are within normal mismatch: part of the model, and not reported."""

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose


def within_mismatch(found: Examination, number: int) -> bool:
    """Tell whether every number of an accepted effect may be what normal mismatch allows, to 1 sigma."""
    applied, question = found.applied[number], found.question
    trace = found.traces[0]
    duration_s = float(trace.time_s[-1] - trace.time_s[0])
    limits = applied.effect.usual(question.mismatch, duration_s, question.clocks)
    if not limits:
        return False
    if applied.effect.plans_anew:
        return _time_off_s(found, applied) <= question.mismatch.clock_s
    nominal = applied.effect.nominal(trace.inputs, applied.target)
    deviation = found.fitted.deviations(number)
    limits = _with_others(found, applied, limits)
    return all(
        abs(applied.values[name] - nominal[name])
        <= _LIMITS.mismatch_slack * limits.get(name, 0.0)
        + _LIMITS.mismatch_deviations * deviation.get(name, 0.0)
        for name in applied.effect.names
        if not applied.effect.parameter(name).is_shape
    )


def _with_others(found: Examination, applied: Applied, limits: dict[str, float]) -> dict[str, float]:
    """Return the bounds; usual sizes of others that together have its form add to that of the first size."""
    size, inputs = applied.effect.sizes[0].name, found.traces[0].inputs
    typical = applied.effect.start(inputs, applied.target)[size]
    typical -= applied.effect.nominal(inputs, applied.target)[size]
    more = abs(typical) * found.likelihood.once.allowed_sizes(applied)
    return {**limits, size: limits.get(size, 0.0) + more}


def _time_off_s(found: Examination, applied: Applied) -> float:
    """Return the clock error that would change the signals by as much power as an effect does, in s."""
    change = sum(float(np.sum((trace.sample([applied]) - trace.nominal) ** 2)) for trace in found.traces)
    rate = sum(float(np.sum(trace.rate**2)) for trace in found.traces)
    return float(np.sqrt(change / rate)) if rate > 0.0 else 0.0
