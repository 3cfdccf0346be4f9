"""Least squares with bounded numbers: normal mismatch may be as large as its bounds, and no larger."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
MOST = 3.0**0.5
"""A uniform draw within bounds stays within sqrt(3) of its standard deviation."""
_ROUNDS = 20


def boxed(a: Floats, right: Floats, most: float = MOST) -> Floats:
    """Return b (m,) of least bᵀ·a·b/2 - rightᵀ·b with abs(b) <= ``most``, for a positive definite ``a``.

    Active set: numbers beyond their bounds are held there and let go where the others pull them back.
    """
    b = np.linalg.solve(a, right)
    held = np.zeros(len(b), dtype=bool)
    for _ in range(_ROUNDS):
        beyond = ~held & (np.abs(b) > most)
        slope = right - a @ np.clip(b, -most, most)
        back = held & (slope * b < 0.0)
        if not beyond.any() and not back.any():
            break
        held = (held | beyond) & ~back
        b[held] = np.clip(b[held], -most, most)
        free = ~held
        b[free] = np.linalg.solve(
            a[np.ix_(free, free)], right[free] - a[np.ix_(free, held)] @ b[held]
        )  # fmt: skip
    return np.clip(b, -most, most)
