"""The tangential part of the path link, as time: by how much the run is late at each place.

**Residual of first order.** A run that is late by seconds is elsewhere, and measured less model says nothing
of why. At the time at which it reaches the model's place, late by L, it is off that place by d: -q'·L + d is
what a lateness of L and a path beside the planned one would do to the signal if both were small. It is linear
in both, however late the run is; an error of the place along the path cancels out.
"""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects import Applied
from gcode2krl.gap.beside.interpolation import cubic, values_of
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS

LIMITS = THRESHOLDS.beside


def late_s(trace: Trace, residual: Floats) -> tuple[Floats, Bools]:
    """Return how late the run is (n,) in s, and where it moves fast enough to tell."""
    power = np.sum(trace.rate**2, axis=1)
    moves = power > (LIMITS.timing_slow**2) * float(np.mean(power))
    late = np.zeros(len(power))
    late[moves] = -np.sum(trace.rate[moves] * residual[moves], axis=1) / power[moves]
    return late, moves


def timing_share(traces: Sequence[Trace]) -> float:
    """Return the share of the path residual's power that lies along the motion."""
    along, total = 0.0, 0.0
    for trace in traces:
        late, moves = late_s(trace, trace.residual)
        along += float(np.sum((late[moves, None] * trace.rate[moves]) ** 2))
        total += float(np.sum(trace.residual**2))
    return along / total if total > 0.0 else 0.0


def timing_sizes(traces: Sequence[Trace], applied: Sequence[Applied]) -> tuple[float, float]:
    """Return the rms (s) by which runs are late, without and with effects."""
    return _rms(traces, ()), _rms(traces, applied) if applied else _rms(traces, ())


def _rms(traces: Sequence[Trace], applied: Sequence[Applied]) -> float:
    values = []
    for trace in traces:
        late, moves = late_s(trace, trace.measured - trace.sample(applied))
        values.append(late[moves])
    every = np.concatenate(values)
    return float(np.sqrt(np.mean(every**2))) if len(every) else 0.0


def residual_by_place(trace: Trace, applied: Sequence[Applied]) -> Floats:
    """Return measured less model (n, k) to first order in the lateness, at the times of the model.

    The plain difference where no lateness is far beyond a cycle, where the signal does not tell time, or
    where the two are hardly nearer at the same place than at the same time.
    """
    model = trace.sample(applied)
    plain: Floats = trace.measured - model
    if not trace.link.tells_time or trace.still:
        return plain
    measured_s, measured_way = gone(trace.time_s, trace.measured, trace.link.least_step)
    signals = trace.signals(applied)
    way = gone(signals.time_s, values_of(signals, trace.plus)[:, list(trace.columns)], 0.0)[1]
    times = signals.true_time(trace.plus, trace.time_s - trace.plus_late_s)
    along = np.interp(times, signals.time_s, way)
    at_s = np.interp(along, measured_way, measured_s)
    step = 0.5 * float(np.median(np.diff(signals.time_s)))
    rate = (trace.at(signals, trace.time_s + step) - trace.at(signals, trace.time_s - step)) / (2.0 * step)
    late = at_s - trace.time_s
    power = np.sum(rate**2, axis=1)
    moves = (power > LIMITS.timing_slow**2 * float(np.mean(power))) & (along < measured_way[-1])
    if not moves.any() or float(np.abs(late[moves]).max()) < LIMITS.retime_far_s:
        return plain
    beside = cubic(at_s, trace.time_s, trace.measured) - model
    if np.sum(beside[moves] ** 2) > LIMITS.same_path_share**2 * np.sum(plain[moves] ** 2):
        return plain
    # over rests, and where the rows end before the path does, it is as late as before
    late = np.interp(trace.time_s, trace.time_s[moves], late[moves])
    first_order: Floats = np.where(moves[:, None], beside, 0.0) - rate * late[:, None]
    return first_order


def gone(time_s: Floats, values: Floats, least: float) -> tuple[Floats, Floats]:
    """Return times and how far the signal has gone by them; ways below ``least`` count once they add up."""
    kept = _anchors(values, least) if least > 0.0 else slice(None)
    time_s, values = time_s[kept], values[kept]
    return time_s, np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(values, axis=0), axis=1))])


def _anchors(values: Floats, least: float) -> Ints:
    """Return the rows that are at least so far from the kept row before them."""
    kept, last = [0], values[0]
    for row in range(1, len(values)):
        way = values[row] - last
        if float(way @ way) >= least * least:
            kept.append(row)
            last = values[row]
    return np.array(kept)
