"""The numbers of an effect that a fit moves."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied, Effect, Parameter, Role
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import RAD_PER_REV

_LIMITS = THRESHOLDS.fit
_AT_BOUND = 1e-3
_MOMENT_S = 2.0
"""Typical size of a moment: differences of a fiftieth of it are those of a short slip."""
NORMAL_90 = 1.645
"""Half-width of a 90 % interval in standard deviations."""


@dataclass(frozen=True)
class Free:
    """The numbers of one effect that a fit moves.

    Sizes and shapes as they are, a direction times its size, a sine as its two amplitudes.
    """

    effect: Effect
    target: str | None
    fixed: Mapping[str, float]
    names: tuple[str, ...]
    low: Floats
    high: Floats
    scale: Floats
    held: frozenset[str] = frozenset()
    """Numbers that stay as they are, as the data do not show them."""

    def applied(self, x: Floats) -> Applied:
        """Return the effect at the numbers (p,)."""
        values = dict(self.fixed) | dict(zip(self.names, x.tolist(), strict=True))
        effect, size = self.effect, size_of(self.effect)
        if effect.direction is not None:
            vector = np.array([values[name] for name in effect.direction])
            length = float(np.linalg.norm(vector))
            values[size] = length
            if length > 0.0:
                values |= dict(zip(effect.direction, (vector / length).tolist(), strict=True))
        if effect.phase is not None:
            sine, cosine = values[size], values[effect.phase.name]
            values[size] = math.hypot(sine, cosine)
            values[effect.phase.name] = math.atan2(cosine, sine) % RAD_PER_REV
        return Applied(effect, self.target, values, held=self.held)

    def start(self, applied: Applied) -> Floats:
        """Return the numbers of an effect."""
        values = dict(applied.values)
        effect, size = self.effect, size_of(self.effect)
        if effect.direction is not None:
            values |= {name: values[size] * values[name] for name in effect.direction}
        if effect.phase is not None:
            amplitude, angle = values[size], values[effect.phase.name]
            values[size] = amplitude * math.cos(angle)
            values[effect.phase.name] = amplitude * math.sin(angle)
        numbers = np.array([values[name] for name in self.names], dtype=np.float64)
        clipped: Floats = np.clip(numbers, self.low, self.high)
        return clipped

    def at_bound(self, x: Floats) -> bool:
        """Tell whether a size stands at an end of its plausible range."""
        sizes = np.array([not self.effect.parameter(name).is_shape for name in self.names])
        return bool(np.any(self._near(x) & sizes))

    def _near(self, x: Floats) -> Bools:
        """Tell which numbers (p,) stand at an end of their range."""
        span = self.high - self.low
        near: Bools = (x - self.low < _AT_BOUND * span) | (self.high - x < _AT_BOUND * span)
        return near & np.isfinite(span)

    def shapes_at_end(self, x: Floats) -> frozenset[str]:
        """Return the shapes that stand at an end of their range."""
        return frozenset(np.array(self.names, dtype=object)[self._near(x) & self._shapes])

    def shapes_spanned(self, deviation: Mapping[str, float]) -> frozenset[str]:
        """Return the shapes whose 90 % interval, from their standard deviations, spans nearly their range."""
        width = np.array([2.0 * NORMAL_90 * deviation[name] for name in self.names])
        wide = width > _LIMITS.shape_span * (self.high - self.low)
        return frozenset(np.array(self.names, dtype=object)[wide & self._shapes])

    @property
    def _shapes(self) -> Bools:
        """Which numbers (p,) are shapes with a range of their own."""
        roles = (self.effect.parameter(name).role for name in self.names)
        return np.array([role in (Role.SHAPE, Role.FREQUENCY) for role in roles], dtype=np.bool_)


def size_of(effect: Effect) -> str:
    """Return the name of the first size: the only one of an effect with a direction or a phase."""
    return next((p.name for p in effect.sizes), "")


def free_of(applied: Applied, trace: Trace) -> Free:
    """Return the numbers of an effect that a fit moves; the other values stay as they are."""
    effect, target = applied.effect, applied.target
    nominal, start = effect.nominal(trace.inputs, target), effect.start(trace.inputs, target)
    size, vector = size_of(effect), _vector(effect)
    length = size if effect.direction is not None else ""
    names, low, high, scale = [], [], [], []
    for p in effect.parameters:
        if p.role is Role.COUNT or p.name == length or p.name in applied.held:
            continue
        of = effect.parameter(size) if p.name in vector else p
        names.append(p.name)
        low.append(-of.high if p.name in vector else p.low)
        high.append(of.high)
        scale.append(_typical(p, abs(start[of.name] - nominal[of.name])))
    return Free(
        effect,
        target,
        dict(applied.values),
        tuple(names),
        np.array(low),
        np.array(high),
        np.array(scale),
        applied.held,
    )


def _typical(p: Parameter, size: float) -> float:
    """Return by how much a number typically is off, given how much its size is."""
    if p.role is Role.MOMENT:
        return _MOMENT_S
    return size or 0.1 * (p.high - p.low) or 1.0


def _vector(effect: Effect) -> tuple[str, ...]:
    """Return the parameters that a fit moves as components of a vector as long as the size."""
    if effect.direction is not None:
        return effect.direction
    return () if effect.phase is None else (size_of(effect), effect.phase.name)
