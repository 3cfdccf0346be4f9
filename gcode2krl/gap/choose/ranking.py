"""Which candidates are refitted: surprising, plausible, and close to the best by their linear gain."""

from collections.abc import Sequence

import numpy as np

from gcode2krl.gap.choose.examination import Examination, Key
from gcode2krl.gap.choose.scoring import Score, scores, surprise
from gcode2krl.gap.fit.design import Column
from gcode2krl.gap.fit.gram import Gram
from gcode2krl.gap.fit.signatures import Block
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose


def ranked(found: Examination, gram: Gram, allowed: Sequence[Column]) -> list[Score]:
    """Return the plausible and surprising scores, the best first."""
    plain = [score for score in scores(gram, allowed) if _is_finding(found, score)]
    plain.sort(key=lambda score: -_worth(score, gram.values))
    return [
        score
        for score in plain[: _LIMITS.most_tried]
        if surprise(score.gain / _inflation(found, gram, score), score.column.width) > found.level
    ]


def _is_finding(found: Examination, score: Score) -> bool:
    plausible = score.within or found.data.candidates.block(score.column).effect.plans_anew
    large = score.gain > _LIMITS.least_ratio**2 * found.data.times
    return plausible and large and score.surprise > found.level


def _inflation(found: Examination, gram: Gram, score: Score) -> float:
    # a signature holds for small effects only, and one at a frequency or moment that is searched is as far
    # off as the search is coarse, where the effect is strongest: such gains are judged after the refit
    effect = found.data.candidates.block(score.column).effect
    is_exact = effect.is_linear and effect.frequency is None and effect.moment is None
    small = score.gain < found.data.times and is_exact
    return gram.inflation(score.column.index) if small else 1.0


def _worth(score: Score, values: int) -> float:
    """Return the gain minus the BIC penalty, width·log(values) (Schwarz 1978)."""
    return score.gain - score.column.width * float(np.log(values))


def shortlist(found: Examination, scores: Sequence[Score], values: int) -> list[Score]:
    """Return the best score of each of the best few effects that come close to the best one.

    Signatures hold for small effects only, so the best linear gain does not decide alone; and that of an
    effect that plans anew tells little, so all of those follow.
    """
    best = _worth(scores[0], values)
    least = best - max(_LIMITS.close_share * abs(best), _LIMITS.close_gain)
    linear: dict[Key, Score] = {}
    planned: dict[Key, Score] = {}
    for score in scores:
        block = found.data.candidates.block(score.column)
        if block.effect.plans_anew:
            planned.setdefault(block.key, score)
        elif _worth(score, values) >= least or _is_bent_rival(block, score, scores[0]):
            linear.setdefault(block.key, score)
    return [*list(linear.values())[: _LIMITS.shortlist], *planned.values()]


def _is_bent_rival(block: Block, score: Score, best: Score) -> bool:
    """Tell whether a candidate that is not proportional to its size may still be the best when refitted."""
    return not block.effect.is_linear and score.gain > _LIMITS.bent_share * best.gain
