"""Grouped forward selection: how surprising a block of signatures is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from gcode2krl.gap.evidence import Evidence, Ledger

Floats = NDArray[np.float64]
FALSE_ALARMS = 1e-3
"""Of each link; five links together stay below the one in a hundred runs of design/gap.md."""
LEAST_RATIO = 0.08
"""An effect whose trace, nuisance taken out, is below this share of the noise is not reported: models of
sound machines differ by so much."""


@dataclass(frozen=True)
class Column:
    """Where a block's columns stand among the signatures, and the range of its coefficients."""

    block: int
    first: int
    width: int
    low: Floats
    high: Floats

    @property
    def index(self) -> NDArray[np.int64]:
        """Return the numbers of its columns."""
        return np.arange(self.first, self.first + self.width)

    def moved(self, by: int) -> "Column":
        """Return the column behind ``by`` more."""
        return Column(self.block, self.first + by, self.width, self.low, self.high)


@dataclass(frozen=True)
class Score:
    """One block's statistic."""

    column: Column
    gain: float
    """Fall of chi2."""
    coefficients: Floats
    surprise: float
    """-log of the probability of that gain without the effect."""
    within: bool
    """The coefficients are plausible: a negative backlash is not."""


def surprise(gain: float, width: int) -> float:
    """Return -log P(chi2 with ``width`` degrees > gain); large values by the asymptotic series."""
    x, half = max(gain, 0.0) / 2.0, width / 2.0
    if x < 100.0:
        return float(-np.log(max(special.gammaincc(half, x), 1e-300)))
    return float(x - (half - 1.0) * np.log(x) + special.gammaln(half))


def scores(evidence: Evidence, columns: Sequence[Column], given: Sequence[int] = ()) -> list[Score]:
    """Return the statistic of every block besides the given signature columns."""
    found = []
    for column in columns:
        if column.width == 0:
            continue
        gain, coefficients = evidence.gain(column.index, given)
        reach = 1e-9 + 0.02 * np.abs(column.high - column.low)
        within = bool(np.all((coefficients >= column.low - reach) & (coefficients <= column.high + reach)))
        if column.width == 1 and column.low[0] == 0.0 and coefficients[0] < 0.0:
            within = False
        found.append(Score(column, gain, coefficients, surprise(gain, column.width), within))
    return found


def threshold(blocks: int) -> float:
    """Return the surprise that the largest of so many blocks stays below in all but one in a thousand
    effect-free data sets (Bonferroni; conservative, as blocks are alike)."""
    return float(np.log(max(blocks, 1) / FALSE_ALARMS))


def left_out_gain(ledger: Ledger, folds: Sequence[Sequence[tuple[int, int]]], column: Column,
                  given: Sequence[int] = ()) -> float:  # fmt: skip
    """Return the fall of chi2 on stretches that the coefficients were not fitted to, over all folds."""
    everything = ledger.stretches()
    total = 0.0
    for fold in folds:
        held = set(fold)
        chosen = [each for each in everything if each not in held]
        if not chosen or not held:
            continue
        fitted = ledger.evidence(chosen)
        index = np.concatenate([np.asarray(given, dtype=int), column.index])
        _, both = fitted.gain(index)
        _, alone = fitted.gain(np.asarray(given, dtype=int)) if len(given) else (0.0, np.zeros(0))
        test = ledger.evidence(list(held)).gram
        total += _fall(test, index, both) - _fall(test, np.asarray(given, dtype=int), alone)
    return total


def _fall(gram: Floats, index: NDArray[np.int64], coefficients: Floats) -> float:
    if len(index) == 0:
        return 0.0
    at = index + 1
    return float(2.0 * coefficients @ gram[at, 0] - coefficients @ gram[np.ix_(at, at)] @ coefficients)
