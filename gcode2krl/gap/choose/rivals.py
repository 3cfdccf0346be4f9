"""How probable each cause is: against no effect, its rivals, and something that the library does not have."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.gap.choose.examination import Examination, Key
from gcode2krl.gap.choose.scoring import Score, scores
from gcode2krl.gap.fit.refitting import refit
from gcode2krl.gap.fit.sensitivity import sensitivity_of
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
_STEPS = 6
"""Half of a whole refit: a rival begins at its best linear fit."""
_MOST_WORSE = -30.0
"""A rival that is better than its cause by more than this has all the weight anyway."""


@dataclass(frozen=True)
class Rival:
    """An effect in place of a cause; differences of chi2 are over their inflation."""

    applied: Applied
    cost_difference: float
    """By how much chi2 and the cost of the numbers are higher than with the cause."""
    chi2_difference: float

    @property
    def alike(self) -> bool:
        """Tell whether the data cannot tell the rival from the cause, by chi2 or with the numbers' cost."""
        return min(self.cost_difference, self.chi2_difference) < _LIMITS.alike_chi2


def rivals_of(found: Examination, number: int) -> list[Rival]:
    """Return the best other effects in place of an accepted one, each refitted along with the rest."""
    others = found.without(number)
    spread = sensitivity_of(found.likelihood, found.fitted, number).inflation()
    gain = found.likelihood.chi2(others) - found.fitted.chi2
    rivals: dict[Key, Rival] = {}
    for score in _ranked(found, number):
        block = found.data.candidates.block(score.column)
        if block.key in rivals or len(rivals) >= _LIMITS.most_rivals:
            continue
        bent = not block.effect.is_linear
        share = _LIMITS.bent_rival_share if bent else _LIMITS.rival_share
        if score.gain < gain - max(share * gain, _LIMITS.rival_gain * spread):
            continue
        start = block.applied(score.coefficients, found.traces[0])
        fitted = refit(found.likelihood, (*others, start), steps=_STEPS, scan=bent)
        if fitted.at_bound[-1]:
            continue
        difference = (fitted.chi2 - found.fitted.chi2) / spread
        cost = difference + fitted.occam - found.fitted.occam
        rivals[block.key] = Rival(fitted.applied[-1], float(cost), float(difference))
    return sorted(rivals.values(), key=lambda rival: rival.cost_difference)


def _ranked(found: Examination, number: int) -> list[Score]:
    """Return the plausible scores of other effects with one accepted effect taken away, the best first."""
    gram = found.data.gram(found.fitted, without=number)
    candidates = found.data.candidates
    columns = [
        column for column in candidates.columns if candidates.block(column).key not in found.accepted_keys
    ]
    return sorted((score for score in scores(gram, columns) if score.within), key=lambda score: -score.gain)


def unknown_probability(share_left: float, significant: bool) -> float:
    """Return how probable it is that something outside the library is at work, from what is left."""
    least = _LIMITS.least_unknown
    if not significant:
        return least
    beyond = (share_left - _LIMITS.unknown_share) / _LIMITS.unknown_width
    return float(np.clip(1.0 / (1.0 + np.exp(-beyond)), least, 1.0 - least))


def probabilities(
    rivals: Sequence[Rival], surprise: float, level: float, unknown: float
) -> tuple[float, list[float]]:
    """Return the probability of a cause and of each rival, given how surprising the cause is without it.

    Rivals that the data cannot tell from the cause share its probability: theirs is the same one.
    """
    costs = np.maximum([0.0, *(rival.cost_difference for rival in rivals)], _MOST_WORSE)
    weights = np.exp(-costs / (2.0 * _LIMITS.temperature))
    none = 0.5 * float(np.exp(-max(surprise - level, 0.0)))
    shares = weights / weights.sum() * (1.0 - unknown) * (1.0 - none)
    alike = [0, *(i for i, rival in enumerate(rivals, start=1) if rival.alike)]
    together = float(np.sum(shares[alike]))
    return together, [
        together if rival.alike else float(share) for rival, share in zip(rivals, shares[1:], strict=True)
    ]
