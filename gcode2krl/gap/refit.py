"""Non-linear refit: the real effects, re-simulated, against the whitened data, nuisance fitted along."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcode2krl.effects import Applied, Effect
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.box import boxed
from gcode2krl.gap.evidence import PRIOR, stretches_of
from gcode2krl.gap.noise import Noise
from gcode2krl.gap.nuisance import Nuisance
from gcode2krl.gap.part import Part
from gcode2krl.gap.signatures import PHASE
from gcode2krl.units import RAD_PER_REV

Floats = NDArray[np.float64]
FIXED = ("harmonic",)
"""Shapes that are counts: a fit keeps the value of the grid."""
_MOST_STEPS = 12
_AT_BOUND = 1e-3
_NUMBER = 0.5
"""Of two effects that are one to the data the one with fewer numbers is named."""
_SLIP = 9.2
"""Twice log 100, prior odds: slips are gross, another tool's load, say; what is slight is another effect."""
_SEARCH_ROUNDS, _FINEST = 30, 0.005
_MOST_STRETCHES = 100_000
_MULTIPLES = (1.0, 0.5, 0.75, 1.25, 1.5, 2.0, 3.0)


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


def free_of(applied: Applied, part: Part) -> Free:
    """Return what of an effect a fit moves, from where it stands."""
    effect = applied.effect
    direction = effect.direction or ()
    names, low, high, scale = [], [], [], []
    nominal, start = (f(part.inputs, applied.target) for f in (effect.nominal, effect.start))
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


class Target:
    """Whitened data of all parts with their nuisance, to be compared with simulations."""

    def __init__(
        self, parts: Sequence[Part], nuisance: Sequence[Sequence[Nuisance]], noise: Sequence[Noise]
    ) -> None:
        self.parts, self.noise = list(parts), list(noise)
        self.shared_width = sum(
            {each.name: each.columns.shape[2] for own in nuisance for each in own if each.shared}.values()
        )
        self.columns = self._wide(nuisance, whitened=True)
        self._decompose()

    def raw(self, nuisance: Sequence[Sequence[Nuisance]]) -> list[Floats]:
        """Return the nuisance columns (k·n, w) of each part as they are, not whitened."""
        return self._wide(nuisance, whitened=False)

    def _wide(self, nuisance: Sequence[Sequence[Nuisance]], whitened: bool) -> list[Floats]:
        """Return the columns (k·n, w) of each part: shared ones in common places, own ones side by side."""
        widths = {each.name: each.columns.shape[2] for own in nuisance for each in own if each.shared}
        starts = dict(zip(widths, np.cumsum([0, *widths.values()]).tolist(), strict=False))
        at = sum(widths.values())
        width = at + sum(each.columns.shape[2] for own in nuisance for each in own if not each.shared)
        found: list[Floats] = []
        for part, own in zip(self.parts, nuisance, strict=True):
            n, k = part.shape
            wide = np.zeros((k * n, width))
            for each in own:
                flat = self._white(part, each.columns) if whitened else each.columns.reshape(k * n, -1)
                place = starts[each.name] if each.shared else at
                wide[:, place : place + flat.shape[1]] = flat
                at += 0 if each.shared else flat.shape[1]
            found.append(wide)
        return found

    def _decompose(self) -> None:
        """Prepare y -> y - N·b, whose squared length with that of b is chi2 after nuisance."""
        width = self.columns[0].shape[1] if self.columns else 0
        self.gram = sum((c.T @ c for c in self.columns), np.zeros((width, width))) + np.eye(width)

    def _white(self, part: Part, columns: Floats) -> Floats:
        return np.concatenate([
            self.noise[j].whiten(columns[j], part.segments) for j in range(columns.shape[0])
        ])  # fmt: skip

    def whiten(self, values: Sequence[Floats]) -> Floats:
        """Return residuals (n, k) of all parts as one whitened vector."""
        return np.concatenate([
            self._white(part, value.T[:, :, None])[:, 0]
            for part, value in zip(self.parts, values, strict=True)
        ])  # fmt: skip

    def without_nuisance(self, y: Floats) -> Floats:
        """Return the vector whose squared length is chi2 after nuisance within its bounds."""
        b = self.nuisance_of(y)
        fitted = np.concatenate([columns @ b for columns in self.columns]) if self.columns else 0.0 * y
        return np.concatenate([y - fitted, b])

    def nuisance_of(self, y: Floats) -> Floats:
        """Return the nuisance coefficients, within their bounds, that fit a whitened vector best."""
        at, sums = 0, np.zeros(len(self.gram))
        for columns in self.columns:
            sums += columns.T @ y[at : at + len(columns)]
            at += len(columns)
        return boxed(self.gram, sums)

    def projected(self, y: Floats) -> Floats:
        """Return vectors (k·n, c) with unbounded nuisance taken out, its coefficients behind them."""
        at, sums = 0, np.zeros((len(self.gram), y.shape[1]))
        for columns in self.columns:
            sums += columns.T @ y[at : at + len(columns)]
            at += len(columns)
        b = np.linalg.solve(self.gram, sums)
        return np.concatenate([y - np.concatenate([columns @ b for columns in self.columns]), b])

    def residual(self, applied: Sequence[Applied]) -> Floats:
        """Return the marginal residual vector with some effects."""
        return self.without_nuisance(
            self.whiten([part.measured - part.sample(applied) for part in self.parts])
        )


