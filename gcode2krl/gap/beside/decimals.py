"""What the last decimal of a table is worth."""

import numpy as np

from gcode2krl.arrays import Floats


def resolution(values: Floats) -> float:
    """Return the rms of rounding to the last decimal of (n,) values: step / sqrt(12)."""
    return step_of(values) / float(np.sqrt(12.0))


def step_of(values: Floats) -> float:
    """Return the smallest step between (n,) values; 0 where they are all the same."""
    steps = np.abs(np.diff(np.unique(np.round(values, 12))))
    steps = steps[steps > 1e-9]
    return float(steps.min()) if len(steps) else 0.0
