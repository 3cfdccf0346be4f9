"""Which numbers of an effect the data give: the others are held, and not stated as found.

A minor number (a clock's skew) stays nominal unless the data show it: all of them together, and runs that it
was not fitted to. A shape whose interval spans its range, or that stands at an end of it for no gain, stays
at its typical value: any other would do as well.
"""

from dataclasses import replace

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.fit.fitted import Fitted
from gcode2krl.gap.fit.refitting import refit
from gcode2krl.gap.fit.sensitivity import Sensitivity, sensitivity_of
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose


def with_shown_numbers(found: Examination, fitted: Fitted) -> Fitted:
    """Return the refit with those numbers of its last effect held that lower chi2 by too little."""
    *others, last = fitted.applied
    if fitted.at_bound[-1] or last.effect.plans_anew:
        return fitted
    doubtful = _doubtful(fitted) - last.held
    if not doubtful:
        return fitted
    sensitivity = sensitivity_of(found.likelihood, fitted, len(others))
    plain = refit(found.likelihood, (*others, _held(found, last, doubtful)))
    if plain.chi2 - fitted.chi2 < _LIMITS.minor_chi2 * sensitivity.inflation():
        return plain
    return fitted if _carries_over(found, sensitivity, plain) else plain


def _carries_over(found: Examination, sensitivity: Sensitivity, plain: Fitted) -> bool:
    """Tell whether the numbers lower chi2 of runs that they were not fitted to; true of a single run.

    What a model is off by for seconds in one run is one draw there, however many rows it has.
    """
    values = [trace.measured.size for trace in found.traces]
    if len(values) < 2:
        return True
    before = found.likelihood.residual(plain.applied)
    return sensitivity.gain_of_left_out(before, np.repeat(np.arange(len(values)), values)) > 0.0


def _doubtful(fitted: Fitted) -> frozenset[str]:
    """Return the numbers of the last effect that the data may not give."""
    last = len(fitted.applied) - 1
    free, x = fitted.numbers.free[last], fitted.x[fitted.numbers.slices[last]]
    minor = frozenset(p.name for p in free.effect.sizes if p.minor)
    spanned = free.shapes_spanned(fitted.deviations(last))
    return minor | spanned | free.shapes_at_end(x)


def _held(found: Examination, applied: Applied, names: frozenset[str]) -> Applied:
    """Return an effect with some numbers held: sizes nominal, shapes typical."""
    effect, inputs = applied.effect, found.traces[0].inputs
    nominal, typical = effect.nominal(inputs, applied.target), effect.start(inputs, applied.target)
    fixed = {name: typical[name] if effect.parameter(name).is_shape else nominal[name] for name in names}
    return replace(applied, values={**applied.values, **fixed}, held=applied.held | names)
