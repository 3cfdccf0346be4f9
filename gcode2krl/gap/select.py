"""Grouped forward selection with a max-statistic null, and what cannot be seen at all."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from gcode2krl.gap.evidence import Evidence, Ledger

Floats = NDArray[np.float64]
DRAWS = 300
"""Simulated effect-free data sets; the largest statistic of each over all blocks is the null."""
LEVEL = 0.99
"""A block must beat this share of them: one false alarm in a hundred effect-free runs at most."""
SEEN = 0.02
"""A block of whose energy less than this is left beside the nuisance is not observable (gap.md)."""


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


def surprise(gain: float, width: int, spread: float = 1.0) -> float:
    """Return -log P(chi2 with ``width`` degrees > gain/spread); large values by the asymptotic series."""
    x, half = max(gain, 0.0) / spread / 2.0, width / 2.0
    if x < 100.0:
        return float(-np.log(max(special.gammaincc(half, x), 1e-300)))
    return float(x - (half - 1.0) * np.log(x) + special.gammaln(half))


def scores(
    evidence: Evidence, columns: Sequence[Column], given: Sequence[int] = (), spread: float = 1.0
) -> list[Score]:
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
        found.append(Score(column, gain, coefficients, surprise(gain, column.width, spread), within))
    return found


def threshold(
    evidence: Evidence, columns: Sequence[Column], generator: np.random.Generator, given: Sequence[int] = ()
) -> float:
    """Return the surprise that the largest of all blocks stays below in 99 % of effect-free data sets.

    Effect-free data have Sᵀy ~ Normal(0, SᵀS) under the whitened inner product, however many rows there are.
    """
    gram = evidence.gram[1:, 1:]
    values, vectors = np.linalg.eigh(gram)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = root @ generator.standard_normal((len(gram), DRAWS))
    given_ = np.asarray(given, dtype=int)
    worst = np.zeros(DRAWS)
    for column in columns:
        if column.width == 0:
            continue
        index = column.index
        a, b = gram[np.ix_(index, index)], draws[index]
        if len(given_):
            half = np.linalg.lstsq(
                gram[np.ix_(given_, given_)],
                np.hstack([gram[np.ix_(given_, index)], draws[given_]]),
                rcond=1e-9,
            )[0]
            cross = gram[np.ix_(index, given_)]
            a, b = a - cross @ half[:, : column.width], b - cross @ half[:, column.width :]
        power = np.maximum(np.linalg.eigvalsh(a), 0.0)
        if power[-1] <= 0.0:
            continue
        gains = np.sum(b * (np.linalg.pinv(a, rcond=1e-9, hermitian=True) @ b), axis=0)
        worst = np.maximum(worst, [surprise(float(gain), column.width) for gain in gains])
    return float(np.quantile(worst, LEVEL))


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
