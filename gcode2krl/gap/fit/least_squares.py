"""Non-linear least squares in a box: one derivative by differences, one Gauss-Newton.

A residual r(x) comes from a simulation, which costs more than all algebra here and may be impossible at
some x (`Gcode2KrlError`). `scipy.optimize.least_squares` (trf, the same scales and differences) ends at the
same chi2 to a thousandth, but with up to 2.5 times as many simulations (friction 18 against 17, lag 12
against 7, transmission 18 against 7), and needs a residual everywhere.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.errors import Gcode2KrlError

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


class StepControl(Protocol):
    """Which steps a linearisation offers."""

    def trials(self, jacobian: Floats, r: Floats, x: Floats) -> Iterator[Floats]:
        """Yield points to try, the boldest first; one that does not lower chi2 is followed by the next."""

    def accept(self) -> None:
        """Take notice that the last point was accepted."""


class Damped:
    """Damped steps (Marquardt 1963), numbers at a bound left there where they would go beyond."""

    def __init__(self, box: Box) -> None:
        self.box, self.damping = box, _FIRST_DAMPING

    def trials(self, jacobian: Floats, r: Floats, x: Floats) -> Iterator[Floats]:
        """Yield points, each further damped."""
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
    control: StepControl,
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
