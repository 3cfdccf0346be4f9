"""Non-linear least squares in a box: derivatives by differences, Gauss-Newton; the numbers that it moves.

A residual r(x) comes from a simulation, which costs more than all algebra here and may be impossible at some
x (`Gcode2KrlError`). `scipy.optimize.least_squares` (trf, the same scales and differences) ends at the same
chi2 to a thousandth, but with up to 2.5 times as many simulations (friction 18 against 17, lag 12 against 7,
transmission 18 against 7), and needs a residual everywhere. Functions that are flat in places and so have no
useful slope are searched directly.
"""

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects import Applied, Effect, Parameter, Role
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.compare.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import RAD_PER_REV

Function = Callable[[Floats], Floats]
"""x (p,) -> r (n,); raises Gcode2KrlError where x cannot be simulated."""

_DAMPINGS = 4
"""Steps of one linearisation that are tried, each ten times more damped."""
_FIRST_DAMPING, _LEAST_DAMPING = 1e-3, 1e-6
_SHARES = (1.0, 0.5, 0.2)
_RANK = 1e-6
"""Singular values below this share of the largest are treated as zero."""


@dataclass(frozen=True, eq=False)
class Box:
    """Plausible ranges of numbers and their typical sizes, each (p,)."""

    low: Floats
    high: Floats
    scale: Floats

    def clipped(self, x: Floats) -> Floats:
        """Return x within the box."""
        return np.clip(x, self.low, self.high)

    def steps(self, x: Floats, share: float) -> Floats:
        """Return steps (p,) of a share of the typical sizes, downwards where upwards leaves the box."""
        step = share * self.scale
        return np.where(x + step > self.high, -step, step)


def attempted(function: Function, x: Floats) -> Floats | None:
    """Return r(x), or None where x cannot be simulated."""
    try:
        return function(x)
    except Gcode2KrlError:
        return None


def derivative(
    function: Function, x: Floats, r: Floats, steps: Floats, numbers: Ints | None = None
) -> Floats:
    """Return the derivative (n, p) of a function at x, where it is r, by one-sided differences.

    ``numbers``: which of x (default: all). A column is zero where neither side can be simulated.
    """
    wanted = range(len(x)) if numbers is None else numbers.tolist()
    columns = np.zeros((len(r), len(wanted)), order="F")
    for column, i in enumerate(wanted):
        for step in (steps[i], -steps[i]):
            moved = x.copy()
            moved[i] += step
            there = attempted(function, moved)
            if there is not None:
                columns[:, column] = (there - r) / step
                break
    return np.ascontiguousarray(columns)


class Damped:
    """Damped steps (Marquardt 1963), numbers at a bound left there where they would go beyond."""

    def __init__(self, box: Box) -> None:
        self.box, self.damping = box, _FIRST_DAMPING

    def trials(self, jacobian: Floats, r: Floats, x: Floats) -> Iterator[Floats]:
        """Yield points to try, the boldest first, each further damped."""
        for _ in range(_DAMPINGS):
            yield self.box.clipped(x + self._step(jacobian, r, x))
            self.damping *= 10.0

    def accept(self) -> None:
        """Damp the next step less."""
        self.damping = max(self.damping / 10.0, _LEAST_DAMPING)

    def _step(self, jacobian: Floats, r: Floats, x: Floats) -> Floats:
        low, high, scale = self.box.low, self.box.high, self.box.scale
        scaled = jacobian * scale
        free = np.ones(len(x), dtype=bool)
        step = np.zeros(len(x))
        for _ in range(3):
            a = scaled[:, free]
            normal = a.T @ a
            normal += self.damping * np.diag(np.diag(normal)) + 1e-12 * np.eye(len(normal))
            step[:] = 0.0
            step[free] = -np.linalg.solve(normal, a.T @ r) * scale[free]
            beyond = free & (((x <= low) & (step < 0.0)) | ((x >= high) & (step > 0.0)))
            if not beyond.any():
                break
            free &= ~beyond
        return step


class Shortened:
    """The whole step, then shares of it."""

    def __init__(self, box: Box) -> None:
        self.box = box

    def trials(self, jacobian: Floats, r: Floats, x: Floats) -> Iterator[Floats]:
        """Yield points on the way to the best fit of the linearisation."""
        scale = self.box.scale
        step = -np.linalg.lstsq(jacobian * scale, r, rcond=_RANK)[0] * scale
        yield from (self.box.clipped(x + share * step) for share in _SHARES)

    def accept(self) -> None:
        """Change nothing: each linearisation begins with its whole step."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where a fit ended: x (p,), r (n,), and the last linearisation (n, p)."""

    x: Floats
    r: Floats
    jacobian: Floats

    @property
    def chi2(self) -> float:
        """Return the squared length of the residual."""
        return float(self.r @ self.r)


