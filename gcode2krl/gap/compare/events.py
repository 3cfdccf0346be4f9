"""Events: what is rough or far off for a moment, and whose it is before anything is left out.

An encoder does not burst in step with the command, nor at the same places in every run, nor together with the
tracker, and it leaves nothing behind. So what is rough is compared with where the command changes (jerk,
reversals, jumps of the predicted force), with repeats of the program, with the other tables and with the
level before and after it:

- in step with the command, or at the same place in all repeats: structure, and it stays.
- with a change that stays behind it: something slipped, which is told. It stays where it is
  that change alone. Where another table is rough at the same moment it is a gap: instruments do not slip
  together.
- a pulse, or rough in two tables at once: an impulse of the machine. Its rows are a model of their
  own, so the rest is judged without them; it is told with moment, size and width, and is a gap.
- else the instrument's: a burst. It is left out, and that is told. Of a tracker or a force sensor that has
  three of these a pulse is one more.

"In step" is a binomial test: of k events at least so many fall into a share f of the time by chance.

**Bursts and outliers.** Fourth differences of measured less model have nothing of drifts, effects and
vibration of some tens of hertz, and of a jump a few rows only; in a burst their median over a tenth of a
second rises. A single row far from its neighbours, which agree with each other, is an outlier. A component of
which more than a small part would go has neither: that is then how the instrument, or what it sees, is.

**Pulses.** For a moment a signal is far from where it was and will be, several rows together: the median of
some neighbouring rows less the median of what surrounds them. It is compared with the same all over the run,
whatever the colour of the noise, and with how rough the signal is around it: single rows of heavy tails move
no median, and in a burst of the instrument every median moves.

**Hum of the mains.** Tones at multiples of 50 or 60 Hz, folded by the sampling. The grid keeps its frequency
to some tens of millihertz, whatever the robot does; nothing of a robot or of a cut is bound to it but a
spindle that turns at that speed, and then nothing is taken off.

**Jumps.** In a window of 2·h rows about a moment each component is a cubic and a jump; how surprising the
jump is, is the log-likelihood ratio N·log(S/(S - g)) of least squares with and without it, N the rows, S the
sum of squares beside the cubic and g what the jump takes of it (Quandt 1958, in a moving window). What a
clock or a lag takes goes first: where joints stop and start it jumps in every sound run. Only the order of
moments matters here: an effect that begins at one of them is judged on all data.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects import Inputs
from gcode2krl.gap.compare.inputs import Admissible
from gcode2krl.gap.compare.interpolation import Bands, linear, resolution, usual_deviation, usual_step_s
from gcode2krl.gap.compare.pair import force_jumps
from gcode2krl.gap.compare.trace import Event, Span, Trace, Whose, is_repeat, with_rows
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import RAD_PER_REV, S_PER_H

_LIMITS = THRESHOLDS.compare
_WEIGHTS = (1.0, -4.0, 6.0, -4.0, 1.0)
_LEAST_WINDOW = 9
"""Rows, so that the differences around one jump are fewer than half of a window."""
_LEAST_SCALE = 1e-12


def loud_rows(time_s: Floats, values: Floats, segments: Ints, model: Floats | None = None) -> Bools:
    """Return which rows (n,) of values (n, k) are in a burst or outliers, in any component.

    Rows stay at which the ``model`` (n, k) itself is as rough as the values usually are: what is left there
    is the model's.
    """
    loud = np.zeros(len(values), dtype=bool)
    if len(values) < 2 * _LEAST_WINDOW:
        return loud
    window = max(_LEAST_WINDOW, round(_LIMITS.burst_s / usual_step_s(time_s))) | 1
    for j, column in enumerate(values.T):
        rough = np.abs(_fourth_differences(column, segments))
        usual = float(np.median(rough[np.isfinite(rough)])) if np.isfinite(rough).any() else 0.0
        if usual <= _LEAST_SCALE:  # the last decimal, or nothing, moves
            continue
        rows = _widened(_local(rough, usual, window) > _LIMITS.burst_times * usual, window // 2)
        rows |= _outliers(column, segments, usual)
        if model is not None:
            rows &= ~_widened(np.abs(_fourth_differences(model[:, j], segments)) > usual, window)
        if np.mean(rows) <= _LIMITS.bursts_most:
            loud |= rows
    return loud


def _local(rough: Floats, usual: float, window: int) -> Floats:
    """Return the median (n,) of a roughness around each row."""
    from scipy.ndimage import median_filter

    local: Floats = median_filter(np.where(np.isfinite(rough), rough, usual), size=window, mode="nearest")
    return local


def _fourth_differences(values: Floats, segments: Ints) -> Floats:
    """Return fourth differences (n,) around each row; not a number at two rows at each end of a segment."""
    differences = np.full(len(values), np.nan)
    for first, last in segments:
        if last - first >= len(_WEIGHTS):
            differences[first + 2 : last - 2] = np.convolve(values[first:last], _WEIGHTS, mode="valid")
    return differences


def _outliers(values: Floats, segments: Ints, usual: float) -> Bools:
    """Return which rows (n,) are far from both neighbours, which agree with each other."""
    far = np.zeros(len(values), dtype=bool)
    for first, last in segments:
        x = values[first:last]
        if len(x) < 3:
            continue
        middle = 0.5 * (x[:-2] + x[2:])
        off = np.abs(x[1:-1] - middle)
        # of normal values the median fourth difference is 5.6 deviations
        least = _LIMITS.outlier_deviations * usual / 5.6
        far[first + 1 : last - 1] = (off > least) & (np.abs(x[2:] - x[:-2]) < 0.5 * off)
    return far


def _widened(rows: Bools, by: int) -> Bools:
    """Return rows (n,) with this many on either side."""
    return np.convolve(rows, np.ones(2 * by + 1), mode="same") > 0.5


_SHORT_ROWS, _SHORT_TIMES = 3, 1.75
"""Rows of which two that are far suffice for a median: so many times as far they are as rare as of five, in
tails of Student's t with three degrees."""