def refit(target: Target, start: Sequence[Applied], steps: int = _MOST_STEPS, scan: bool = False) -> Fitted:
    """Return the effects with the numbers that fit best within their plausible ranges (Gauss-Newton with
    damping and bounds); with ``scan`` the last effect begins at the best of some multiples of its size."""
    frees = tuple(free_of(each, target.parts[0]) for each in start)
    sizes = [len(each.names) for each in frees]
    edges = np.cumsum([0, *sizes])
    low, high, scale = (
        np.concatenate([getattr(each, name) for each in frees]) if frees else np.zeros(0)
        for name in ("low", "high", "scale")
    )

    def effects(x: Floats) -> tuple[Applied, ...]:
        return tuple(free.applied(x[a:b]) for free, a, b in zip(frees, edges[:-1], edges[1:], strict=True))

    x = np.concatenate([free.start(each) for free, each in zip(frees, start, strict=True)]) if frees else low
    if scan and frees:
        x = _scanned(target, effects, x, int(edges[-2]), low, high)
    try:
        r = target.residual(effects(x))
    except Gcode2KrlError:  # such a tool, such a path cannot be
        nothing = np.zeros((len(x), len(x)))
        return Fitted(tuple(start), np.inf, x, nothing, frees, (True,) * len(frees), nothing)
    best = float(r @ r)
    jacobian = np.zeros((len(r), len(x)))
    damping = 1e-3
    for _ in range(steps):
        jacobian = _jacobian(target, effects, x, r, low, high, scale)
        improved = False
        for _ in range(4):
            step = _bounded_step(jacobian, r, x, low, high, scale, damping)
            trial = np.clip(x + step, low, high)
            try:
                r_new = target.residual(effects(trial))
            except Gcode2KrlError:
                damping *= 10.0
                continue
            chi2 = float(r_new @ r_new)
            if chi2 < best:
                improved = True
                damping = max(damping / 10.0, 1e-6)
                break
            damping *= 10.0
        if not improved:
            break
        gain, x, r, best = best - chi2, trial, r_new, chi2
        if gain < 0.02 + 1e-6 * best:
            break
    normal = jacobian.T @ jacobian * np.outer(scale, scale) if len(x) else np.zeros((0, 0))
    inverse = np.asarray(np.linalg.pinv(normal, rcond=1e-10, hermitian=True), dtype=np.float64)
    covariance: Floats = inverse * np.outer(scale, scale)
    bound = tuple(free.at_bound(x[a:b]) for free, a, b in zip(frees, edges[:-1], edges[1:], strict=True))
    return Fitted(effects(x), best, x, covariance, frees, bound, normal)


def searched(target: Target, others: Sequence[Applied], start: Applied, step: float = 0.3) -> Applied:
    """Return the effect at the numbers that fit best nearby (Hooke and Jeeves 1961).

    For effects that plan anew: a controller's times are whole cycles, and what is flat has no slope.
    """
    free = free_of(start, target.parts[0])

    def chi2(x: Floats) -> float:
        try:
            r = target.residual((*others, free.applied(x)))
        except Gcode2KrlError:
            return np.inf
        return float(r @ r)

    x = free.start(start)
    best, steps, before = chi2(x), step * free.scale, x
    for _ in range(_SEARCH_ROUNDS):
        reached = x
        for i in range(len(x)):
            for way in (1.0, -1.0):
                trial = reached.copy()
                trial[i] = np.clip(reached[i] + way * steps[i], free.low[i], free.high[i])
                found = chi2(trial)
                if found < best:
                    reached, best = trial, found
                    break
        if reached is x:
            steps = steps / 2.0
            if np.all(steps < _FINEST * free.scale):
                break
            continue
        # on along the way that brought gains: numbers of a time law make up for each other
        before, x = x, reached
        trial = np.clip(2.0 * x - before, free.low, free.high)
        found = chi2(trial)
        if found < best:
            x, best = trial, found
    return free.applied(x)


