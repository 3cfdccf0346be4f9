"""Splits: a run, or a stretch of one, is never used both to choose or fit an effect and to report on it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.gap.beside.trace import Trace

STRETCH_S = 1.0
"""Longer than an instrument remembers; rows of one stretch are kept together in every split."""
_GUARD_S = STRETCH_S
_QUARTERS = 4
_NEARLY_ALL, _EVENLY = 0.75, 0.2
_LEAST_KEPT, _LEAST_HELD = 30, 10
_LEAST_SEEN = 0.1
"""Stretches with less than this of the power that a gap has cannot tell of it, held out or not."""


def split(traces: Sequence[Trace], explaining: int) -> tuple[list[Trace], list[Trace]]:
    """Return the traces of the runs that explain, and the held-out ones; all explain if none would."""
    explain = [trace for trace in traces if trace.run_number < explaining]
    held = [trace for trace in traces if trace.run_number >= explaining]
    return (explain, held) if explain else (held, [])


def folds_of(traces: Sequence[Trace], power: Sequence[Floats] = ()) -> list[tuple[list[Trace], list[Trace]]]:
    """Return (to explain, held out) pairs: whole runs by turns; of a single run quarters with guard gaps.

    ``power``: what a gap has in each row of each trace. Where one run has nearly all of it the others cannot
    tell of it, and what has a quarter of the power is held out by turns.
    """
    sums = [float(each.sum()) for each in power]
    if len(traces) > 1 and not (sums and max(sums) > _NEARLY_ALL * sum(sums)):
        return [([trace for trace in traces if trace is not held], [held]) for held in traces]
    weights = list(power) if sum(sums) > 0.0 else [np.ones(len(trace.time_s)) for trace in traces]
    # a little for every row, so that rows without power belong somewhere too
    total = sum(float(each.sum()) for each in weights)
    rows = sum(len(each) for each in weights)
    gone, found = 0.0, []
    quarters = []
    for each in weights:
        share = gone + np.cumsum(each / total + _EVENLY / rows) / (1.0 + _EVENLY)
        gone = float(share[-1]) if len(share) else gone
        quarters.append(np.minimum((_QUARTERS * share).astype(int), _QUARTERS - 1))
    for quarter in range(_QUARTERS):
        kept, held, seen = [], [], 0.0
        for trace, own, each in zip(traces, quarters, weights, strict=True):
            mine = own == quarter
            near = _near(trace.time_s, mine)
            held.append(with_rows(trace, mine))
            kept.append(with_rows(trace, ~near))
            seen += float(each[~near].sum())
        if seen < _LEAST_SEEN * total:
            continue
        kept = [trace for trace in kept if len(trace.time_s) >= _LEAST_KEPT]
        held = [trace for trace in held if len(trace.time_s) >= _LEAST_HELD]
        if kept and held:
            found.append((kept, held))
    return found


def _near(time_s: Floats, mine: Bools) -> Bools:
    """Return the rows within the guard of the held ones, which are one stretch."""
    if not mine.any():
        return mine
    first, last = time_s[mine][[0, -1]]
    near: Bools = (time_s >= first - _GUARD_S) & (time_s <= last + _GUARD_S)
    return near


def with_rows(trace: Trace, chosen: Bools) -> Trace:
    """Return a trace with some of its rows; what is left out makes a gap."""
    rows = np.flatnonzero(chosen)
    owner = np.zeros(len(chosen), dtype=np.int64)
    for number, (first, last) in enumerate(trace.segments):
        owner[first:last] = number
    breaks = np.flatnonzero((np.diff(rows) > 1) | (np.diff(owner[rows]) > 0)) + 1
    edges = np.concatenate([[0], breaks, [len(rows)]]).astype(np.int64)
    segments = np.stack([edges[:-1], edges[1:]], axis=1)
    return replace(trace, time_s=trace.time_s[rows], measured=trace.measured[rows], segments=segments)
