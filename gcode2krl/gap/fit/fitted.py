"""The numbers θ of several effects as one vector, and what a fit makes of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.least_squares import Box
from gcode2krl.gap.fit.numbers import Free, free_of
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.fit
_RANK = 1e-10
"""Eigenvalues below this share of the largest hold rounding errors only."""


@dataclass(frozen=True, eq=False)
class Numbers:
    """The free numbers of several effects, one effect after the other."""

    free: tuple[Free, ...]

    @classmethod
    def of(cls, applied: Sequence[Applied], trace: Trace) -> "Numbers":
        """Return what of these effects a fit moves."""
        return cls(tuple(free_of(each, trace) for each in applied))

    def __len__(self) -> int:
        return sum(len(each.names) for each in self.free)

    @cached_property
    def box(self) -> Box:
        """Plausible ranges and typical sizes (p,)."""
        return Box(
            _joined([each.low for each in self.free]),
            _joined([each.high for each in self.free]),
            _joined([each.scale for each in self.free]),
        )

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Where the numbers of each effect stand."""
        ends = np.cumsum([0, *(len(each.names) for each in self.free)]).tolist()
        return tuple(slice(*each) for each in pairwise(ends))

    def without(self, effect: int | None) -> Ints:
        """Return the places of the numbers of all effects but one."""
        places = np.arange(len(self))
        return places if effect is None else np.delete(places, self.slices[effect])

    def start(self, applied: Sequence[Applied]) -> Floats:
        """Return the numbers (p,) of effects."""
        return _joined([free.start(each) for free, each in zip(self.free, applied, strict=True)])

    def applied(self, x: Floats) -> tuple[Applied, ...]:
        """Return the effects at the numbers (p,)."""
        return tuple(free.applied(x[at]) for free, at in zip(self.free, self.slices, strict=True))

    def at_bound(self, x: Floats) -> tuple[bool, ...]:
        """Tell of each effect whether a size stands at an end of its plausible range."""
        return tuple(free.at_bound(x[at]) for free, at in zip(self.free, self.slices, strict=True))


def _joined(values: Sequence[Floats]) -> Floats:
    return np.concatenate(values) if values else np.zeros(0)


@dataclass(frozen=True, eq=False)
class Fitted:
    """Effects as refitted, chi2 with them, and how sure their numbers are."""

    applied: tuple[Applied, ...]
    chi2: float
    numbers: Numbers
    x: Floats
    """(p,) the effects' numbers."""
    information: Floats
    """(p, p) of the marginal likelihood, each number in units of its typical size."""

    @cached_property
    def at_bound(self) -> tuple[bool, ...]:
        """Tell of each effect whether a size stands at an end of its range; all do that are impossible."""
        return self.numbers.at_bound(self.x) if np.isfinite(self.chi2) else (True,) * len(self.applied)

    @property
    def occam(self) -> float:
        """Return the cost of the numbers as chi2: twice the log of how far the data narrow their prior.

        Prior: normal about nominal with `prior_sizes` typical sizes (Laplace's approximation, MacKay 1992). A
        number that the data do not see costs next to nothing.
        """
        grown = np.eye(len(self.information)) + _LIMITS.prior_sizes**2 * self.information
        slips = sum(
            _slip_cost(free, each) for free, each in zip(self.numbers.free, self.applied, strict=True)
        )
        return float(np.linalg.slogdet(grown)[1]) + _LIMITS.number_cost * len(grown) + slips

    @cached_property
    def covariance(self) -> Floats:
        """(p, p) of the numbers, for independent rows; 0 for what the data do not see."""
        scale = self.numbers.box.scale
        inverse = np.asarray(np.linalg.pinv(self.information, rcond=_RANK, hermitian=True), dtype=np.float64)
        return inverse * np.outer(scale, scale)

    def deviations(self, effect: int) -> dict[str, float]:
        """Return the standard deviation of each number of an effect, for independent rows."""
        variance = np.diag(self.covariance)[self.numbers.slices[effect]]
        names = self.numbers.free[effect].names
        return dict(zip(names, np.sqrt(np.maximum(variance, 0.0)).tolist(), strict=True))


def _slip_cost(free: Free, applied: Applied) -> float:
    """Return what a set-up slip costs as chi2: slight ones are rare, gross ones are most gaps."""
    if free.effect.kind != "slip":
        return 0.0
    x = free.start(applied)
    gross = any(
        not (p := free.effect.parameter(name)).is_shape and abs(value - (p.nominal or 0.0)) >= scale / 2.0
        for name, value, scale in zip(free.names, x.tolist(), free.scale, strict=True)
    )
    return -_LIMITS.slip_odds if gross else _LIMITS.slip_odds
