"""Clocks and time laws: when a run was at each place of its path, before every other effect.

``offset_s`` > 0: the samples are older than their stamp, signal(t) = true(t - offset_s).

**Residual of first order.** A run that is late by seconds is elsewhere, and measured less model says nothing
of why. At the time at which it reaches the model's place, late by L, it is off that place by d: -q'·L + d is
what a lateness of L and a path beside the planned one would do to the signal if both were small. It is linear
in both, however late the run is; an error of the place along the path cancels out.

**Retiming.** The prediction's samples get the times at which the run was there. Links behind the path are
then compared at the same place, whatever the controller's time law does.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects import Applied
from gcode2krl.gap.compare.interpolation import cubic, length_along, rms, usual_step_s, values_of
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.trace import Context, Link, Trace
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs import Controller, Tracker
from gcode2krl.runs.matching import best_shift

_LIMITS = THRESHOLDS.compare


def late_s(trace: Trace, residual: Floats) -> tuple[Floats, Bools]:
    """Return how late the run is (n,) in s, and where it moves fast enough to tell."""
    power = np.sum(trace.rate**2, axis=1)
    moves = power > (_LIMITS.timing_slow**2) * float(np.mean(power))
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
    return rms(np.concatenate(values)) if any(map(len, values)) else 0.0


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
    step = 0.5 * usual_step_s(signals.time_s)
    rate = (trace.at(signals, trace.time_s + step) - trace.at(signals, trace.time_s - step)) / (2.0 * step)
    late = at_s - trace.time_s
    power = np.sum(rate**2, axis=1)
    moves = (power > _LIMITS.timing_slow**2 * float(np.mean(power))) & (along < measured_way[-1])
    if not moves.any() or float(np.abs(late[moves]).max()) < _LIMITS.retime_far_s:
        return plain
    off = cubic(at_s, trace.time_s, trace.measured) - model
    if np.sum(off[moves] ** 2) > _LIMITS.same_path_share**2 * np.sum(plain[moves] ** 2):
        return plain
    # over rests, and where the rows end before the path does, it is as late as before
    late = np.interp(trace.time_s, trace.time_s[moves], late[moves])
    first_order: Floats = np.where(moves[:, None], off, 0.0) - rate * late[:, None]
    return first_order


def gone(time_s: Floats, values: Floats, least: float) -> tuple[Floats, Floats]:
    """Return times and how far the signal has gone by them; ways below ``least`` count once they add up."""
    kept = _anchors(values, least) if least > 0.0 else slice(None)
    time_s, values = time_s[kept], values[kept]
    return time_s, length_along(values)


def _anchors(values: Floats, least: float) -> Ints:
    """Return the rows that are at least so far from the kept row before them."""
    kept, last = [0], values[0]
    for row in range(1, len(values)):
        way = values[row] - last
        if float(way @ way) >= least * least:
            kept.append(row)
            last = values[row]
    return np.array(kept)


def fitted_offset(trace: Trace, most_s: float = _LIMITS.clock_fit_most_s) -> tuple[float, float]:
    """Return the offset of a trace's clock and its standard deviation, by least squares on the model's rate.

    A constant difference of each component is fitted along: a frame or an encoder zero is no clock.
    """
    offset, rate, r = 0.0, trace.rate, trace.residual
    for _ in range(_LIMITS.clock_steps):
        r = trace.measured - _shifted(trace, offset)
        centred_rate, centred = rate - rate.mean(axis=0), r - r.mean(axis=0)
        power = float(np.sum(centred_rate**2))
        if power <= 0.0:
            return 0.0, np.inf
        step = -float(np.sum(centred_rate * centred)) / power
        offset = float(np.clip(offset + step, -most_s, most_s))
        if abs(step) < _LIMITS.clock_settled_s:
            break
    return offset, float(np.sqrt(np.mean((r - r.mean(axis=0)) ** 2) / max(power, 1e-30)))


def _shifted(trace: Trace, offset_s: float) -> Floats:
    return replace(trace, time_s=trace.time_s - offset_s).nominal


def with_table_clock(pair: Pair, link: Link) -> Pair:
    """Return the pair with the clock of a link's table set as its trace fits best."""
    traces = link.traces([pair])
    if not traces:
        return pair
    offset_s, deviation_s = fitted_offset(traces[0])
    return pair.later(link.table, offset_s) if np.isfinite(deviation_s) else pair