def _scanned(
    target: Target, effects: Callable[[Floats], tuple[Applied, ...]], x: Floats, first: int, low: Floats,
    high: Floats,
) -> Floats:  # fmt: skip
    """Return the numbers with those from ``first`` on at the best multiple; a signal may not be linear."""
    best, found = np.inf, x
    for factor in _MULTIPLES:
        trial = x.copy()
        trial[first:] = x[first:] * factor
        trial = np.clip(trial, low, high)
        try:
            r = target.residual(effects(trial))
        except Gcode2KrlError:
            continue
        chi2 = float(r @ r)
        if chi2 < best:
            best, found = chi2, trial
    return found


@dataclass(frozen=True)
class Slope:
    """The marginal residual (r,) at a fit, and how it changes (r, p) with the numbers of one of its effects.

    Those of the other effects are taken out; numbers are in units of their typical size.
    """

    residual: Floats
    mine: Floats
    clusters: NDArray[np.int64]
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


def slope_of(target: Target, fitted: Fitted, number: int) -> Slope:
    """Return the residual of a fit and how it changes with one of its effects."""
    residual, jacobian = residual_jacobian(target, fitted)
    first = sum(len(free.names) for free in fitted.free[:number])
    wide = jacobian * np.concatenate([free.scale for free in fitted.free])
    mine = wide[:, first : first + len(fitted.free[number].names)]
    others = np.delete(wide, np.s_[first : first + mine.shape[1]], axis=1)
    if others.shape[1]:
        mine = mine - others @ np.linalg.lstsq(others, mine, rcond=1e-9)[0]
    return Slope(residual, mine, stretches_of_all(target.parts))


def stretches_of_all(parts: Sequence[Part]) -> NDArray[np.int64]:
    """Return the number of the stretch of time of each value of all parts, as `Target.whiten` orders them."""
    return np.concatenate([
        _MOST_STRETCHES * number + np.tile(stretches_of(part), part.shape[1])
        for number, part in enumerate(parts)
    ])  # fmt: skip


def residual_jacobian(target: Target, fitted: Fitted) -> tuple[Floats, Floats]:
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
    return residual, _jacobian(target, effects, fitted.x, residual, low, high, scale)


def unbounded_jacobian(target: Target, fitted: Fitted) -> Floats:
    """Return the derivative (r, p) of the marginal residual, as if no nuisance were at its bounds.

    Nuisance that is held there has an uncertainty of its own all the same.
    """
    base = target.whiten([part.sample(fitted.applied) for part in target.parts])
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
            columns.append((base - target.whiten([part.sample(own) for part in target.parts])) / step)
    return target.projected(np.stack(columns, axis=1)) if columns else np.zeros((len(base), 0))


def _jacobian(
    target: Target,
    effects: Callable[[Floats], tuple[Applied, ...]],
    x: Floats,
    r: Floats,
    low: Floats,
    high: Floats,
    scale: Floats,
) -> Floats:
    columns = []
    for i in range(len(x)):
        step = 0.02 * scale[i]
        if x[i] + step > high[i]:
            step = -step
        columns.append(_slope(target, effects, x, r, i, step))
    return np.stack(columns, axis=1) if columns else np.zeros((len(r), 0))


def _slope(
    target: Target,
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


def _bounded_step(
    jacobian: Floats, r: Floats, x: Floats, low: Floats, high: Floats, scale: Floats, damping: float
) -> Floats:
    """Return a damped step that leaves numbers at their bounds alone where they would go beyond."""
    scaled = jacobian * scale
    free = np.ones(len(x), dtype=bool)
    step = np.zeros(len(x))
    for _ in range(3):
        a = scaled[:, free]
        normal = a.T @ a
        normal += damping * np.diag(np.diag(normal)) + 1e-12 * np.eye(len(normal))
        step[:] = 0.0
        step[free] = -np.linalg.solve(normal, a.T @ r) * scale[free]
        beyond = free & (((x <= low) & (step < 0.0)) | ((x >= high) & (step > 0.0)))
        if not beyond.any():
            break
        free &= ~beyond
    return step
