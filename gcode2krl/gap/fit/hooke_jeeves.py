"""Direct search in a box, for functions that are flat in places and so have no useful slope."""

from collections.abc import Callable

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.fit.least_squares import Box

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
