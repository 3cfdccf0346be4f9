"""Narrow lines of a spectrum: tones that are looked for as effects before they count as noise.

A line is taken off where the periodogram stands out of its surroundings by more than noise does in a thousand
signals; then the next strongest, until none is left (the CLEAN of Roberts, Lehár & Dreher 1987, with the
exact frequency of each line).
"""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.fit
_PADDED = 4
_AROUND = 60
"""Bins on either side whose median is the level of the noise."""
_LEAST_ROWS = 256


def without_lines(values: Floats) -> Floats:
    """Return values (n,) at equal times less the tones in them."""
    if len(values) < _LEAST_ROWS:
        return values
    for _ in range(_LIMITS.noise_most_lines):
        turns = _strongest_line(values)
        if turns is None:
            break
        angle = 2.0 * np.pi * turns * np.arange(len(values))
        tone = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        values = values - tone @ np.linalg.lstsq(tone, values, rcond=None)[0]
    return values


def _strongest_line(values: Floats) -> float | None:
    """Return the frequency, in turns a row, of the line that stands out most; None where none does."""
    from scipy.ndimage import median_filter

    count = len(values)
    power = np.abs(np.fft.rfft(values)) ** 2
    # a median of exponentially distributed power is log 2 of its mean
    level = median_filter(power, size=2 * _AROUND + 1, mode="reflect") / np.log(2.0)
    above = power / np.maximum(level, 1e-300)
    strongest = int(np.argmax(above[1:-1])) + 1
    if above[strongest] < np.log(len(power) / _LIMITS.noise_false_lines):
        return None
    # between the bins, by the zero-padded spectrum
    fine = np.abs(np.fft.rfft(values, _PADDED * count)) ** 2
    near = slice(max(_PADDED * (strongest - 1), 1), _PADDED * (strongest + 1) + 1)
    peak = near.start + int(np.argmax(fine[near]))
    left, middle, right = fine[peak - 1], fine[peak], fine[min(peak + 1, len(fine) - 1)]
    bend = left - 2.0 * middle + right
    off = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return float((peak + np.clip(off, -0.5, 0.5)) / (_PADDED * count))