class Fewest(NamedTuple):
    """Fewest rows of which a pulse's median is taken, and of which its surroundings' roughness."""

    pulse: int
    rough: int


OF_TABLE, OF_ENCODERS = Fewest(_SHORT_ROWS, 17), Fewest(5, 11)
"""A short blow's own edges, that fourth differences widen, must not fill half of its surroundings; a servo is
off for three rows, and rough around, where the command jerks."""
_LEAST_PULSE_AROUND = 21
"""Rows around a pulse."""
_OF_HEIGHT = 0.25
"""Rows that are off by less of a pulse's height are beside it."""


def pulse_rows(time_s: Floats, values: Floats, least: Floats, fewest: Fewest = OF_TABLE) -> Bools:
    """Return which rows (n,) of values (n, k) are in a pulse of any component.

    ``least`` (k,): rms of rounding to the last decimal. A component with many pulses has none: so it is. Rows
    that are left out, as where the predicted force jumps, do not part what is far off from its level.
    """
    pulsed = np.zeros(len(values), dtype=np.bool_)
    step_s = usual_step_s(time_s) if len(time_s) > 1 else 1.0
    around = max(_rows(_LIMITS.pulse_around_s, step_s), _LEAST_PULSE_AROUND)
    for column, smallest in zip(values.T, least.tolist(), strict=True):
        if len(column) > around:
            is_pulse = _of_column(column, step_s, around, smallest, fewest)
            if np.mean(is_pulse) <= _LIMITS.bursts_most:
                pulsed |= is_pulse
    return pulsed