def with_coarse_clocks(pair: Pair) -> Pair:
    """Return the pair with large clock errors taken off its tables; as it is for a log alone."""
    if pair.from_log:
        return pair
    tables = [table for table in (pair.run.controller, pair.run.tracker) if table is not None]
    offsets = {type(table).__name__.lower(): coarse_offset(pair, table) for table in tables}
    return replace(pair, clock_s={name: offset for name, offset in offsets.items() if offset != 0.0})


def with_controller_clocks(context: Context, path: Link) -> Context:
    """Return the context with the controllers' clocks set run by run, where runs keep to the plan's times.

    What is common to all of them stays where it is a finding. Where runs do not keep to the plan, their
    clocks are fitted along with the time law.
    """
    offsets = []
    for pair in context.pairs:
        traces = path.traces([pair])
        offset_s, deviation_s = fitted_offset(traces[0]) if traces else (0.0, np.inf)
        offsets.append(offset_s if np.isfinite(deviation_s) else 0.0)
    common_s = float(np.median(offsets)) if offsets else 0.0
    kept_s = common_s if abs(common_s) > context.mismatch.clock_s else 0.0

    def later(by_s: float) -> list[Pair]:
        return [
            pair.later(path.table, offset_s - by_s)
            for pair, offset_s in zip(context.pairs, offsets, strict=True)
        ]

    residuals = [trace.residual for trace in path.traces(later(0.0))]
    if not residuals or rms(np.concatenate(residuals)) >= path.model_rms:
        return context
    return replace(context.with_pairs(later(kept_s)), clocks_set=True)


def coarse_offset(pair: Pair, table: Controller | Tracker) -> float:
    """Return the offset of a table of up to 10 s by how its motion follows the prediction; 0 where small."""
    inputs = pair.inputs
    if isinstance(table, Controller):
        path_rad = table.path_rad
        if path_rad is None:
            return 0.0
        known = np.isfinite(path_rad).all(axis=0)
        measured, predicted = path_rad[:, known], inputs.q_cmd_rad[:, known]
    else:
        measured, predicted = table.position_mm, inputs.position_mm
    if measured.shape[1] == 0 or float(np.ptp(predicted, axis=0).max()) == 0.0:
        return 0.0
    shift = best_shift(inputs.time_s, predicted, table.time_s, measured, _LIMITS.clock_reach_s)
    here = _apart(predicted, measured, table.time_s, inputs.time_s, 0.0)
    there = _apart(predicted, measured, table.time_s, inputs.time_s, shift.seconds)
    power = float(np.sum(np.var(measured, axis=0)))
    is_constant = there < _LIMITS.clock_left * here or there < _LIMITS.clock_nothing * power
    is_large = abs(shift.seconds) > _LIMITS.clock_large_s and shift.share >= _LIMITS.clock_follows
    return shift.seconds if is_large and is_constant else 0.0


def _apart(predicted: Floats, measured: Floats, own_s: Floats, time_s: Floats, offset_s: float) -> float:
    """Return the mean square between both, where they overlap, each less its mean."""
    inside = (own_s - offset_s >= time_s[0]) & (own_s - offset_s <= time_s[-1])
    if np.count_nonzero(inside) < _LIMITS.clock_least_rows:
        return np.inf
    wanted = cubic(own_s[inside] - offset_s, time_s, predicted)
    apart = measured[inside] - wanted
    return float(np.sum(np.var(apart, axis=0)))


