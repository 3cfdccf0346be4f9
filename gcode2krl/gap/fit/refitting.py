"""Non-linear refit: the real effects, re-simulated, against the whitened data."""

from collections.abc import Callable, Sequence

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.numbers import Fitted, free_of
from gcode2krl.gap.fit.sensitivity import jacobian_of

_MOST_STEPS = 12
_SEARCH_ROUNDS, _FINEST = 30, 0.005
_MULTIPLES = (1.0, 0.5, 0.75, 1.25, 1.5, 2.0, 3.0)


def refit(
    target: Likelihood, start: Sequence[Applied], steps: int = _MOST_STEPS, scan: bool = False
) -> Fitted:
    """Return the effects with the numbers that fit best within their plausible ranges (Gauss-Newton with
    damping and bounds); with ``scan`` the last effect begins at the best of some multiples of its size."""
    frees = tuple(free_of(each, target.traces[0]) for each in start)
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
        jacobian = jacobian_of(target, effects, x, r, low, high, scale)
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


def searched(target: Likelihood, others: Sequence[Applied], start: Applied, step: float = 0.3) -> Applied:
    """Return the effect at the numbers that fit best nearby (Hooke and Jeeves 1961).

    For effects that plan anew: a controller's times are whole cycles, and what is flat has no slope.
    """
    free = free_of(start, target.traces[0])

    def chi2(x: Floats) -> float:
        try:
            r = target.residual((*others, free.applied(x)))
        except Gcode2KrlError:
            return np.inf
        return float(r @ r)

    x = free.start(start)
    best, steps = chi2(x), step * free.scale
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
    target: Likelihood, effects: Callable[[Floats], tuple[Applied, ...]], x: Floats, first: int, low: Floats,
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
