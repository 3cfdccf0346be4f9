"""Other effects in place of a cause: how much worse each is, and which the data cannot tell from it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.gap.choose.examination import Examination, Key
from gcode2krl.gap.choose.probability_table import declared_nats
from gcode2krl.gap.choose.scoring import Score, scores
from gcode2krl.gap.fit.refitting import refit
from gcode2krl.gap.fit.sensitivity import sensitivity_of
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
_STEPS = 6
"""Half of a whole refit: a rival begins at its best linear fit."""


@dataclass(frozen=True)
class Rival:
    """An effect in place of a cause; differences of chi2 are over their inflation."""

    applied: Applied
    cost_difference: float
    """By how much chi2 and the cost of the numbers are higher than with the cause."""
    chi2_difference: float

    @property
    def behind_nats(self) -> float:
        """Return by how much the rival is worse, in nats; the smaller of both differences."""
        return 0.5 * min(self.cost_difference, self.chi2_difference)

    @property
    def alike(self) -> bool:
        """Tell whether the data cannot tell the rival from the cause: it belongs to the declared set."""
        return self.behind_nats < declared_nats()


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


def rival_probabilities(rivals: Sequence[Rival], own: float) -> list[float]:
    """Return the probability of each rival of a cause that has the probability ``own``.

    Rivals that the data cannot tell from the cause share its probability: theirs is the same one. Of what it
    leaves the others have their shares by evidence, over the temperature as no model is exact.
    """
    costs = np.maximum([rival.cost_difference for rival in rivals], 0.0)
    apart = np.array([not rival.alike for rival in rivals], dtype=bool)
    weights = np.where(apart, np.exp(-costs / (2.0 * _LIMITS.temperature)), 0.0)
    shares = (1.0 - own) * weights / (1.0 + weights.sum())
    return [own if rival.alike else float(share) for rival, share in zip(rivals, shares, strict=True)]
