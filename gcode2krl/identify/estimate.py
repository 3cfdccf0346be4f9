"""A fitted value with its interval, and Student's quantile for it."""

import math
from dataclasses import dataclass

LEVEL = 0.90
"""Default probability of the intervals."""
QUANTILE_90 = 1.6448536269514722
"""Of the normal distribution: 90 % lie within so many standard deviations."""


@dataclass(frozen=True)
class Estimate:
    """A fitted value and its interval."""

    value: float
    low: float
    high: float

    def contains(self, value: float) -> bool:
        """Tell whether a value lies within the interval."""
        return self.low <= value <= self.high


def around(value: float, half: float) -> Estimate:
    """Return the estimate whose interval reaches ``half`` to both sides."""
    return Estimate(float(value), float(value - half), float(value + half))


def inverse(value: float, half: float) -> Estimate:
    """Return the estimate of 1/x for a positive x = ``value`` ± ``half``; no upper end where 0 is within."""
    high = 1.0 / (value - half) if value > half else math.inf
    return Estimate(1.0 / value, 1.0 / (value + half), high)


def student(level: float, freedom: int) -> float:
    """Return the two-sided quantile of Student's t; infinite where no degree of freedom is left."""
    if freedom < 1:
        return math.inf
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * level))


def chance_above(chi_squared: float, freedom: int) -> float:
    """Return the probability that chi-squared with ``freedom`` degrees of freedom is larger."""
    from scipy.special import chdtrc

    return float(chdtrc(freedom, chi_squared)) if freedom > 0 else 1.0