def _of_column(values: Floats, step_s: float, around: int, least: float, fewest: Fewest) -> Bools:
    from scipy.ndimage import maximum_filter1d, median_filter

    high: Floats = values - median_filter(values, size=around, mode="nearest")
    pulsed = np.zeros(len(values), dtype=np.bool_)
    for width_s in _LIMITS.pulse_widths_s:
        width = max(_rows(width_s, step_s), fewest.pulse)
        middle = median_filter(high, size=width, mode="nearest")
        usual = max(usual_deviation(middle), least)
        if usual > 0.0:
            rough = _roughness(high, max(2 * width + 1, fewest.rough))
            times = _LIMITS.pulse_deviations * (_SHORT_TIMES if width <= _SHORT_ROWS else 1.0)
            far = np.abs(middle) > times * usual * rough
            height = maximum_filter1d(np.where(far, np.abs(middle), 0.0), width)
            pulsed |= (height > 0.0) & (np.abs(high) > _OF_HEIGHT * height)
    return pulsed


def _roughness(values: Floats, around: int) -> Floats:
    """Return how rough the surroundings of each row (n,) are, over how rough the run usually is; at least 1.

    By the median of fourth differences: a pulse has rough edges, a burst is rough all along.
    """
    from scipy.ndimage import median_filter

    rough = np.abs(np.convolve(values, _WEIGHTS, mode="same"))
    local: Floats = median_filter(rough, size=around, mode="nearest")
    return np.maximum(local / max(float(np.median(rough)), 1e-300), 1.0)


def _rows(seconds: float, step_s: float) -> int:
    """Return an odd number of rows that last about so long."""
    return 2 * round(seconds / step_s / 2.0) + 1


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
    if trace.still or not trace.link.has_instrument or count < _LIMITS.hum_least_rows:
        return trace
    step_s = usual_step_s(trace.time_s)
    measured, spectrum = trace.measured.copy(), _Spectrum.of(trace.time_s - trace.time_s[0])
    # what is folded to a drift is none to be told
    mains_hz = (hz for hz in _mains_hz(trace) if 4.0 * _LIMITS.hum_around_hz < _folded(hz, step_s))
    taken_hz = [hz for hz in mains_hz if spectrum.take_off(measured, trace.nominal, hz)]
    if not taken_hz:
        return trace
    hum = f"hum of the mains at {', '.join(f'{hz:g}' for hz in taken_hz)} Hz"
    return replace(trace, measured=measured, left_out=(*trace.left_out, hum))


def _mains_hz(trace: Trace) -> list[float]:
    """Return the frequencies of the mains that no spindle of the run has."""
    speeds = np.unique(np.round(np.abs(trace.inputs.spindle_rad_s) / RAD_PER_REV, 2))
    turning = np.outer(speeds[speeds > 0.0], np.arange(1, _TEETH + 1)).ravel()
    mains = [grid * multiple for grid in _GRIDS_HZ for multiple in _MULTIPLES]
    return [hz for hz in mains if not np.any(np.abs(turning - hz) < _LIMITS.hum_beside_hz)]


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
        count = int(2.0 * _LIMITS.hum_wander_hz / step_hz + 1e-6) + 1
        reach_hz = (1.0 - _GAP) * _LIMITS.hum_around_hz
        return cls(Bands(time_s, step_hz, count), Bands(time_s, reach_hz / (_BESIDE - 1), _BESIDE))

    def level(self, hz: float, values: Floats) -> Floats:
        """Return the mean power (k,) of noise beside a frequency."""
        starts = (hz - _LIMITS.hum_around_hz, hz + _GAP * _LIMITS.hum_around_hz)
        around = np.concatenate([self.around.power(start, values) for start in starts])
        level: Floats = np.median(around, axis=0) / _MEDIAN
        return level

    def take_off(self, measured: Floats, nominal: Floats, hz: float) -> bool:
        """Take a tone off the columns (n, k) in which it stands out; tell whether there are any."""
        rests = measured - nominal
        rests -= rests.mean(axis=0)
        first_hz = hz - _LIMITS.hum_wander_hz
        powers = self.near.power(first_hz, rests)
        stands_out = powers.max(axis=0) > self.level(hz, rests) * np.log(len(powers) / _LIMITS.hum_false)
        for j in np.flatnonzero(stands_out):
            angle = 2.0 * np.pi * self.near.hz(first_hz)[int(np.argmax(powers[:, j]))] * self.near.time_s
            tone = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            measured[:, j] -= tone @ np.linalg.lstsq(tone, rests[:, j], rcond=None)[0]
        return bool(stands_out.any())