def gauss_newton(
    function: Function,
    x: Floats,
    box: Box,
    control: Damped | Shortened,
    settled: Callable[[float, float], bool],
    *,
    most_steps: int,
    step_share: float,
) -> Minimum:
    """Return the least |r(x)|² near x.

    ``settled`` is asked with chi2 before and after a step; differences are over ``step_share`` of the typical
    sizes. Raises Gcode2KrlError where the start cannot be simulated.
    """
    r = function(x)
    jacobian = np.zeros((len(r), len(x)))
    for _ in range(most_steps if len(x) else 0):
        jacobian = derivative(function, x, r, box.steps(x, step_share))
        chi2 = float(r @ r)
        better = _first_better(function, control.trials(jacobian, r, x), chi2)
        if better is None:
            break
        control.accept()
        x, r = better
        if settled(chi2, float(r @ r)):
            break
    return Minimum(x, r, jacobian)


def _first_better(function: Function, trials: Iterator[Floats], chi2: float) -> tuple[Floats, Floats] | None:
    """Return the first point, and its residual, that lowers chi2; None where none does."""
    for x in trials:
        r = attempted(function, x)
        if r is not None and float(r @ r) < chi2:
            return x, r
    return None


_ROUNDS = 30
_FINEST = 0.005
"""In typical sizes: far below the share that the models of such effects are off by, `law_error`."""


def pattern_search(chi2: Callable[[Floats], float], x: Floats, box: Box, first_step: float) -> Floats:
    """Return the x (p,) of the least chi2 nearby (Hooke & Jeeves 1961), from steps in typical sizes."""
    best, steps = chi2(x), first_step * box.scale
    for _ in range(_ROUNDS):
        reached, reached_chi2 = _explored(chi2, x, best, box, steps)
        if reached_chi2 < best:
            # on along the way that lowered it: numbers of a time law compensate each other
            ahead = box.clipped(2.0 * reached - x)
            x, best = reached, reached_chi2
            ahead_chi2 = chi2(ahead)
            if ahead_chi2 < best:
                x, best = ahead, ahead_chi2
            continue
        steps = steps / 2.0
        if np.all(steps < _FINEST * box.scale):
            break
    return x


def _explored(
    chi2: Callable[[Floats], float], x: Floats, best: float, box: Box, steps: Floats
) -> tuple[Floats, float]:
    """Return the point, and its chi2, after a step of each number to the first side that lowers chi2."""
    for i in range(len(x)):
        for step in (steps[i], -steps[i]):
            trial = x.copy()
            trial[i] = np.clip(x[i] + step, box.low[i], box.high[i])
            value = chi2(trial)
            if value < best:
                x, best = trial, value
                break
    return x, best


_LIMITS = THRESHOLDS.posterior
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
        return np.clip(numbers, self.low, self.high)

    def at_bound(self, x: Floats) -> bool:
        """Tell whether a size stands at an end of its plausible range."""
        sizes = np.array([not self.effect.parameter(name).is_shape for name in self.names])
        return bool(np.any(self._near(x) & sizes))

    def _near(self, x: Floats) -> Bools:
        """Tell which numbers (p,) stand at an end of their range; where all of it is positive, by ratios.

        Of a time constant of 0.5 to 3600 s, 2 s are not at its end.
        """
        is_ratio = self.low > 0.0
        ends = (x, self.low, self.high)
        x, low, high = (np.where(is_ratio, np.log(np.where(is_ratio, v, 1.0)), v) for v in ends)
        span = high - low
        near: Bools = (x - low < _AT_BOUND * span) | (high - x < _AT_BOUND * span)
        near &= np.isfinite(span)
        return near

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


_LEAST_INFORMATION = 1e-10
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

    def without(self, effects: Collection[int]) -> Ints:
        """Return the places of the numbers of all effects but some."""
        places = np.arange(len(self))
        kept = [places[at] for effect, at in enumerate(self.slices) if effect not in effects]
        return np.concatenate([places[:0], *kept])

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
            _slip_cost(free, applied) for free, applied in zip(self.numbers.free, self.applied, strict=True)
        )
        return float(np.linalg.slogdet(grown)[1]) + _LIMITS.number_cost * len(grown) + slips

    @cached_property
    def covariance(self) -> Floats:
        """(p, p) of the numbers, for independent rows; 0 for what the data do not see."""
        scale = self.numbers.box.scale
        inverse = np.asarray(
            np.linalg.pinv(self.information, rcond=_LEAST_INFORMATION, hermitian=True), dtype=np.float64
        )
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
