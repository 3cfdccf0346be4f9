"""What the last decimal of a table is worth, and deviations that coarse decimals do not hide."""

import numpy as np

from gcode2krl.arrays import Floats

_NORMAL, _NORMAL_MEAN = 1.4826, 1.2533
"""Standard deviation of a normal over its median absolute deviation, and over its mean one."""

_LEAST_STEP, _OFF, _FAR_STEPS = 1e-9, 0.02, 1000.0
"""What is less is the computer's rounding; so much of a step, too, over so many steps at most."""


def resolution(values: Floats) -> float:
    """Return the rms of rounding to the last decimal of (n,) values: step / sqrt(12)."""
    return step_of(values) / float(np.sqrt(12.0))


def step_of(values: Floats) -> float:
    """Return the step of the ladder that all (n,) values are on; 0 where they are on none, or all the same.

    The greatest common divisor of their differences, by Euclid: of few values the smallest difference alone
    is no step.
    """
    steps = np.diff(np.unique(np.round(values, 12)))
    steps = steps[steps > _LEAST_STEP]
    while len(steps):
        step = float(steps.min())
        near = steps[steps <= _FAR_STEPS * step]
        off = np.abs(near - step * np.round(near / step))
        off = off[off > max(_OFF * step, _LEAST_STEP)]
        if not len(off):
            return step if step > 10.0 * _LEAST_STEP else 0.0
        steps = np.append(off, step)
    return 0.0


def usual_deviation(values: Floats) -> float:
    """Return the usual deviation of values (n,) from nothing, whatever a twentieth of them does.

    Where decimals are coarse most values are nothing, and the median alone would be, too.
    """
    sizes = np.abs(values)
    mean = float(np.mean(np.minimum(sizes, np.percentile(sizes, 95.0))))
    return max(_NORMAL * float(np.median(sizes)), _NORMAL_MEAN * mean)