def retimed(pair: Pair) -> Pair:
    """Return the pair on the run's own time, by how far the commanded joints have come.

    The commanded joints at a place are then compared with those predicted for that place. Two paths whose
    lengths differ by more than 2 % are not the same path: the pair is returned unchanged.
    """
    table = pair.run.controller
    path_rad = None if table is None else table.path_rad
    if table is None or path_rad is None or not np.isfinite(path_rad).all():
        return pair
    inputs, own_s = pair.inputs, pair.stamps(table)
    travelled = length_along(path_rad)
    wanted = length_along(inputs.q_cmd_rad)
    ratio = travelled[-1] / wanted[-1] if wanted[-1] > 0.0 else 0.0
    if ratio == 0.0 or abs(ratio - 1.0) > _LIMITS.retime_same_length:
        return pair
    # a rest takes time and no way: a little way for every second keeps the times in order
    along = wanted * ratio + _LIMITS.retime_still * inputs.time_s
    time_s = np.interp(along, travelled + _LIMITS.retime_still * own_s, own_s)
    return _at_times(pair, time_s)


def refined(pair: Pair, path: Link) -> Pair:
    """Return the pair with its times moved by the lateness of the run, up to some hundredths of a second.

    The lateness comes from the commanded joints along the motion and is interpolated over rests.
    """
    from scipy.ndimage import uniform_filter1d

    for _ in range(_LIMITS.retime_rounds):
        traces = path.traces([pair])
        if not traces or traces[0].shape[1] < 6:
            return pair
        trace = traces[0]
        late, moves = late_s(trace, trace.residual)
        if np.count_nonzero(moves) < _LIMITS.retime_smooth_rows:
            return pair
        sizes_s = np.abs(late[moves])
        if sizes_s.max() < _LIMITS.retime_negligible_s or np.quantile(sizes_s, 0.95) > _LIMITS.retime_far_s:
            return pair
        near = np.clip(late[moves], -_LIMITS.retime_far_s, _LIMITS.retime_far_s)
        smooth = uniform_filter1d(near, _LIMITS.retime_smooth_rows, mode="nearest")
        now = pair.inputs.time_s
        pair = _at_times(pair, now + np.interp(now, trace.time_s[moves], smooth))
    return pair


def on_own_timing(pair: Pair, servo: Link) -> Pair:
    """Return a pair of actual joints alone on the run's own timing; others as they are.

    A constant offset is the clock's: the median of those of the joints, so that the lag of one axis stays.
    Only lateness beyond what drives have is taken for timing.
    """
    if not pair.has_actual_joints_alone:
        return pair
    for again in (False, True):
        traces = servo.traces([pair])
        if not traces:
            return pair
        pair = pair.later(servo.table, _median_offset_s(traces[0]))
        traces = servo.traces([pair])
        late, moves = late_s(traces[0], traces[0].residual)
        largest_s = float(np.quantile(np.abs(late[moves]), 0.95)) if moves.any() else 0.0
        if again or largest_s < _LIMITS.clock_large_s:
            return pair
        pair = refined(retimed(pair) if largest_s > _LIMITS.retime_far_s else pair, servo)
    return pair


def _median_offset_s(trace: Trace) -> float:
    """Return by how much the joints are late, as the median of what each of them shows alone."""
    offset_s = 0.0
    for _ in range(_LIMITS.clock_steps):
        on_time = replace(trace, time_s=trace.time_s - offset_s)
        rate = on_time.rate - on_time.rate.mean(axis=0)
        power = np.sum(rate**2, axis=0)
        moves = power > _LIMITS.timing_slow**2 * float(power.max(initial=0.0))
        if not moves.any():
            return offset_s
        residual = on_time.residual - on_time.residual.mean(axis=0)
        offset_s -= float(np.median(np.sum(rate * residual, axis=0)[moves] / power[moves]))
    return offset_s


def _at_times(pair: Pair, time_s: Floats) -> Pair:
    """Return the pair with other times of its samples; their order is kept."""
    inputs = pair.inputs
    least = 0.01 * usual_step_s(inputs.time_s)
    steps = np.maximum(np.diff(time_s), least)
    time_s = time_s[0] + np.concatenate([[0.0], np.cumsum(steps)])
    motion = None if inputs.motion is None else replace(inputs.motion, time_s=time_s)
    return replace(pair, inputs=replace(inputs, time_s=time_s, motion=motion))
