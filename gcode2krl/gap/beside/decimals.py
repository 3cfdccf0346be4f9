"""What the last decimal of a table is worth."""

import numpy as np

from gcode2krl.arrays import Floats


def resolution(values: Floats) -> float:
    """Return the rms of rounding to the last decimal of (n,) values: step / sqrt(12)."""
    steps = np.abs(np.diff(np.unique(np.round(values, 12))))
    steps = steps[steps > 1e-9]
    return float(steps.min() / np.sqrt(12.0)) if len(steps) else 0.0
