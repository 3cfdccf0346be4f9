"""Splits: no row of a run is used both to choose or fit an effect and to report on it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.gap.beside.stretches import STRETCH_S
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS

LIMITS = THRESHOLDS.beside


def evenly_spread(traces: Sequence[Trace]) -> list[Trace]:
    """Return the traces of a link, of long runs with the rows of evenly spread windows of time alone.

    What the columns of all effects take in memory and time goes with the rows; what they tell of a cause goes
    with the root of their number. Events are sought in all rows before.
    """
    share = LIMITS.judged_values / max(1, sum(trace.measured.size for trace in traces))
    if share >= 1.0 or any(trace.still for trace in traces):
        return list(traces)
    kept = []
    for trace in traces:
        window = ((trace.time_s - trace.time_s[0]) / LIMITS.judged_window_s).astype(np.int64)
        kept.append(with_rows(trace, np.floor((window + 1) * share) > np.floor(window * share)))
    return kept


def split(traces: Sequence[Trace], explaining: int) -> tuple[list[Trace], list[Trace]]:
    """Return the traces of the runs that explain, and the held-out ones; all explain if none would."""
    explain = [trace for trace in traces if trace.run_number < explaining]
    held = [trace for trace in traces if trace.run_number >= explaining]
    return (explain, held) if explain else (held, [])


def folds_of(traces: Sequence[Trace], power: Sequence[Floats] = ()) -> list[tuple[list[Trace], list[Trace]]]:
    """Return (traces that explain, held-out traces): each run held out in turn, of a single run each quarter.

    ``power`` is the power (n,) of the gap in each row of each trace. Where one run has nearly all of it, the
    others cannot test an explanation; then each quarter of the power is held out in turn.
    """
    sums = [float(each.sum()) for each in power]
    if len(traces) > 1 and not (sums and max(sums) > LIMITS.holdout_nearly_all * sum(sums)):
        return [([trace for trace in traces if trace is not held], [held]) for held in traces]
    weights = list(power) if sum(sums) > 0.0 else [np.ones(len(trace.time_s)) for trace in traces]
    quarters = _quarters(weights)
    folds = (_fold(traces, weights, quarters, held) for held in range(LIMITS.holdout_quarters))
    return [fold for fold in folds if fold is not None]


def _quarters(weights: Sequence[Floats]) -> list[Ints]:
    """Return the quarter (n,) of the power that each row belongs to, in the order of the traces."""
    total = sum(float(weight.sum()) for weight in weights)
    rows = sum(len(weight) for weight in weights)
    # a little for every row, so that rows without power belong to a quarter too
    evenly, before, quarters = LIMITS.holdout_evenly, 0.0, []
    for weight in weights:
        share = before + np.cumsum(weight / total + evenly / rows) / (1.0 + evenly)
        before = float(share[-1]) if len(share) else before
        last = LIMITS.holdout_quarters - 1
        quarters.append(np.minimum((LIMITS.holdout_quarters * share).astype(np.int64), last))
    return quarters


def _fold(
    traces: Sequence[Trace], weights: Sequence[Floats], quarters: Sequence[Ints], quarter: int
) -> tuple[list[Trace], list[Trace]] | None:
    """Return the traces without a quarter and its guards, and that quarter; None where too little is left."""
    kept, held, power_kept = [], [], 0.0
    for trace, weight, of_row in zip(traces, weights, quarters, strict=True):
        inside = of_row == quarter
        guarded = _with_guards(trace.time_s, inside)
        held.append(with_rows(trace, inside))
        kept.append(with_rows(trace, ~guarded))
        power_kept += float(weight[~guarded].sum())
    if power_kept < LIMITS.holdout_least_seen * sum(float(weight.sum()) for weight in weights):
        return None
    kept = [trace for trace in kept if len(trace.time_s) >= LIMITS.holdout_least_kept]
    held = [trace for trace in held if len(trace.time_s) >= LIMITS.holdout_least_held]
    return (kept, held) if kept and held else None


def _with_guards(time_s: Floats, inside: Bools) -> Bools:
    """Return the rows (n,) within the guard of the chosen ones, which are one stretch."""
    if not inside.any():
        return inside
    first, last = time_s[inside][[0, -1]]
    guarded: Bools = (time_s >= first - STRETCH_S) & (time_s <= last + STRETCH_S)
    return guarded


def with_rows(trace: Trace, chosen: Bools) -> Trace:
    """Return a trace with some of its rows; a segment ends where rows are left out."""
    rows = np.flatnonzero(chosen)
    owner = np.zeros(len(chosen), dtype=np.int64)
    for number, (first, last) in enumerate(trace.segments):
        owner[first:last] = number
    breaks = np.flatnonzero((np.diff(rows) > 1) | (np.diff(owner[rows]) > 0)) + 1
    edges = np.concatenate([[0], breaks, [len(rows)]]).astype(np.int64)
    segments = np.stack([edges[:-1], edges[1:]], axis=1)
    return replace(trace, time_s=trace.time_s[rows], measured=trace.measured[rows], segments=segments)
