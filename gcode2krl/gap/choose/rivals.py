"""Other effects in place of a cause: how much worse each is, and which the data cannot tell from it."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.gap.choose.examination import Examination, Key
from gcode2krl.gap.choose.probability_table import declared_nats
from gcode2krl.gap.choose.scoring import Score, scores
from gcode2krl.gap.choose.twins import twins_of
from gcode2krl.gap.fit.refitting import refit
from gcode2krl.gap.fit.sensitivity import sensitivity_of
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
_SETTLED = 0.1
"""Of chi2: fits end where less is to be had."""
_STEPS = 6
"""Half of a whole refit: a rival begins at its best linear fit."""


@dataclass(frozen=True)
class Rival:
    """An effect in place of a cause; differences of chi2 are over their inflation."""

    applied: Applied
    cost_difference: float
    """By how much chi2 and the cost of the numbers are higher than with the cause."""
    chi2_difference: float
    distance2: float = np.inf
    """Square of the distance between both refitted signals, over the power of what the cause does."""

    @property
    def is_better(self) -> bool:
        """Tell whether the rival has more evidence than the cause."""
        return self.cost_difference < -_SETTLED

    @property
    def behind_nats(self) -> float:
        """Return by how much the rival is worse, in nats; the smaller of both differences."""
        return 0.5 * min(self.cost_difference, self.chi2_difference)

    @property
    def alike(self) -> bool:
        """Tell whether the data cannot tell the rival from the cause: it belongs to the declared set.

        Nor can they where the signals of both differ by less than models are exact to.
        """
        return self.behind_nats < declared_nats() or self.distance2 < _LIMITS.model_error**2


def rivals_of(found: Examination, number: int) -> list[Rival]:
    """Return the best other effects in place of an accepted one, each refitted along with the rest."""
    others = found.without(number)
    spread = sensitivity_of(found.likelihood, found.fitted, number).inflation()
    gain = found.likelihood.chi2(others) - found.fitted.chi2
    residual = found.likelihood.residual(found.applied)
    rivals: dict[Key, Rival] = {}
    for start in itertools.chain(_of_twins(found, number), _of_gain(found, number, gain, spread)):
        if _key(start) in rivals or len(rivals) >= _LIMITS.most_rivals:
            continue
        bent = not start.effect.is_linear
        fitted = refit(found.likelihood, (*others, start), steps=_STEPS, scan=bent)
        if fitted.at_bound[-1] or not np.isfinite(fitted.chi2):
            continue
        difference = (fitted.chi2 - found.fitted.chi2) / spread
        cost = difference + fitted.occam - found.fitted.occam
        apart = found.likelihood.residual(fitted.applied) - residual
        distance2 = float(apart @ apart) / max(gain, 1e-300)
        rivals[_key(start)] = Rival(fitted.applied[-1], float(cost), float(difference), distance2)
    return sorted(rivals.values(), key=lambda rival: rival.cost_difference)


def _key(applied: Applied) -> Key:
    return applied.effect.name, applied.target


def _of_gain(found: Examination, number: int, gain: float, spread: float) -> Iterator[Applied]:
    """Yield other effects whose linear gain comes near that of a cause."""
    for score in _ranked(found, number):
        block = found.data.candidates.block(score.column)
        share = _LIMITS.rival_share if block.effect.is_linear else _LIMITS.bent_rival_share
        if score.gain >= gain - max(share * gain, _LIMITS.rival_gain * spread):
            yield block.applied(score.coefficients, found.traces[0])


def _of_twins(found: Examination, number: int) -> Iterator[Applied]:
    """Yield other effects that do what a cause does while it is small."""
    cause = found.applied[number]
    if not cause.effect.plans_anew:
        twins = twins_of(found, cause, found.without(number), found.accepted_keys)
        yield from (twin.start for twin in twins)


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
