"""Clocks, before every other effect: by how much each table's time stamps are off the prediction's.

``offset_s`` > 0: the samples are older than their stamp, signal(t) = true(t - offset_s).
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.beside.interpolation import cubic
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs import Controller, Measured
from gcode2krl.runs.matching import best_shift

if TYPE_CHECKING:
    from gcode2krl.gap.beside.links.base import Link

LIMITS = THRESHOLDS.beside


def fitted_offset(trace: Trace, most_s: float = LIMITS.clock_fit_most_s) -> tuple[float, float]:
    """Return the offset of a trace's clock and its standard deviation, by least squares on the model's rate.

    A constant difference of each component is fitted along: a frame or an encoder zero is no clock.
    """
    offset, rate, r = 0.0, trace.rate, trace.residual
    for _ in range(LIMITS.clock_steps):
        r = trace.measured - _shifted(trace, offset)
        centred_rate, centred = rate - rate.mean(axis=0), r - r.mean(axis=0)
        power = float(np.sum(centred_rate**2))
        if power <= 0.0:
            return 0.0, np.inf
        step = -float(np.sum(centred_rate * centred)) / power
        offset = float(np.clip(offset + step, -most_s, most_s))
        if abs(step) < LIMITS.clock_settled_s:
            break
    return offset, float(np.sqrt(np.mean((r - r.mean(axis=0)) ** 2) / max(power, 1e-30)))


def _shifted(trace: Trace, offset_s: float) -> Floats:
    return replace(trace, time_s=trace.time_s - offset_s).nominal


def with_table_clock(pair: Pair, link: "Link") -> Pair:
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


def with_controller_clocks(context: Context, path: "Link") -> Context:
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

    left = [trace.residual for trace in path.traces(later(0.0))]
    if not left or float(np.sqrt(np.mean(np.concatenate(left) ** 2))) >= path.model_rms:
        return context
    return replace(context.with_pairs(later(kept_s)), clocks_set=True)


def coarse_offset(pair: Pair, table: Measured) -> float:
    """Return the offset of a table of up to 10 s by how its motion follows the prediction; 0 where small."""
    inputs = pair.inputs
    if isinstance(table, Controller):
        path_rad = table.path_rad
        if path_rad is None:
            return 0.0
        known = np.isfinite(path_rad).all(axis=0)
        measured, predicted = path_rad[:, known], inputs.q_cmd_rad[:, known]
    else:
        position: Floats | None = getattr(table, "position_mm", None)
        if position is None:
            return 0.0
        measured, predicted = position, inputs.position_mm
    if measured.shape[1] == 0 or float(np.ptp(predicted, axis=0).max()) == 0.0:
        return 0.0
    shift = best_shift(inputs.time_s, predicted, table.time_s, measured, LIMITS.clock_reach_s)
    here = _apart(predicted, measured, table.time_s, inputs.time_s, 0.0)
    there = _apart(predicted, measured, table.time_s, inputs.time_s, shift.seconds)
    constant = there < LIMITS.clock_left * here or there < LIMITS.clock_nothing * float(
        np.sum(np.var(measured, axis=0))
    )
    return (
        shift.seconds
        if abs(shift.seconds) > LIMITS.clock_large_s and shift.share >= LIMITS.clock_follows and constant
        else 0.0
    )


def _apart(predicted: Floats, measured: Floats, own_s: Floats, time_s: Floats, offset_s: float) -> float:
    """Return the mean square between both, where they overlap, each less its mean."""
    inside = (own_s - offset_s >= time_s[0]) & (own_s - offset_s <= time_s[-1])
    if np.count_nonzero(inside) < LIMITS.clock_least_rows:
        return np.inf
    wanted = cubic(own_s[inside] - offset_s, time_s, predicted)
    apart = measured[inside] - wanted
    return float(np.sum(np.var(apart, axis=0)))
