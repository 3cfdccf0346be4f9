"""The numbers of effects that a fit moves, and what a fit makes of them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Effect
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.gram import PRIOR
from gcode2krl.gap.fit.signatures import PHASE
from gcode2krl.units import RAD_PER_REV

FIXED = ("harmonic",)
"""Shapes that are counts: a fit keeps the value of the grid."""
_AT_BOUND = 1e-3
_NUMBER = 0.5
"""Of two effects that are one to the data the one with fewer numbers is named."""
_SLIP = 9.2
"""Twice log 100, prior odds: slips are gross, another tool's load, say; what is slight is another effect."""


@dataclass(frozen=True)
class Free:
    """The numbers of one effect that a fit moves: sizes and shapes as they are, a vector as size·direction,
    a sine as its two amplitudes."""

    effect: Effect
    target: str | None
    fixed: Mapping[str, float]
    names: tuple[str, ...]
    low: Floats
    high: Floats
    scale: Floats

    def applied(self, x: Floats) -> Applied:
        """Return the effect at the numbers (p,)."""
        values = dict(self.fixed)
        direction = self.effect.direction
        for name, number in zip(self.names, x.tolist(), strict=True):
            values[name] = number
        if direction is not None:
            size = self._size()
            vector = np.array([values[name] for name in direction])
            length = float(np.linalg.norm(vector))
            values[size] = length
            if length > 0.0:
                values |= dict(zip(direction, (vector / length).tolist(), strict=True))
        if PHASE in self.names:
            size = self._size()
            a, b = values[size], values[PHASE]
            values[size], values[PHASE] = math.hypot(a, b), math.atan2(b, a) % RAD_PER_REV
        return Applied(self.effect, self.target, values)

    def _size(self) -> str:
        return size_of(self.effect)

    def start(self, applied: Applied) -> Floats:
        """Return the numbers of an effect."""
        values = dict(applied.values)
        if self.effect.direction is not None:
            size = values[self._size()]
            values |= {name: size * values[name] for name in self.effect.direction}
        if PHASE in self.names:
            size = values[self._size()]
            values |= {
                self._size(): size * math.cos(values[PHASE]), PHASE: size * math.sin(values[PHASE])
            }  # fmt: skip
        numbers = np.array([values[name] for name in self.names], dtype=np.float64)
        clipped: Floats = np.clip(numbers, self.low, self.high)
        return clipped

    def at_bound(self, x: Floats) -> bool:
        """Tell whether a number stands at an end of its plausible range that is not a mere shape's."""
        span = self.high - self.low
        sizes = np.array([not self.effect.parameter(name).is_shape for name in self.names])
        near = (x - self.low < _AT_BOUND * span) | (self.high - x < _AT_BOUND * span)
        return bool(np.any(near & sizes & np.isfinite(span)))


def size_of(effect: Effect) -> str:
    """Return the parameter that gives the size of an effect with a direction or a phase."""
    directions = effect.direction or ()
    return next(p.name for p in effect.parameters if not p.is_shape and p.name not in directions)


def free_of(applied: Applied, trace: Trace) -> Free:
    """Return what of an effect a fit moves, from where it stands."""
    effect = applied.effect
    direction = effect.direction or ()
    names, low, high, scale = [], [], [], []
    nominal, start = (f(trace.inputs, applied.target) for f in (effect.nominal, effect.start))
    most = None
    if direction or PHASE in effect.names:
        most = effect.parameter(size_of(effect)).high
    for p in effect.parameters:
        if p.name in FIXED or (direction and p.name == size_of(effect)):
            continue
        vector = p.name in direction or (PHASE in effect.names and (p.name == PHASE or not p.is_shape))
        names.append(p.name)
        bound = most if vector and most is not None else None
        low.append(p.low if bound is None else -bound)
        high.append(p.high if bound is None else bound)
        step = abs(start[p.name] - nominal[p.name])
        if vector and most is not None:
            step = abs(start[size_of(effect)] - nominal[size_of(effect)])
        scale.append(step or 0.1 * (p.high - p.low) or 1.0)
    return Free(
        effect, applied.target, dict(applied.values), tuple(names), np.array(low), np.array(high),
        np.array(scale),
    )  # fmt: skip


@dataclass(frozen=True)
class Fitted:
    """Effects as refitted, chi2 with them, and how sure their numbers are."""

    applied: tuple[Applied, ...]
    chi2: float
    x: Floats
    covariance: Floats
    free: tuple[Free, ...]
    bound: tuple[bool, ...]
    information: Floats
    """(p, p) curvature of chi2/2, nuisance taken out, each number in units of its typical size."""

    @property
    def occam(self) -> float:
        """Return what so many numbers cost, as chi2: twice the log of how far data narrow the prior.

        Prior: normal about nominal with `PRIOR` typical sizes (Laplace's approximation, MacKay 1992). A
        number that the data do not see costs next to nothing.
        """
        grown = np.eye(len(self.information)) + PRIOR**2 * self.information
        slips = sum(_slip_cost(each, one) for each, one in zip(self.free, self.applied, strict=True))
        return float(np.linalg.slogdet(grown)[1]) + _NUMBER * len(grown) + slips

    def deviations(self, number: int) -> dict[str, float]:
        """Return the standard deviation of each number of an effect, by the curvature of chi2."""
        first = sum(len(free.names) for free in self.free[:number])
        names = self.free[number].names
        variance = np.diag(self.covariance)[first : first + len(names)]
        return dict(zip(names, np.sqrt(np.maximum(variance, 0.0)).tolist(), strict=True))


def _slip_cost(free: Free, applied: Applied) -> float:
    """Return what a set-up slip costs as chi2: slight ones are hardly any, gross ones are most gaps."""
    if free.effect.kind != "slip":
        return 0.0
    x = free.start(applied)
    gross = any(
        not (p := free.effect.parameter(name)).is_shape and abs(value - (p.nominal or 0.0)) >= scale / 2.0
        for name, value, scale in zip(free.names, x.tolist(), free.scale, strict=True)
    )
    return -_SLIP if gross else _SLIP
