"""How the residual of a fit changes with its numbers, and what that says of how sure they are."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.fit.gram import stretches_of_all
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.numbers import Fitted


@dataclass(frozen=True)
class Slope:
    """The marginal residual (r,) at a fit, and how it changes (r, p) with the numbers of one of its effects.

    Those of the other effects are taken out; numbers are in units of their typical size.
    """

    residual: Floats
    mine: Floats
    clusters: Ints
    """(rows of data,) the stretch of time of each."""

    @property
    def rows(self) -> int:
        """Return the number of data; the residual's end is nuisance."""
        return len(self.clusters)

    def inflation(self) -> float:
        """Return by how much the gain of the effect varies more than white noise lets it, at least 1.

        From the scores of each stretch of time at the best fit (White 1980, by clusters): what a model is off
        by here and there, of either sign, makes the noise of a gain larger than the noise of a sample says.
        """
        names, at = np.unique(self.clusters, return_inverse=True)
        width = self.mine.shape[1]
        sums = np.zeros((len(names), width))
        np.add.at(sums, at, self.mine[: self.rows] * self.residual[: self.rows, None])
        info = np.linalg.pinv(self.mine.T @ self.mine, rcond=1e-9, hermitian=True)
        grown = float(np.trace(info @ (sums.T @ sums))) / width
        return float(max(1.0, grown * len(names) / max(len(names) - width, 1)))

    def left_out_gain(self, before: Floats, groups: int) -> float:
        """Return the fall of chi2 from the residual ``before`` (r,) on data that numbers were not fitted to.

        Stretches in their order make groups in which the effect does as much: a run in air tells nothing of a
        force. Each is left out in turn; the numbers then are a step away from those of the fit. Infinite
        where there are fewer stretches than groups.
        """
        names, at = np.unique(self.clusters, return_inverse=True)
        change = before[: self.rows] - self.residual[: self.rows]
        power = np.cumsum(np.bincount(at, weights=change**2))
        if len(names) < groups or power[-1] <= 0.0:
            return math.inf
        group = np.minimum((groups * (power - power[0] / 2.0) / power[-1]).astype(int), groups - 1)[at]
        total = 0.0
        mine, rest = self.mine[: self.rows], self.residual[: self.rows]
        for held in (group == number for number in range(groups)):
            step = np.linalg.lstsq(mine[~held], -rest[~held], rcond=1e-9)[0]
            left = rest[held] + mine[held] @ step
            total += float(before[: self.rows][held] @ before[: self.rows][held] - left @ left)
        return total


def slope_of(target: Likelihood, fitted: Fitted, number: int) -> Slope:
    """Return the residual of a fit and how it changes with one of its effects."""
    residual, jacobian = residual_jacobian(target, fitted)
    first = sum(len(free.names) for free in fitted.free[:number])
    wide = jacobian * np.concatenate([free.scale for free in fitted.free])
    mine = wide[:, first : first + len(fitted.free[number].names)]
    others = np.delete(wide, np.s_[first : first + mine.shape[1]], axis=1)
    if others.shape[1]:
        mine = mine - others @ np.linalg.lstsq(others, mine, rcond=1e-9)[0]
    return Slope(residual, mine, stretches_of_all(target.traces))


def residual_jacobian(target: Likelihood, fitted: Fitted) -> tuple[Floats, Floats]:
    """Return the marginal residual (r,) and its derivative (r, p) by each number of the fit."""
    edges = np.cumsum([0, *(len(free.names) for free in fitted.free)])

    def effects(x: Floats) -> tuple[Applied, ...]:
        return tuple(
            free.applied(x[a:b]) for free, a, b in zip(fitted.free, edges[:-1], edges[1:], strict=True)
        )

    low, high, scale = (
        np.concatenate([getattr(free, name) for free in fitted.free]) for name in ("low", "high", "scale")
    )
    residual = target.residual(fitted.applied)
    return residual, jacobian_of(target, effects, fitted.x, residual, low, high, scale)


def unbounded_jacobian(target: Likelihood, fitted: Fitted) -> Floats:
    """Return the derivative (r, p) of the marginal residual, as if no nuisance were at its bounds.

    Nuisance that is held there has an uncertainty of its own all the same.
    """
    base = target.whiten([trace.sample(fitted.applied) for trace in target.traces])
    columns, number = [], 0
    for free in fitted.free:
        x = fitted.x[number : number + len(free.names)]
        number += len(free.names)
        for i in range(len(x)):
            step = 0.02 * free.scale[i] * (-1.0 if x[i] + 0.02 * free.scale[i] > free.high[i] else 1.0)
            moved = x.copy()
            moved[i] += step
            own = [
                free.applied(moved) if f is free else a
                for f, a in zip(fitted.free, fitted.applied, strict=True)
            ]
            columns.append((base - target.whiten([trace.sample(own) for trace in target.traces])) / step)
    return target.projected(np.stack(columns, axis=1)) if columns else np.zeros((len(base), 0))


def jacobian_of(
    target: Likelihood,
    effects: Callable[[Floats], tuple[Applied, ...]],
    x: Floats,
    r: Floats,
    low: Floats,
    high: Floats,
    scale: Floats,
) -> Floats:
    """Return the derivative (r, p) of the residual ``r`` at numbers ``x`` by each of them."""
    columns = []
    for i in range(len(x)):
        step = 0.02 * scale[i]
        if x[i] + step > high[i]:
            step = -step
        columns.append(_slope(target, effects, x, r, i, step))
    return np.stack(columns, axis=1) if columns else np.zeros((len(r), 0))


def _slope(
    target: Likelihood,
    effects: Callable[[Floats], tuple[Applied, ...]],
    x: Floats,
    r: Floats,
    i: int,
    step: float,
) -> Floats:
    """Return the derivative (r,) by one number; 0 where neither side can be simulated."""
    for way in (step, -step):
        moved = x.copy()
        moved[i] += way
        try:
            return (target.residual(effects(moved)) - r) / way
        except Gcode2KrlError:
            continue
    return np.zeros_like(r)
