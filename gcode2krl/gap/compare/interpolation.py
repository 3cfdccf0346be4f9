"""Signals between their samples, what the last decimal of a table is worth, and spectra in narrow bands."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Complexes, Floats, Ints
from gcode2krl.compiled.core import FLOATS, INTS, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.effects import Signals

_fill_place = core_function("gap_place", FLOATS, FLOATS, OUT_INTS, OUT_FLOATS)
_fill_lines = core_function("gap_lines", INTS, FLOATS, FLOATS, OUT_FLOATS)
_fill_cubics = core_function("gap_cubics", INTS, FLOATS, FLOATS, FLOATS, OUT_FLOATS)

_PATHS = {
    "tcp_base_mm": "position_mm",
    "q_cmd_rad": "q_cmd_rad",
    "q_act_rad": "q_cmd_rad",
    "q_load_rad": "q_cmd_rad",
}
"""Signals that follow the commanded path closely: the path is interpolated by cubics, the rest by lines."""


def follows_path(name: str) -> bool:
    """Tell whether a signal follows the commanded path closely."""
    return name in _PATHS


def values_of(signals: Signals, name: str) -> Floats:
    """Return a signal (m, c); the motor side is the measured one where the inputs have it."""
    if name == "q_act_rad" and signals.inputs.q_act_rad is not None:
        return signals.inputs.q_act_rad
    values: Floats = getattr(signals, name)
    return values


class LastPath:
    """The commanded path at the times at which it was last asked for: that of hundreds of simulations."""

    def __init__(self) -> None:
        self._asked: tuple[Floats, Floats, Floats] | None = None
        self._found: Floats = np.zeros((0, 0))

    def at(self, times_s: Floats, own_s: Floats, path: Floats) -> Floats:
        """Return the path (m, c) at other times, as `cubic`."""
        if self._asked is None or not _is_same((times_s, own_s, path), self._asked):
            self._asked, self._found = (times_s, own_s, path), cubic(times_s, own_s, path)
        return self._found


def _is_same(asked: tuple[Floats, Floats, Floats], before: tuple[Floats, Floats, Floats]) -> bool:
    if asked[1] is not before[1] or asked[2] is not before[2]:
        return False
    return asked[0] is before[0] or np.array_equal(asked[0], before[0])


def interpolate(signals: Signals, name: str, times_s: Floats, last: LastPath | None = None) -> Floats:
    """Return a signal at other times: the commanded path in it by cubics, what deviates from it by lines.

    A line between samples 12 ms apart is off by a·dt²/8, 0.04 mm at 2 m/s²; a cubic is not. ``last`` keeps
    the path between calls.
    """
    last = last or LastPath()
    values = values_of(signals, name)
    path = getattr(signals.inputs, _PATHS[name], None) if name in _PATHS else None
    if path is None:
        return linear(times_s, signals.time_s, values)
    if values is path:
        return last.at(times_s, signals.time_s, path).copy()
    return last.at(times_s, signals.time_s, path) + linear(times_s, signals.time_s, values - path)


def linear(times_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return the columns (m, c) at other times, linearly; the ends are held."""
    row, share = _place(times_s, own_s)
    at_times = np.empty((len(row), values.shape[1]))
    _fill_lines(row, share, np.ascontiguousarray(values, dtype=np.float64), at_times)
    return at_times


def cubic(times_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return the columns (m, c) at other times by cubic Hermite pieces with central slopes; ends are held."""
    if len(own_s) < 2:
        raise ValueError("a cubic needs two samples at least")
    row, share = _place(times_s, own_s)
    own_s, values = (np.ascontiguousarray(each, dtype=np.float64) for each in (own_s, values))
    at_times = np.empty((len(row), values.shape[1]))
    _fill_cubics(row, share, own_s, values, at_times)
    return at_times


def nearest_rows(own_s: Floats, times_s: Floats) -> Ints:
    """Return the row (n,) of the sample nearest to each time."""
    row, share = _place(times_s, own_s)
    return row + (share > 0.5)


def _place(times_s: Floats, own_s: Floats) -> tuple[Ints, Floats]:
    """Return the row (n,) before each time, the last but one at most, and the share (n,) of the way on."""
    times_s, own_s = (np.ascontiguousarray(each, dtype=np.float64) for each in (times_s, own_s))
    row, share = np.empty(len(times_s), dtype=np.int64), np.empty(len(times_s))
    _fill_place(times_s, own_s, row, share)
    return row, share


def usual_step_s(time_s: Floats) -> float:
    """Return the median step of times (n,)."""
    return float(np.median(np.diff(time_s)))


def length_along(values: Floats) -> Floats:
    """Return the way (n,) along a polyline (n, k), 0 first."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(values, axis=0), axis=1))])


def rms(values: Floats) -> float:
    """Return the root of the mean square of all values."""
    return float(np.sqrt(np.mean(values**2)))


def rms_length(vectors: Iterable[Floats]) -> float:
    """Return the rms length of the rows of arrays (n, k)."""
    return float(np.sqrt(np.mean(np.concatenate([np.sum(each**2, axis=1) for each in vectors]))))


def hats(values: Floats, knots: Floats) -> Floats:
    """Return functions (n, k) of values (n,), each 1 at one of evenly spaced knots (k,), 0 at the others."""
    made: Floats = np.maximum(0.0, 1.0 - np.abs(values[:, None] - knots) / (knots[1] - knots[0]))
    return made


def running_mean(values: Floats, rows: int) -> Floats:
    """Return the mean of ``rows`` neighbours of each row of (n, c), of fewer at the ends."""
    kernel = np.ones(max(rows, 1))
    count = np.convolve(np.ones(len(values)), kernel, mode="same")
    return np.stack([np.convolve(column, kernel, mode="same") / count for column in values.T], axis=1)


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


@dataclass(frozen=True, eq=False)
class Bands:
    """Bands of so many frequencies each, of values at some times (n,)."""

    time_s: Floats
    step_hz: float
    count: int

    def hz(self, first_hz: float) -> Floats:
        """Return the frequencies (f,) of the band that begins at one."""
        return np.asarray(first_hz + self.step_hz * np.arange(self.count), dtype=np.float64)

    @cached_property
    def _factors(self) -> tuple[Complexes, Complexes]:
        """Waves (a, n) and (b, n), whose products are those of all frequencies of a band from 0 on.

        Some 2·sqrt(f) waves are computed, and not f of them for each band.
        """
        wide = max(1, round(self.count**0.5))
        coarse = np.arange(-(-self.count // wide)) * wide
        first, second = (self._waves(self.step_hz * each) for each in (coarse, np.arange(wide)))
        return first, second

    def _waves(self, hz: Floats) -> Complexes:
        waves: Complexes = np.exp(-2j * np.pi * hz[:, None] * self.time_s)
        return waves

    def power(self, first_hz: float, values: Floats) -> Floats:
        """Return the squared absolute sums (f, k) of values (n, k) times exp(-2·pi·i·f·t)."""
        first, second = self._factors
        moved = self._waves(np.array([first_hz]))[0][:, None] * values
        sums = [((first * column) @ second.T).reshape(-1)[: self.count] for column in moved.T]
        power: Floats = np.abs(np.stack(sums, axis=1)) ** 2
        return power
