"""The refit of an effect that plans anew.

Its signals are late by seconds, and least squares on them have a minimum at each stop. Where little
more than noise is left they have one minimum, and a few steps tell what the effect can bring.
"""

from collections.abc import Iterator

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.fit.fitted import Fitted
from gcode2krl.gap.fit.refitting import refit, searched
from gcode2krl.gap.fit.signatures import Block
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
_STARTS = (1.0, -0.7, 3.0)
"""In typical sizes from nominal: both ways, and far."""
_NEAR_STEPS = 3
_PLACED = 2
"""So many of the starts, those nearest to the measured times, are fitted."""


def replanned(found: Examination, block: Block, linear: Applied, best_chi2: float) -> Fitted:
    """Return the best refit from the numbers that meet the times at which the runs are at each place.

    Where these leave many times ``best_chi2``, that of the best other effect, no better ones are searched
    for. Where little more than noise is left of the runs, the first order has to bring a share of its gain.
    """
    hopeless = _LIMITS.hopeless * best_chi2
    if np.isfinite(best_chi2) and found.fitted.chi2 <= _LIMITS.hopeless * found.data.values:
        near = refit(found.likelihood, (*found.applied, linear), steps=_NEAR_STEPS)
        if found.fitted.chi2 - near.chi2 < _LIMITS.bent_share * (found.fitted.chi2 - best_chi2):
            return near
    times, likelihood, others = found.data.place_times, found.likelihood, found.applied
    starts = sorted([linear, *_starts(found, block, linear)], key=lambda each: times.size((*others, each)))
    placed = [times.fitted(others, start) for start in starts[:_PLACED]]
    rough = [refit(likelihood, (*others, start), steps=2) for start in placed]
    best = min(rough, key=lambda each: each.chi2)
    if best.chi2 > hopeless:
        return best
    better = [searched(likelihood, others, start) for start in placed]
    return min([best, *(refit(likelihood, (*others, each)) for each in better)], key=lambda each: each.chi2)


def _starts(found: Examination, block: Block, linear: Applied) -> Iterator[Applied]:
    """Yield the effect with all sizes away from nominal by as many typical sizes."""
    effect, inputs = block.effect, found.traces[0].inputs
    nominal, typical = effect.nominal(inputs, block.target), effect.start(inputs, block.target)
    for factor in _STARTS:
        sizes = {
            p.name: float(
                np.clip(nominal[p.name] + factor * (typical[p.name] - nominal[p.name]), p.low, p.high)
            )
            for p in effect.parameters
            if not p.is_shape and np.isfinite(nominal[p.name])
        }
        yield Applied(effect, block.target, dict(linear.values) | sizes | dict(block.shape))
