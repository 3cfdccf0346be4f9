"""The refit of an effect that plans anew.

Its signals are late by seconds, and least squares on them have a minimum at each stop.
"""

from collections.abc import Iterator

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.fit.fitted import Fitted
from gcode2krl.gap.fit.refitting import refit, searched
from gcode2krl.gap.fit.signatures import Block

_STARTS = (1.0, -0.7, 3.0)
"""In typical sizes from nominal: both ways, and far."""
_PLACED = 2
"""So many of the starts, those nearest to the measured times, are fitted."""


def replanned(found: Examination, block: Block, linear: Applied, hopeless: float) -> Fitted:
    """Return the best refit from the numbers that meet the times at which the runs are at each place.

    Where these leave more than ``hopeless`` as chi2 no better ones are searched for.
    """
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
