"""Figures of the check: rates with bounds, errors of probabilities, the worst group, the smallest size."""

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

Item = TypeVar("Item")
Pairs = Sequence[tuple[float, bool]]
"""Probabilities, each with whether it was right."""
LEAST_PROBABILITY = 1e-3
"""A statement that is certain and wrong costs the log score as much as this one."""


@dataclass(frozen=True)
class Rate:
    """A fraction of cases, with its one-sided 95 % bounds (Clopper and Pearson 1934)."""

    count: int
    of: int

    @property
    def value(self) -> float:
        """Return the fraction, NaN without cases."""
        return self.count / self.of if self.of else float("nan")

    @property
    def lower(self) -> float:
        """Return the lower bound of the true rate."""
        from scipy.stats import beta

        return float(beta.ppf(0.05, self.count, self.of - self.count + 1)) if self.count else 0.0

    @property
    def upper(self) -> float:
        """Return the upper bound of the true rate."""
        from scipy.stats import beta

        return float(beta.ppf(0.95, self.count + 1, self.of - self.count)) if self.count < self.of else 1.0


def rate(flags: Iterable[bool]) -> Rate:
    """Return the fraction of true flags."""
    flags = list(flags)
    return Rate(sum(flags), len(flags))


def grouped(items: Iterable[Item], key: Callable[[Item], Hashable]) -> dict[Hashable, list[Item]]:
    """Return the items of each key, in the order of the keys' names."""
    found: dict[Hashable, list[Item]] = defaultdict(list)
    for item in items:
        found[key(item)].append(item)
    return dict(sorted(found.items(), key=lambda entry: str(entry[0])))


def worst(
    items: Iterable[Item], key: Callable[[Item], Hashable], flag: Callable[[Item], bool], high: bool
) -> tuple[Hashable, Rate] | None:
    """Return the group that is furthest from its aim, and its rate; the larger of equal ones.

    ``high``: the rate ought to be high. None without items, or where no group is off at all.
    """
    rates = {name: rate(flag(item) for item in group) for name, group in grouped(items, key).items()}
    off = {name: each for name, each in rates.items() if each.value != (1.0 if high else 0.0)}
    if not off:
        return None
    return min(off.items(), key=lambda entry: ((1.0 if high else -1.0) * entry[1].value, -entry[1].of))


def calibration_error(pairs: Pairs, bins: int = 10) -> float:
    """Return the expected calibration error (Naeini et al. 2015), bins of equal width; NaN without pairs."""
    if not pairs:
        return float("nan")
    p, right = np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs], float)
    place = np.minimum((p * bins).astype(int), bins - 1)
    return float(
        sum(
            abs(p[place == b].mean() - right[place == b].mean()) * np.mean(place == b)
            for b in np.unique(place)
        )
    )


def brier(pairs: Pairs) -> float:
    """Return the mean squared error of the probabilities (Brier 1950); NaN without pairs."""
    return float(np.mean([(p - right) ** 2 for p, right in pairs])) if pairs else float("nan")


def log_score(pairs: Pairs) -> float:
    """Return the mean of -log of the probability of what was the case (Good 1952); NaN without pairs."""
    if not pairs:
        return float("nan")
    said = np.array([p if right else 1.0 - p for p, right in pairs])
    return float(np.mean(-np.log(np.clip(said, LEAST_PROBABILITY, 1.0))))


def smallest_seen(ratios: Sequence[tuple[float, bool]], share: float = 0.9) -> float | None:
    """Return the smallest ratio from which on this share of the larger ones is right; None without."""
    ordered = sorted(ratios, key=lambda pair: -pair[0])
    found = None
    right = 0
    for count, (ratio, is_right) in enumerate(ordered, start=1):
        right += is_right
        if is_right and right >= share * count:
            found = ratio
    return found
