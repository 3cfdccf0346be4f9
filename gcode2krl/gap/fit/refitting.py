"""Non-linear refit: the effects themselves, simulated again, against the whitened data."""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.fit.fitted import Fitted, Numbers
from gcode2krl.gap.fit.hooke_jeeves import pattern_search
from gcode2krl.gap.fit.least_squares import Damped, attempted, gauss_newton
from gcode2krl.gap.fit.likelihood import STEP_SHARE, Likelihood

_MOST_STEPS = 12
"""Bounds the time; a fit ends earlier where chi2 settles."""
_MULTIPLES = (1.0, 0.5, 0.75, 1.25, 1.5, 2.0, 3.0)
"""Of the first order's size, which is small for an effect that saturates; the first order itself first."""
_FIRST_SEARCH_STEP = 0.3
"""In typical sizes."""
_SETTLED, _SETTLED_SHARE = 0.02, 1e-6
"""Falls of chi2, and shares of it, that move a number by far less than its deviation."""


def refit(
    likelihood: Likelihood, start: Sequence[Applied], steps: int = _MOST_STEPS, scan: bool = False
) -> Fitted:
    """Return the effects with the numbers of least chi2 within their plausible ranges.

    With ``scan`` the last effect begins at the best of some multiples of its size. Where the start cannot be
    simulated chi2 is infinite.
    """
    numbers = Numbers.of(start, likelihood.traces[0])
    x = numbers.start(start)

    def residual(at: Floats) -> Floats:
        return likelihood.residual(numbers.applied(at))

    if scan and len(x):
        x = _best_multiple(likelihood, numbers, x)
    try:
        least = gauss_newton(
            residual, x, numbers.box, Damped(numbers.box), _settled, most_steps=steps, step_share=STEP_SHARE
        )
    except Gcode2KrlError:  # there is no such tool, or no such path
        return Fitted(tuple(start), np.inf, numbers, x, np.zeros((len(x), len(x))))
    scale = numbers.box.scale
    information = least.jacobian.T @ least.jacobian * np.outer(scale, scale)
    return Fitted(numbers.applied(least.x), least.chi2, numbers, least.x, information)


def _settled(before: float, after: float) -> bool:
    return before - after < _SETTLED + _SETTLED_SHARE * after


def _best_multiple(likelihood: Likelihood, numbers: Numbers, x: Floats) -> Floats:
    """Return x with the numbers of the last effect at the best multiple; a signal may not be linear."""
    best, best_x = np.inf, x
    for factor in _MULTIPLES:
        trial = x.copy()
        trial[numbers.slices[-1]] *= factor
        trial = numbers.box.clipped(trial)
        r = attempted(lambda at: likelihood.residual(numbers.applied(at)), trial)
        if r is not None and float(r @ r) < best:
            best, best_x = float(r @ r), trial
    return best_x


def searched(likelihood: Likelihood, others: Sequence[Applied], start: Applied) -> Applied:
    """Return the effect at the numbers of least chi2 nearby, without slopes.

    For effects that plan anew: a controller's times are whole cycles, and what is flat has no slope.
    """
    numbers = Numbers.of([start], likelihood.traces[0])

    def chi2(x: Floats) -> float:
        try:
            return likelihood.chi2((*others, *numbers.applied(x)))
        except Gcode2KrlError:
            return np.inf

    x = pattern_search(chi2, numbers.start([start]), numbers.box, _FIRST_SEARCH_STEP)
    return numbers.applied(x)[0]
