"""Pulses: for a moment a signal is far from where it was and will be, several rows together.

A pulse is the median of some neighbouring rows less the median of what surrounds them. Compared with the same
all over the run, whatever the colour of the noise, and with how rough the signal is around it: single rows of
heavy tails move no median, and in a burst of the instrument every median moves.
"""

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.gap.beside.decimals import usual_deviation
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.beside
_LEAST_ROWS = 5
"""Of which the median is taken: of three rows heavy tails move it."""
_FOURTH = (1.0, -4.0, 6.0, -4.0, 1.0)
_OF_HEIGHT = 0.25
"""Rows that are off by less of a pulse's height are beside it."""


def pulse_rows(time_s: Floats, values: Floats, segments: Ints, least: Floats) -> Bools:
    """Return which rows (n,) of values (n, k) are in a pulse of any component.

    ``least`` (k,): rms of rounding to the last decimal. A component with many pulses has none: so it is.
    """
    pulsed = np.zeros(len(values), dtype=np.bool_)
    step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    around = max(_rows(_LIMITS.pulse_around_s, step_s), 4 * _LEAST_ROWS + 1)
    for column, smallest in zip(values.T, least.tolist(), strict=True):
        own = np.zeros(len(values), dtype=np.bool_)
        for first, last in segments:
            if last - first > around:
                own[first:last] = _of_column(column[first:last], step_s, around, smallest)
        if np.mean(own) <= _LIMITS.bursts_most:
            pulsed |= own
    return pulsed


def _of_column(values: Floats, step_s: float, around: int, least: float) -> Bools:
    from scipy.ndimage import maximum_filter1d, median_filter

    left: Floats = values - median_filter(values, size=around, mode="nearest")
    pulsed = np.zeros(len(values), dtype=np.bool_)
    for width_s in _LIMITS.pulse_widths_s:
        width = max(_rows(width_s, step_s), _LEAST_ROWS)
        middle = median_filter(left, size=width, mode="nearest")
        usual = max(usual_deviation(middle), least)
        if usual > 0.0:
            rough = _roughness(left, 2 * width + 1)
            far = np.abs(middle) > _LIMITS.pulse_deviations * usual * rough
            height = maximum_filter1d(np.where(far, np.abs(middle), 0.0), width)
            pulsed |= (height > 0.0) & (np.abs(left) > _OF_HEIGHT * height)
    return pulsed


def _roughness(values: Floats, around: int) -> Floats:
    """Return how rough the surroundings of each row (n,) are, over how rough the run usually is; at least 1.

    By the median of fourth differences: a pulse has rough edges, a burst is rough all along.
    """
    from scipy.ndimage import median_filter

    rough = np.abs(np.convolve(values, _FOURTH, mode="same"))
    local: Floats = median_filter(rough, size=around, mode="nearest")
    return np.maximum(local / max(float(np.median(rough)), 1e-300), 1.0)


def _rows(seconds: float, step_s: float) -> int:
    """Return an odd number of rows that last about so long."""
    return 2 * round(seconds / step_s / 2.0) + 1
