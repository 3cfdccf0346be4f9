"""What the last decimal of a table is worth, and deviations that coarse decimals do not hide."""

import numpy as np

from gcode2krl.arrays import Floats

_NORMAL, _NORMAL_MEAN = 1.4826, 1.2533
"""Standard deviation of a normal over its median absolute deviation, and over its mean one."""


def resolution(values: Floats) -> float:
    """Return the rms of rounding to the last decimal of (n,) values: step / sqrt(12)."""
    return step_of(values) / float(np.sqrt(12.0))


def step_of(values: Floats) -> float:
    """Return the smallest step between (n,) values; 0 where they are all the same."""
    steps = np.abs(np.diff(np.unique(np.round(values, 12))))
    steps = steps[steps > 1e-9]
    return float(steps.min()) if len(steps) else 0.0


def usual_deviation(values: Floats) -> float:
    """Return the usual deviation of values (n,) from nothing, whatever a twentieth of them does.

    Where decimals are coarse most values are nothing, and the median alone would be, too.
    """
    sizes = np.abs(values)
    mean = float(np.mean(np.minimum(sizes, np.percentile(sizes, 95.0))))
    return max(_NORMAL * float(np.median(sizes)), _NORMAL_MEAN * mean)
