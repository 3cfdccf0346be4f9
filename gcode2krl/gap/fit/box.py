"""Least squares with bounded numbers: normal mismatch may be as large as its bounds, and no larger.

`scipy.optimize.lsq_linear` (method "bvls") finds the same numbers and is the reference of the tests. On the
recorded calls of a diagnosis it takes 40 times as long, and it wants columns where the fast view has their
Gram matrix.
"""

import numpy as np
from scipy.linalg.lapack import dposv

from gcode2krl.arrays import Bools, Floats

MOST = 3.0**0.5
"""A uniform draw within bounds stays within sqrt(3) of its standard deviation."""
_GUESSES = 3
"""Three fits in five need no more, and for the others a descent costs less than further guesses."""
_STEPS_A_COLUMN = 20
"""Bounds the time whatever the data are; fits of a diagnosis end after a fraction of one."""
_ROUNDING = 1e-12
"""A slope below this share of the sums that it is the difference of is none."""


def boxed(a: Floats, right: Floats, most: float = MOST) -> Floats:
    """Return b (m,) of least bᵀ·a·b/2 - rightᵀ·b with abs(b) <= ``most``, for a positive definite ``a``.

    Which numbers are at their bounds is guessed first, all at once. Where columns are correlated guesses may
    run in circles; what they leave open is settled by a descent.
    """
    scale = 1.0 / np.sqrt(np.diag(a))  # so that columns of any unit are of one size
    fit = _Fit(a * np.outer(scale, scale), right * scale, most / scale)
    b = _solved(fit.a, fit.right)
    if np.any(np.abs(b) >= fit.most):
        b = fit.descended(fit.guessed(b))
    # exactly at the bound: callers ask which numbers are there
    return np.where(np.abs(b) >= fit.most, np.copysign(most, b), np.clip(b * scale, -most, most))


class _Fit:
    """A fit whose numbers b (m,) stay within ±``most`` (m,)."""

    def __init__(self, a: Floats, right: Floats, most: Floats) -> None:
        self.a, self.right, self.most = a, right, most
        self._noise = _ROUNDING * (np.abs(a) @ most + np.abs(right))

    def free_fit(self, b: Floats, held: Bools) -> Floats:
        """Return b with the numbers that are not held at their best beside those that are."""
        free, fitted = np.flatnonzero(~held), b.copy()
        rows = self.a[free]
        fitted[free] = _solved(rows[:, free], self.right[free] - rows[:, held] @ b[held])
        return fitted

    def pulled_back(self, b: Floats, held: Bools) -> Bools:
        """Return which of the held numbers (m,) would make the fit better within their bounds."""
        return held & ((self.right - self.a @ b) * np.sign(b) < -self._noise)

    def guessed(self, b: Floats) -> Floats:
        """Return b where all numbers beyond their bounds are held there, and all pulled back are let go.

        It begins at the fit without bounds.
        """
        held = np.zeros(len(self.most), dtype=bool)
        for _ in range(_GUESSES):
            beyond = np.abs(b) > self.most
            b = np.clip(b, -self.most, self.most)
            back = self.pulled_back(b, held)
            if not beyond.any() and not back.any():
                break
            held = (held | beyond) & ~back
            b = self.free_fit(b, held)
        return np.clip(b, -self.most, self.most)

    def descended(self, b: Floats) -> Floats:
        """Return the least fit, reached from b by steps that never make it worse.

        An active set as in Stark & Parker 1995 (bounded-variable least squares): a step towards the best fit
        of the free numbers ends where one of them meets its bound and is held; at that best fit those which
        are pulled back are let go. It ends where none is: the conditions of Karush, Kuhn and Tucker.
        """
        held = np.abs(b) >= self.most
        for _ in range(_STEPS_A_COLUMN * len(b)):
            best = self.free_fit(b, held)
            beyond = np.abs(best) > self.most
            if beyond.any():
                bound = np.copysign(self.most, best)
                share = np.full(len(b), np.inf)
                share[beyond] = (bound - b)[beyond] / (best - b)[beyond]
                b = b + share.min() * (best - b)
                met = share == share.min()
                b[met] = bound[met]
                held |= met
                continue
            b = best
            back = self.pulled_back(b, held)
            if not back.any():
                break
            held &= ~back
        return b


def _solved(a: Floats, right: Floats) -> Floats:
    """Return a⁻¹·right by Cholesky; of columns that are equal to the last bit, shares of equal size."""
    if not len(right):
        return right
    _, solved, failed = dposv(a, right)
    if not failed:
        return np.asarray(solved, dtype=float)
    try:
        return np.asarray(np.linalg.solve(a, right), dtype=float)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(a, right, rcond=None)[0], dtype=float)
