"""Hum of the mains in an instrument: tones at multiples of 50 or 60 Hz, folded by the sampling.

The grid keeps its frequency to some tens of millihertz, whatever the robot does; nothing of a robot or of a
cut is bound to it but a spindle that turns at that speed, and then nothing is taken off.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import RAD_PER_REV

LIMITS = THRESHOLDS.beside
_GRIDS_HZ = (50.0, 60.0)
_MULTIPLES = (1, 2, 3, 5)
"""Of a grid: transformers give the second, rectifiers and cores odd ones."""
_TEETH = 12
"""A cutter has no more: so many multiples of the spindle's speed may be in a force."""


def without_hum(traces: Sequence[Trace]) -> list[Trace]:
    """Return traces less the tones of the mains in them, each component and run by itself."""
    return [_without(trace) for trace in traces]


def _without(trace: Trace) -> Trace:
    count = len(trace.time_s)
    if trace.still or count < LIMITS.hum_least_rows:
        return trace
    step_s = float(np.median(np.diff(trace.time_s)))
    measured = trace.measured.copy()
    for hz in _mains_hz(trace):
        if 4.0 * LIMITS.hum_around_hz < _folded(hz, step_s):  # what is folded to a drift is none to be told
            _take_off(trace, measured, hz)
    return replace(trace, measured=measured) if not np.array_equal(measured, trace.measured) else trace


def _mains_hz(trace: Trace) -> list[float]:
    """Return the frequencies of the mains that no spindle of the run has."""
    speeds = np.unique(np.round(np.abs(trace.inputs.spindle_rad_s) / RAD_PER_REV, 2))
    turning = np.outer(speeds[speeds > 0.0], np.arange(1, _TEETH + 1)).ravel()
    mains = [grid * multiple for grid in _GRIDS_HZ for multiple in _MULTIPLES]
    return [hz for hz in mains if not np.any(np.abs(turning - hz) < LIMITS.hum_beside_hz)]


def _folded(hz: float, step_s: float) -> float:
    """Return the frequency at which a tone shows in samples."""
    turns = hz * step_s % 1.0
    return min(turns, 1.0 - turns) / step_s


def _take_off(trace: Trace, measured: Floats, hz: float) -> None:
    """Take a tone off the columns (n, k) in which it stands out of what is beside it in the spectrum."""
    time_s = trace.time_s - trace.time_s[0]
    span_s = float(time_s[-1])
    fine = np.arange(-LIMITS.hum_wander_hz, LIMITS.hum_wander_hz + 1e-9, 0.1 / span_s)
    beside = LIMITS.hum_around_hz * np.linspace(0.2, 1.0, 40)
    for j in range(measured.shape[1]):
        rest = measured[:, j] - trace.nominal[:, j]
        rest = rest - rest.mean()
        power = np.abs(_transform(rest, time_s, hz + fine)) ** 2
        around = np.abs(_transform(rest, time_s, np.concatenate([hz - beside, hz + beside]))) ** 2
        # power of noise is distributed exponentially: its median is log 2 of its mean
        level = float(np.median(around)) / np.log(2.0)
        if power.max() > level * np.log(len(fine) / LIMITS.hum_false):
            angle = 2.0 * np.pi * (hz + fine[int(np.argmax(power))]) * time_s
            tone = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            measured[:, j] -= tone @ np.linalg.lstsq(tone, rest, rcond=None)[0]


def _transform(values: Floats, time_s: Floats, hz: Floats) -> Floats:
    transformed: Floats = np.exp(-2j * np.pi * hz[:, None] * time_s) @ values
    return transformed
