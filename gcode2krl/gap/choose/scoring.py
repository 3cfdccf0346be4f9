"""How surprising the gain of a candidate is, and whether its size is plausible."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from gcode2krl.arrays import Floats
from gcode2krl.gap.fit.design import Column
from gcode2krl.gap.fit.gram import Gram
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
_ASYMPTOTIC = 100.0
"""From this chi2/2 on the first term of the asymptotic series is taken: off by (width - 2)/gain at most."""


@dataclass(frozen=True, eq=False)
class Score:
    """One candidate's statistic."""

    column: Column
    gain: float
    """Fall of chi2: the likelihood ratio."""
    coefficients: Floats
    surprise: float
    """-log of the probability of that gain without the effect."""
    within: bool
    """The coefficients are plausible: a negative backlash is not."""


def surprise(gain: float, width: int) -> float:
    """Return -log P(chi2 with ``width`` degrees > gain); large values by the asymptotic series."""
    x, half = max(gain, 0.0) / 2.0, width / 2.0
    if x < _ASYMPTOTIC:
        return float(-np.log(max(special.gammaincc(half, x), 1e-300)))
    return float(x - (half - 1.0) * np.log(x) + special.gammaln(half))


def scores(gram: Gram, columns: Sequence[Column]) -> list[Score]:
    """Return the statistic of every candidate beside the accepted effects."""
    return [_score(gram, column) for column in columns if column.width]


def _score(gram: Gram, column: Column) -> Score:
    gain, coefficients = gram.gain(column.index)
    plausible = np.clip(coefficients, column.low, column.high)
    if column.bent and column.width > 1:  # those of several that say nothing begin at nominal
        within = True
        plausible = np.where(plausible == coefficients, coefficients, 0.0)
    else:
        within = _within(column, coefficients)
    return Score(column, gain, plausible, surprise(gain, column.width), within)


def _within(column: Column, coefficients: Floats) -> bool:
    """Tell whether coefficients (c,) are in their range, or little beyond: they are a first order."""
    if column.width == 1 and column.low[0] == 0.0 and coefficients[0] < 0.0:
        return False
    share = _LIMITS.bent_reach if column.bent else _LIMITS.reach
    reach = 1e-9 + share * np.abs(column.high - column.low)
    return bool(np.all((coefficients >= column.low - reach) & (coefficients <= column.high + reach)))


def tried(columns: Sequence[Column]) -> float:
    """Return how many candidates were looked at to get these."""
    return sum(column.tried for column in columns)


def threshold(candidates: float) -> float:
    """Return the surprise that the largest of so many stays below, but for one effect-free data set in a
    thousand (Bonferroni; conservative, as candidates are alike)."""
    return float(np.log(max(candidates, 1.0) / _LIMITS.false_alarms))
