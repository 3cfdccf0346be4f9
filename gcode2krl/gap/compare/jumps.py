"""Moments at which a residual jumps, beside whatever else it does around them.

In a window of 2·h rows about a moment each component is a cubic and a jump; how surprising the jump is, is
the log-likelihood ratio N·log(S/(S - g)) of least squares with and without it, N the rows, S the sum of
squares beside the cubic and g what the jump takes of it (Quandt 1958, in a moving window). What a clock or a
lag takes goes first: where joints stop and start it jumps in every sound run. Only the order of moments
matters here: an effect that begins at one of them is judged on all data.
"""

from collections.abc import Sequence

import numpy as np
from scipy.signal import fftconvolve

from gcode2krl.arrays import Floats
from gcode2krl.gap.compare.interpolation import usual_step_s
from gcode2krl.gap.compare.trace import Span, Trace
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import S_PER_H

_LIMITS = THRESHOLDS.noise
_SMOOTH = 3
"""Degree of the polynomial that stands for whatever else goes on in a window."""
_ROUNDING = 1e-12
"""Share of a component's power below which a sum of squares is that of rounding errors."""


def strongest_moments(traces: Sequence[Trace], low_s: float, high_s: float) -> tuple[float, ...]:
    """Return the moments of the clearest jumps, in s since the earliest run started, the clearest first."""
    jumps_of_runs = [
        (jump, trace.inputs.hours * S_PER_H + float(trace.time_s[row]), half_s)
        for trace in traces
        for half_s in _LIMITS.jump_halves_s
        for row, jump in _peaks(trace, half_s)
    ]
    moments: list[float] = []
    for _, at_s, half_s in sorted(jumps_of_runs, reverse=True):
        apart = all(abs(at_s - other) > half_s for other in moments)
        if apart and low_s <= at_s <= high_s and len(moments) < _LIMITS.jumps:
            moments.append(at_s)
    return tuple(moments)


def jump_within(trace: Trace, span_s: Span) -> float | None:
    """Return the moment within a span at which a residual jumps most clearly; None where it does not.

    All components jump at once, between two stamps: the middle of these is the moment.
    """
    time_s = trace.time_s
    half = max(3, round(_LIMITS.jump_halves_s[0] / usual_step_s(time_s)))
    first, last = np.searchsorted(time_s, span_s)
    first, last = max(int(first) - half, 0), min(int(last) + half + 1, len(time_s))
    if last - first <= 2 * half:
        return None
    clear = np.sum([jump_clarity(column, half) for column in _without_clock(trace)[first:last].T], axis=0)
    row = first + int(np.argmax(clear))
    return float(time_s[row - 1] + time_s[row]) / 2.0 if clear.max() >= _LIMITS.least_jump else None


def _peaks(trace: Trace, half_s: float) -> list[tuple[int, float]]:
    """Return rows and sizes of the clearest jumps of a trace, not two of them within a window's half."""
    step_s = usual_step_s(trace.time_s)
    half = max(3, round(half_s / step_s))
    if len(trace.time_s) < 2 * half:
        return []
    clear = np.sum([jump_clarity(column, half) for column in _without_clock(trace).T], axis=0)
    peaks: list[tuple[int, float]] = []
    for row in np.argsort(-clear):
        if clear[row] < _LIMITS.least_jump or len(peaks) == _LIMITS.jumps:
            break
        if all(abs(row - other) > half for other, _ in peaks):
            peaks.append((int(row), float(clear[row])))
    return peaks


def _without_clock(trace: Trace) -> Floats:
    """Return the residual (n, k) less what a usual clock or lag of each component takes of it.

    Two milliseconds of a joint that stops at a corner are a jump of many deviations, and no event.
    """
    rate = trace.clock_rate - trace.clock_rate.mean(axis=0)
    late = np.sum(rate * trace.residual, axis=0) / np.maximum(np.sum(rate**2, axis=0), 1e-300)
    without: Floats = trace.residual - rate * late
    return without


def jump_clarity(values: Floats, half: int) -> Floats:
    """Return how surprising a jump before each row of (n,) is; 0 within ``half`` rows of the ends."""
    rows = (np.arange(2 * half) - (half - 0.5)) / half
    smooth = np.linalg.qr(np.vander(rows, _SMOOTH + 1))[0]
    jump = np.sign(rows) - smooth @ (smooth.T @ np.sign(rows))
    jump /= np.linalg.norm(jump)
    values = values - values.mean()
    power = _moving(values**2, np.ones(2 * half))
    explained = sum(_moving(values, each) ** 2 for each in smooth.T)
    taken = _moving(values, jump)
    unexplained = np.maximum(power - explained, _ROUNDING * max(float(power.max()), 1e-300))
    share = np.minimum(taken**2 / unexplained, 1.0 - _ROUNDING)
    clear = np.zeros(len(values))
    clear[half : half + len(share)] = -2.0 * half * np.log1p(-share)
    return clear


def _moving(values: Floats, kernel: Floats) -> Floats:
    """Return the inner product of a kernel with each window of (n,)."""
    sums: Floats = fftconvolve(values, kernel[::-1], mode="valid")
    return sums
