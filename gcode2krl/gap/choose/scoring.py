"""Grouped forward selection: how surprising a block of signatures is."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from gcode2krl.arrays import Floats, Ints
from gcode2krl.gap.fit.gram import Ledger

FALSE_ALARMS = 1e-3
"""Of each link; five links together stay below the one in a hundred runs of design/gap.md."""
LEAST_RATIO = 0.08
"""An effect whose trace, nuisance taken out, is below this share of the noise is not reported: models of
sound machines differ by so much."""

_REACH, _BENT_REACH = 0.02, 1.0
"""Of their range, by how much coefficients may be beyond it: they are the first order of an effect."""


@dataclass(frozen=True)
class Column:
    """Where a block's columns stand among the signatures, and the range of its coefficients."""

    block: int
    first: int
    width: int
    low: Floats
    high: Floats
    bent: bool = False
    """The signals are not proportional to the size: coefficients tell little of it."""

    @property
    def index(self) -> Ints:
        """Return the numbers of its columns."""
        return np.arange(self.first, self.first + self.width)

    def moved(self, by: int) -> "Column":
        """Return the column behind ``by`` more."""
        return replace(self, first=self.first + by)


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


def scores(ledger: Ledger, columns: Sequence[Column]) -> list[Score]:
    """Return the statistic of every block beside what is given in the ledger's last evidence."""
    found = []
    for column in columns:
        if column.width == 0:
            continue
        gain, coefficients = ledger.bounded_gain(column.index)
        span = np.abs(column.high - column.low)
        reach = 1e-9 + (_BENT_REACH if column.bent else _REACH) * span
        within = bool(np.all((coefficients >= column.low - reach) & (coefficients <= column.high + reach)))
        if column.width == 1 and column.low[0] == 0.0 and coefficients[0] < 0.0:
            within = False
        plausible = np.clip(coefficients, column.low, column.high)
        if column.bent and column.width > 1:  # of several, those that say nothing begin at nominal
            within = True
            plausible = np.where(plausible == coefficients, coefficients, 0.0)
        found.append(Score(column, gain, plausible, surprise(gain, column.width), within))
    return found


def threshold(blocks: int) -> float:
    """Return the surprise that the largest of so many blocks stays below in all but one in a thousand
    effect-free data sets (Bonferroni; conservative, as blocks are alike)."""
    return float(np.log(max(blocks, 1) / FALSE_ALARMS))