_JERK_STEP_S = 0.012
"""Over which the commanded acceleration is differenced: a cycle of the interpolator."""
_LEVELS = 200
"""Places of a run at which the level before and after is compared."""
_OUTLIER_ROWS = 2
"""So few rows that are no pulse are an outlier, which needs no moment."""
_LEAST_ROWS = 60
_MOST_FITTED = 4000
"""Rows of a run from which is learnt what follows the motion; the time that takes does not grow with it."""
_MOMENT_S = 0.1
"""Over which changes of the rest are compared with those of the motion."""
_FAR, _RIDGE = 6.0, 1e-6
"""Robust deviations beyond which a row does not tell what follows the motion; columns of unit mean square."""


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Rough rows of a trace that belong together."""

    first: int
    last: int
    is_pulse: bool

    @property
    def is_outlier(self) -> bool:
        return not self.is_pulse and self.last - self.first <= _OUTLIER_ROWS

    def is_in(self, rows: Bools) -> bool:
        """Tell whether any of its rows is among some (n,)."""
        return bool(rows[self.first : self.last].any())

    def span(self, trace: Trace) -> Span:
        return float(trace.time_s[self.first]), float(trace.time_s[self.last - 1])


def sorted_out(traces: Sequence[Trace], elsewhere: Mapping[str, Sequence[Span]]) -> list[Trace]:
    """Return traces of all runs with their events, less the rows of impulses and of instruments' bursts.

    ``elsewhere``: of each run the times at which other tables are rough (`rough_spans`).
    """
    rests = [_rest(trace) for trace in traces]
    stretches = [list(_stretches(trace, rest)) for trace, rest in zip(traces, rests, strict=True)]
    if not any(stretches):
        return list(traces)
    commanded = _in_step(traces, stretches, [command_changes(trace) for trace in traces])
    repeated = [_repeated(traces, rests, stretches, number) for number in range(len(traces))]
    shared = [_at(trace, elsewhere.get(trace.run, ())) for trace in traces]
    coincident = _in_step(traces, stretches, shared, least=1)
    sorted_traces = [
        _sorted(_Levels(trace, calm), spans, [a or b for a, b in zip(command, again, strict=True)], both)
        for trace, calm, spans, command, again, both in zip(
            traces, rests, stretches, commanded, repeated, coincident, strict=True
        )
    ]
    # a tracker or a force sensor that bursts so often: a pulse of it may be a burst, too
    bursts = sum(event.whose is Whose.INSTRUMENT for trace in sorted_traces for event in trace.events)
    if traces[0].link.of_joints or bursts < _LIMITS.bursty_least:
        return sorted_traces
    return [replace(trace, events=tuple(map(_as_burst, trace.events))) for trace in sorted_traces]


def line_at(inputs: Inputs, at_s: float) -> int:
    """Return the G-code line that the robot is on at a time of its run."""
    row = min(max(int(np.searchsorted(inputs.time_s, at_s)) - 1, 0), len(inputs) - 1)
    return int(inputs.source_line[row])


def rough_spans(traces: Sequence[Trace]) -> dict[str, list[Span]]:
    """Return of each run the times at which a signal is rough or in a pulse, outliers apart."""
    spans: dict[str, list[Span]] = {}
    for trace in traces:
        kept = [each for each in _stretches(trace, _rest(trace)) if not each.is_outlier]
        spans.setdefault(trace.run, []).extend(each.span(trace) for each in kept)
    return spans


# What is rough


def _is_asked(trace: Trace) -> bool:
    """Tell whether a trace has events: what is commanded has no instrument, and poses have no time."""
    return trace.link.has_instrument and not trace.still and len(trace.time_s) >= _LEAST_ROWS


def _rest(trace: Trace) -> Floats:
    """Return what is left (n, k) of a trace beside all that follows its motion and its force.

    A clock that is off, a lag or a play make pulses and steps, too: in step with the command, whatever else.
    """
    if not _is_asked(trace):
        return trace.residual
    inputs, calm = Admissible(trace), trace.residual.copy()
    shared = np.column_stack(
        [
            *(inputs.position_mm, inputs.q_rad, inputs.rate_rad_s, inputs.acceleration_rad_s2),
            *(inputs.velocity_mm_s, inputs.acceleration_mm_s2, inputs.directions, inputs.force_N),
        ]
    )
    # by what changes within moments: a step of the rest is then a few rows that are far off
    now = np.arange(0, len(calm), max(1, len(calm) // _MOST_FITTED))
    later = np.minimum(np.searchsorted(trace.time_s, trace.time_s[now] + _MOMENT_S), len(calm) - 1)
    for j, column in enumerate(trace.columns):
        along = inputs.tool_axes[:, column % 3]
        if trace.link.of_tip:
            along = inputs.jacobian[:, column] * inputs.directions
        columns = np.column_stack([shared, along])
        changes = columns[later] - columns[now]
        scale = np.sqrt(np.mean(changes**2, axis=0))
        used = scale > 1e-9 * np.maximum(np.abs(columns).max(axis=0), 1e-12)
        weights = _fitted(changes[:, used] / scale[used], calm[later, j] - calm[now, j])
        calm[:, j] -= columns[:, used] @ (weights / scale[used])
    return calm


def _fitted(columns: Floats, values: Floats) -> Floats:
    """Return the weights (c,) of columns for values (n,), those far off what they give left out."""
    weights: Floats = np.zeros(columns.shape[1])
    for _ in range(2):
        off = values - columns @ weights - np.median(values - columns @ weights)
        near = np.abs(off) <= _FAR * max(usual_deviation(off), 1e-12)
        x = columns[near]
        gram = x.T @ x + _RIDGE * len(x) * np.eye(x.shape[1])
        weights = np.asarray(np.linalg.solve(gram, x.T @ values[near]), dtype=np.float64)
    return weights


def _stretches(trace: Trace, calm: Floats) -> Iterator[_Stretch]:
    """Yield the rough stretches of a trace whose rest (n, k) is this."""
    if not _is_asked(trace):
        return
    least = np.array([resolution(column) for column in trace.measured.T])
    fewest = OF_ENCODERS if trace.link.of_joints else OF_TABLE
    pulsed = pulse_rows(trace.time_s, calm, least, fewest) & ~_is_edge(trace, calm)
    rough = pulsed | loud_rows(trace.time_s, trace.residual, trace.segments, trace.nominal)
    rows = np.flatnonzero(rough)
    if not len(rows):
        return
    breaks = np.flatnonzero(np.diff(trace.time_s[rows]) > _LIMITS.event_apart_s) + 1
    for part in np.split(rows, breaks):
        first, last = int(part[0]), int(part[-1]) + 1
        yield _Stretch(first, last, bool(pulsed[first:last].any()))


def _is_edge(trace: Trace, calm: Floats) -> Bools:
    """Return the rows (n,) of a force that is off by less than its model changes there: an edge."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    if trace.link.of_joints or trace.link.of_tip:
        return np.zeros(len(calm), dtype=np.bool_)
    around = 2 * int(_MOMENT_S / usual_step_s(trace.time_s)) + 1
    reach = maximum_filter1d(trace.nominal, around, axis=0) - minimum_filter1d(trace.nominal, around, axis=0)
    edge: Bools = np.linalg.norm(calm, axis=1) < np.linalg.norm(reach, axis=1)
    return edge


