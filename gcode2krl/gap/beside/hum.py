"""Hum of the mains in an instrument: tones at multiples of 50 or 60 Hz, folded by the sampling.

The grid keeps its frequency to some tens of millihertz, whatever the robot does; nothing of a robot or of a
cut is bound to it but a spindle that turns at that speed, and then nothing is taken off.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.band import Bands
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import RAD_PER_REV

LIMITS = THRESHOLDS.beside
_GRIDS_HZ = (50.0, 60.0)
_MULTIPLES = (1, 2, 3, 5)
"""Of a grid: transformers give the second, rectifiers and cores odd ones."""
_TEETH = 12
"""A cutter has no more: so many multiples of the spindle's speed may be in a force."""
_GAP, _BESIDE = 0.2, 40
"""Share of the surroundings that a tone may fill, and how many frequencies on either side are asked."""
_MEDIAN = float(np.log(2.0))
"""Power of noise is distributed exponentially: its median over its mean."""


def without_hum(traces: Sequence[Trace]) -> list[Trace]:
    """Return traces less the tones of the mains in them, each component and run by itself."""
    return [_without(trace) for trace in traces]


def _without(trace: Trace) -> Trace:
    count = len(trace.time_s)
    if trace.still or not trace.link.has_instrument or count < LIMITS.hum_least_rows:
        return trace
    step_s = float(np.median(np.diff(trace.time_s)))
    measured, spectrum = trace.measured.copy(), _Spectrum.of(trace.time_s - trace.time_s[0])
    # what is folded to a drift is none to be told
    told = (hz for hz in _mains_hz(trace) if 4.0 * LIMITS.hum_around_hz < _folded(hz, step_s))
    found = [hz for hz in told if spectrum.take_off(measured, trace.nominal, hz)]
    if not found:
        return trace
    hum = f"hum of the mains at {', '.join(f'{hz:g}' for hz in found)} Hz"
    return replace(trace, measured=measured, left_out=(*trace.left_out, hum))


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


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """The spectrum of one trace around frequencies of the mains."""

    near: Bands
    """Where a tone of the mains may be."""
    around: Bands
    """What is beside it, below as well as above."""

    @classmethod
    def of(cls, time_s: Floats) -> "_Spectrum":
        step_hz = 0.1 / float(time_s[-1])
        count = int(2.0 * LIMITS.hum_wander_hz / step_hz + 1e-6) + 1
        reach_hz = (1.0 - _GAP) * LIMITS.hum_around_hz
        return cls(Bands(time_s, step_hz, count), Bands(time_s, reach_hz / (_BESIDE - 1), _BESIDE))

    def level(self, hz: float, values: Floats) -> Floats:
        """Return the mean power (k,) of noise beside a frequency."""
        starts = (hz - LIMITS.hum_around_hz, hz + _GAP * LIMITS.hum_around_hz)
        around = np.concatenate([self.around.power(start, values) for start in starts])
        level: Floats = np.median(around, axis=0) / _MEDIAN
        return level

    def take_off(self, measured: Floats, nominal: Floats, hz: float) -> bool:
        """Take a tone off the columns (n, k) in which it stands out; tell whether there are any."""
        rests = measured - nominal
        rests -= rests.mean(axis=0)
        first_hz = hz - LIMITS.hum_wander_hz
        powers = self.near.power(first_hz, rests)
        stands_out = powers.max(axis=0) > self.level(hz, rests) * np.log(len(powers) / LIMITS.hum_false)
        for j in np.flatnonzero(stands_out):
            angle = 2.0 * np.pi * self.near.hz(first_hz)[int(np.argmax(powers[:, j]))] * self.near.time_s
            tone = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            measured[:, j] -= tone @ np.linalg.lstsq(tone, rests[:, j], rcond=None)[0]
        return bool(stands_out.any())
