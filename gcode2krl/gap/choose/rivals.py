"""How probable each cause is: against no effect, its rivals, and something that the library does not have."""

from dataclasses import dataclass

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.gap.choose.scoring import scores
from gcode2krl.gap.choose.selection import Examination, tangents_of
from gcode2krl.gap.fit.gram import Ledger
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.refitting import refit
from gcode2krl.gap.fit.sensitivity import slope_of

TEMPERATURE = 3.0
"""Differences of chi2 are divided by it: noise and effects are not exactly what they are modelled as."""
ALIKE = 9.2
"""Twice log 100: data that favour one of two effects by less than that do not tell them apart."""
UNKNOWN_SHARE = 0.15
"""A rest above this share of the structured gap is more than the form of an effect is off by (gap.md)."""
_UNKNOWN_WIDTH = 0.03
_RIVALS = 8
_CLOSE_SHARE, _BENT_SHARE, _CLOSE_GAIN = 0.25, 0.7, 15.0
"""Rivals whose first order gains less than this below the cause are refitted; of a bent one, this."""


@dataclass(frozen=True)
class Rival:
    """An effect in place of a cause, and by how much chi2 and the cost of its numbers are higher with it."""

    applied: Applied
    worse: float
    apart: float
    """By how much chi2 itself is higher."""

    @property
    def alike(self) -> bool:
        """Tell whether the data cannot tell the rival from the cause: it does the same, or would."""
        return min(self.worse, self.apart) < ALIKE


def rivals_of(found: Examination, number: int) -> list[Rival]:
    """Return the best other effects in place of an accepted one, each refitted along with the rest."""
    others = tuple(each for i, each in enumerate(found.applied) if i != number)
    ledger: Ledger = found.ledger
    traces = found.traces
    ledger.set_data(
        [trace.measured - trace.sample(others) for trace in traces],
        [tangents_of(trace, found.fitted, without=number) for trace in traces],
    )
    ledger.evidence()
    taken = {(each.effect.name, each.target) for each in found.applied}
    columns = [
        column.moved(ledger.given) for column in found.columns if found.blocks[column.block].key not in taken
    ]
    ranked = sorted(
        (score for score in scores(ledger, columns) if score.within),
        key=lambda score: -score.gain,
    )
    gain = refit_gain(found.target, others, found)
    best: dict[tuple[str, str | None], Rival] = {}
    spread = slope_of(found.target, found.fitted, number).inflation()
    for score in ranked:
        block = found.blocks[score.column.block]
        if block.key in best or len(best) >= _RIVALS:
            continue
        bent = not block.effect.is_linear
        if score.gain < gain - max((_BENT_SHARE if bent else _CLOSE_SHARE) * gain, _CLOSE_GAIN * spread):
            continue
        start = block.applied(score.coefficients, traces[0])
        fitted = refit(found.target, (*others, start), steps=6, scan=bent)
        if fitted.bound[-1]:
            continue
        apart = (fitted.chi2 - found.fitted.chi2) / spread
        worse = apart + fitted.occam - found.fitted.occam
        best[block.key] = Rival(fitted.applied[-1], float(worse), float(apart))
    return sorted(best.values(), key=lambda rival: rival.worse)


def refit_gain(target: Likelihood, others: tuple[Applied, ...], found: Examination) -> float:
    """Return by how much the effect lowers chi2 beside the others."""
    residual = target.residual(others)
    return float(residual @ residual) - found.fitted.chi2


def unknown_probability(share_left: float, significant: bool) -> float:
    """Return how probable it is that something outside the library is at work, from what is left."""
    if not significant:
        return 0.02
    return float(np.clip(1.0 / (1.0 + np.exp(-(share_left - UNKNOWN_SHARE) / _UNKNOWN_WIDTH)), 0.02, 0.98))


def probabilities(
    rivals: list[Rival], surprise: float, level: float, unknown: float
) -> tuple[float, list[float]]:
    """Return the probability of a cause and of each rival, given how surprising the cause is without it.

    Rivals that the data cannot tell from the cause share its probability: theirs is the same one.
    """
    weights = np.exp(-np.maximum([0.0, *(rival.worse for rival in rivals)], -30.0) / (2.0 * TEMPERATURE))
    none = 0.5 * float(np.exp(-max(surprise - level, 0.0)))
    shares = weights / weights.sum() * (1.0 - unknown) * (1.0 - none)
    alike = [0, *(i for i, rival in enumerate(rivals, start=1) if rival.alike)]
    together = float(np.sum(shares[alike]))
    return together, [
        together if rival.alike else float(shares[i]) for i, rival in enumerate(rivals, start=1)
    ]