# What it is in step with


def _in_step(
    traces: Sequence[Trace],
    stretches: Sequence[Sequence[_Stretch]],
    chosen: Sequence[Bools],
    least: int = _LIMITS.in_step_least,
) -> list[list[bool]]:
    """Return which stretches of each trace fall into chosen rows (n,); none where that may be chance."""
    from scipy.special import bdtrc

    inside = [
        [stretch.is_in(rows) for stretch in spans] for spans, rows in zip(stretches, chosen, strict=True)
    ]
    hits = [
        (stretch.is_in(rows), bool(rows[(stretch.first + stretch.last) // 2]), stretch.last - stretch.first)
        for spans, rows in zip(stretches, chosen, strict=True)
        for stretch in spans
        if not stretch.is_outlier
    ]
    # A long stretch touches chosen rows more often than a row is chosen. Where these are rare and short its
    # middle tells more; where it rings on after them, that it touches them.
    touching, middles, lengths = (list(each) for each in zip(*hits, strict=True)) if hits else ([], [], [])
    touched = float(np.mean([_touched(chosen, length) for length in lengths])) if lengths else 1.0
    row_share = float(np.mean(np.concatenate(list(chosen))))
    for counted, share in ((sum(touching), touched), (sum(middles), row_share)):
        chance = bdtrc(counted - 1, len(hits), share) if counted else 1.0
        if counted >= least and chance < _LIMITS.in_step_p:
            return inside
    return [[False] * len(spans) for spans in stretches]


def _touched(chosen: Sequence[Bools], length: int) -> float:
    """Return the share of the stretches of so many rows, anywhere in the traces, that have a chosen row."""
    counts = [np.concatenate([np.zeros(length, dtype=np.int64), np.cumsum(rows)]) for rows in chosen]
    return float(np.mean(np.concatenate([each[length:] > each[:-length] for each in counts])))


def command_changes(trace: Trace) -> Bools:
    """Return the rows (n,) shortly after the command jerks, a joint turns back or the force jumps."""
    inputs, time_s = trace.inputs, trace.inputs.time_s
    rate = np.gradient(inputs.q_cmd_rad, time_s, axis=0)
    acceleration = np.gradient(rate, time_s, axis=0)
    jerk = np.abs(linear(time_s + _JERK_STEP_S, time_s, acceleration) - acceleration)
    largest = np.maximum(jerk.max(axis=0), 1e-12)
    changes = (jerk / largest > _LIMITS.command_share).any(axis=1)
    moving = np.abs(rate) > 1e-3 * np.maximum(np.abs(rate).max(axis=0), 1e-12)
    changes[1:] |= ((np.sign(rate[1:]) * np.sign(rate[:-1]) < 0.0) & moving[1:]).any(axis=1)
    changes |= force_jumps(inputs)
    at_s = np.append(-np.inf, time_s[changes])
    since_s = trace.time_s - at_s[np.searchsorted(at_s, trace.time_s, side="right") - 1]
    before = np.interp(trace.time_s + _LIMITS.same_place_s, time_s, changes.astype(np.float64)) > 0.0
    near: Bools = before | (since_s < _LIMITS.command_lasts_s)
    return near


def _repeated(
    traces: Sequence[Trace],
    rests: Sequence[Floats],
    stretches: Sequence[Sequence[_Stretch]],
    number: int,
) -> list[bool]:
    """Return which stretches of a trace every other run of the same program has too, at the same time.

    Rough ones where the others are rough; pulses also where the others do the same, too small to be pulses.
    """
    trace = traces[number]
    repeats = [i for i, other in enumerate(traces) if i != number and is_repeat(trace, other)]
    if not repeats:
        return [False] * len(stretches[number])
    others = [
        _at(trace, [each.span(traces[i]) for each in stretches[i] if not each.is_outlier]) for i in repeats
    ]
    everywhere = np.all(others, axis=0)
    # where all are rough most of the time that says nothing
    if float(np.mean(everywhere)) > _LIMITS.bursts_most:
        everywhere[:] = False
    again = [linear(trace.time_s, traces[i].time_s, rests[i]) for i in repeats]
    return [
        not stretch.is_outlier and (stretch.is_in(everywhere) or _is_in_all(stretch, rests[number], again))
        for stretch in stretches[number]
    ]


def _is_in_all(stretch: _Stretch, calm: Floats, again: Sequence[Floats]) -> bool:
    """Tell whether a pulse of a rest (n, k) is in all other ones (n, k) by half of its height at least."""
    if not stretch.is_pulse:
        return False
    # between the rows before and behind it, so that a level of each run's own says nothing
    rows = np.arange(max(stretch.first - 1, 0), min(stretch.last + 1, len(calm)))
    share = np.linspace(0.0, 1.0, len(rows))[:, None]
    here, *others = (
        values[rows] - (1.0 - share) * values[rows[0]] - share * values[rows[-1]] for values in (calm, *again)
    )
    return all(float(np.sum(here * each)) > 0.5 * float(np.sum(here**2)) for each in others)


def _at(trace: Trace, spans: Sequence[Span]) -> Bools:
    """Return the rows (n,) of a trace within some times, or near them."""
    rows = np.zeros(len(trace.time_s), dtype=np.bool_)
    for start_s, end_s in spans:
        first, last = np.searchsorted(
            trace.time_s, [start_s - _LIMITS.same_place_s, end_s + _LIMITS.same_place_s]
        )
        rows[first:last] = True
    return rows


# Whose it is


def _sorted(
    levels: "_Levels", stretches: Sequence[_Stretch], stays: Sequence[bool], coincident: Sequence[bool]
) -> Trace:
    trace = levels.trace
    events, out, outliers = [], np.zeros(len(trace.time_s), dtype=np.bool_), 0
    for stretch, in_step, in_both in zip(stretches, stays, coincident, strict=True):
        rows = slice(stretch.first, stretch.last)
        if in_step:
            continue
        if stretch.is_outlier:
            out[rows], outliers = True, outliers + stretch.last - stretch.first
            continue
        change, has_changed = levels.change(stretch)
        whose = Whose.IMPULSE if stretch.is_pulse or in_both else Whose.INSTRUMENT
        whose = Whose.SLIP if has_changed else whose
        event = replace(levels.event(stretch, whose, change), is_shared=in_both)
        # a slip that is no more than its change is what a step's moment is fitted to
        out[rows] = whose is not Whose.SLIP or np.linalg.norm(event.peak) > np.linalg.norm(change)
        events.append(event)
    if not events and not out.any():
        return trace
    words = [f"{outliers} of {len(out)} rows: outliers of the instrument"] if outliers else []
    return replace(
        with_rows(trace, ~out),
        events=(*trace.events, *events),
        left_out=(*trace.left_out, *words),
    )


def _as_burst(event: Event) -> Event:
    return replace(event, whose=Whose.INSTRUMENT) if event.whose is Whose.IMPULSE else event


class _Levels:
    """The level of a trace's rest before and after its stretches."""

    def __init__(self, trace: Trace, calm: Floats) -> None:
        self.trace, self._rest = trace, calm

    def event(self, stretch: _Stretch, whose: Whose, change: Floats) -> Event:
        """Return the event of a stretch; its moment is where the rest changes, weighed by how much."""
        time_s = self.trace.time_s[stretch.first : stretch.last]
        around = 0.5 * (self._level(stretch.first, -1) + self._level(stretch.last, 1))
        off = self._rest[stretch.first : stretch.last] - around
        squares = np.sum(off**2, axis=1)
        at_s = float(time_s[0] + time_s[-1]) / 2.0
        if whose is not Whose.INSTRUMENT:
            rows = slice(max(stretch.first - 1, 0), stretch.last + 1)
            changes = np.sum(np.diff(self._rest[rows], axis=0) ** 2, axis=1)
            between_s = 0.5 * (self.trace.time_s[rows][1:] + self.trace.time_s[rows][:-1])
            at_s = float(changes @ between_s) / max(float(changes.sum()), 1e-300)
        return Event(
            link=self.trace.link.name,
            run=self.trace.run,
            whose=whose,
            span_s=(float(time_s[0]), float(time_s[-1])),
            at_s=at_s,
            line=line_at(self.trace.inputs, at_s),
            peak=off[int(np.argmax(squares))],
            change=change,
            power=float(squares.sum()),
        )

    def change(self, stretch: _Stretch) -> tuple[Floats, bool]:
        """Return by how much the level (k,) changes over a stretch, and whether that stays."""
        change = self._level(stretch.last, 1) - self._level(stretch.first, -1)
        return change, bool(np.any(np.abs(change) > _LIMITS.change_deviations * self._usual))

    @cached_property
    def _usual(self) -> Floats:
        """(k,) robust deviation of the change of the level, anywhere in the run."""
        count = len(self._rest)
        rows = range(count // _LEVELS, count - count // _LEVELS, max(1, count // _LEVELS))
        changes = np.stack([self._level(row + 1, 1) - self._level(row, -1) for row in rows])
        return np.array([usual_deviation(each - np.median(each)) for each in changes.T])

    def _level(self, row: int, way: int) -> Floats:
        """Return the median (k,) of the rows after (1) or before (-1) a row."""
        time_s = self.trace.time_s
        row = min(max(row, 0), len(time_s) - 1)
        end = int(np.searchsorted(time_s, time_s[row] + way * _LIMITS.change_level_s))
        rows = (
            self._rest[row : end + 1] if way > 0 else self._rest[min(end, row - 1) if row else 0 : row or 1]
        )
        return np.median(rows, axis=0)


# Where it jumps

_JUMPS = THRESHOLDS.noise
_SMOOTH = 3
"""Degree of the polynomial that stands for whatever else goes on in a window."""
_ROUNDING = 1e-12
"""Share of a component's power below which a sum of squares is that of rounding errors."""


def strongest_moments(traces: Sequence[Trace], low_s: float, high_s: float) -> tuple[float, ...]:
    """Return the moments of the clearest jumps, in s since the earliest run started, the clearest first."""
    jumps_of_runs = [
        (jump, trace.inputs.hours * S_PER_H + float(trace.time_s[row]), half_s)
        for trace in traces
        for half_s in _JUMPS.jump_halves_s
        for row, jump in _peaks(trace, half_s)
    ]
    moments: list[float] = []
    for _, at_s, half_s in sorted(jumps_of_runs, reverse=True):
        apart = all(abs(at_s - other) > half_s for other in moments)
        if apart and low_s <= at_s <= high_s and len(moments) < _JUMPS.jumps:
            moments.append(at_s)
    return tuple(moments)


def jump_within(trace: Trace, span_s: Span) -> float | None:
    """Return the moment within a span at which a residual jumps most clearly; None where it does not.

    All components jump at once, between two stamps: the middle of these is the moment.
    """
    time_s = trace.time_s
    half = max(3, round(_JUMPS.jump_halves_s[0] / usual_step_s(time_s)))
    first, last = np.searchsorted(time_s, span_s)
    first, last = max(int(first) - half, 0), min(int(last) + half + 1, len(time_s))
    if last - first <= 2 * half:
        return None
    clear = np.sum([jump_clarity(column, half) for column in _without_clock(trace)[first:last].T], axis=0)
    row = first + int(np.argmax(clear))
    return float(time_s[row - 1] + time_s[row]) / 2.0 if clear.max() >= _JUMPS.least_jump else None


def _peaks(trace: Trace, half_s: float) -> list[tuple[int, float]]:
    """Return rows and sizes of the clearest jumps of a trace, not two of them within a window's half."""
    step_s = usual_step_s(trace.time_s)
    half = max(3, round(half_s / step_s))
    if len(trace.time_s) < 2 * half:
        return []
    clear = np.sum([jump_clarity(column, half) for column in _without_clock(trace).T], axis=0)
    peaks: list[tuple[int, float]] = []
    for row in np.argsort(-clear):
        if clear[row] < _JUMPS.least_jump or len(peaks) == _JUMPS.jumps:
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
    from scipy.signal import fftconvolve

    sums: Floats = fftconvolve(values, kernel[::-1], mode="valid")
    return sums
