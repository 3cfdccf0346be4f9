"""The run's own timing: the prediction's samples get the times at which the run was there.

Links behind the path are then compared at the same place, whatever the controller's time law does.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.timing import late_s
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from gcode2krl.gap.beside.links.base import Link

LIMITS = THRESHOLDS.beside


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
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path_rad, axis=0), axis=1))])
    wanted = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(inputs.q_cmd_rad, axis=0), axis=1))])
    if (
        travelled[-1] <= 0.0
        or wanted[-1] <= 0.0
        or abs(travelled[-1] / wanted[-1] - 1.0) > LIMITS.retime_same_length
    ):
        return pair
    # a rest takes time and no way: a little way for every second keeps the times in order
    along = wanted * (travelled[-1] / wanted[-1]) + LIMITS.retime_still * inputs.time_s
    time_s = np.interp(along, travelled + LIMITS.retime_still * own_s, own_s)
    return _at_times(pair, time_s)


def refined(pair: Pair, path: "Link") -> Pair:
    """Return the pair with its times moved by the lateness of the run, up to some hundredths of a second.

    The lateness comes from the commanded joints along the motion and is interpolated over rests.
    """
    for _ in range(LIMITS.retime_rounds):
        traces = path.traces([pair])
        if not traces or traces[0].shape[1] < 6:
            return pair
        trace = traces[0]
        late, moves = late_s(trace, trace.residual)
        if (
            np.count_nonzero(moves) < LIMITS.retime_smooth_rows
            or float(np.abs(late[moves]).max()) < LIMITS.retime_negligible_s
        ):
            return pair
        if float(np.quantile(np.abs(late[moves]), 0.95)) > LIMITS.retime_far_s:
            return pair
        kernel = np.ones(LIMITS.retime_smooth_rows) / LIMITS.retime_smooth_rows
        padded = np.pad(
            np.clip(late[moves], -LIMITS.retime_far_s, LIMITS.retime_far_s),
            LIMITS.retime_smooth_rows // 2,
            mode="edge",
        )
        smooth = np.convolve(padded, kernel, mode="valid")
        now = pair.inputs.time_s
        pair = _at_times(pair, now + np.interp(now, trace.time_s[moves], smooth))
    return pair


def on_own_timing(pair: Pair, servo: "Link") -> Pair:
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
        if again or largest_s < LIMITS.clock_large_s:
            return pair
        pair = refined(retimed(pair) if largest_s > LIMITS.retime_far_s else pair, servo)
    return pair


def _median_offset_s(trace: Trace) -> float:
    """Return by how much the joints are late, as the median of what each of them shows alone."""
    offset_s = 0.0
    for _ in range(LIMITS.clock_steps):
        on_time = replace(trace, time_s=trace.time_s - offset_s)
        rate = on_time.rate - on_time.rate.mean(axis=0)
        power = np.sum(rate**2, axis=0)
        moves = power > LIMITS.timing_slow**2 * float(power.max(initial=0.0))
        if not moves.any():
            return offset_s
        residual = on_time.residual - on_time.residual.mean(axis=0)
        offset_s -= float(np.median(np.sum(rate * residual, axis=0)[moves] / power[moves]))
    return offset_s


def _at_times(pair: Pair, time_s: Floats) -> Pair:
    """Return the pair with other times of its samples; their order is kept."""
    inputs = pair.inputs
    least = 0.01 * float(np.median(np.diff(inputs.time_s)))
    steps = np.maximum(np.diff(time_s), least)
    time_s = time_s[0] + np.concatenate([[0.0], np.cumsum(steps)])
    motion = None if inputs.motion is None else replace(inputs.motion, time_s=time_s)
    return replace(pair, inputs=replace(inputs, time_s=time_s, motion=motion))
