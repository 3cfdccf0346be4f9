"""Clocks within normal mismatch, run by run: stamps are moved so that what is left of them is linear.

A clock that is 2 ms off leaves a·t²/2, some micrometres at every change of speed, beside its linear
signature; over thousands of samples that is enough to look like something else.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.mismatch import sigma
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.selection import Question, nuisance_for
from gcode2krl.gap.fit.signatures import Signatures

_ROUNDS = 2
_MOST_S = 0.02
_RIDGE = 1e-6


def with_set_clocks(traces: Sequence[Trace], question: Question, known: Signatures) -> list[Trace]:
    """Return the traces with each run's own clock error taken off its stamps; signatures stay as they are.

    What all runs share is kept where it is more than mismatch: it is a cause to be found.
    """
    traces = list(traces)
    if not traces or not traces[0].link.sets_clocks:
        return traces
    nuisance = nuisance_for(traces, question, known)
    total = np.zeros(len(traces))
    current = traces
    for _ in range(_ROUNDS):
        for number, trace in enumerate(current):
            others = [each.columns for each in nuisance[number] if each.name != "clock"]
            clock = [each.columns for each in nuisance[number] if each.name == "clock"]
            if clock:
                share = _coefficient(trace, clock[0], others)
                total[number] += share * sigma(question.mismatch.clock_s) * question.clocks**0.5
        limit = question.mismatch.clock_s * question.clocks
        common = float(np.median(np.clip(total, -_MOST_S, _MOST_S)))
        kept = common if abs(common) > limit else 0.0
        total = kept + np.clip(total - kept, -limit, limit)
        current = [_later(trace, offset - kept) for trace, offset in zip(traces, total.tolist(), strict=True)]
        if kept:
            break
    for before, after in zip(traces, current, strict=True):
        known.same(before, after)
    return current


def _later(trace: Trace, offset_s: float) -> Trace:
    """Return the trace with a clock error taken off: of the load encoders alone, or of the whole table."""
    if trace.link.own_clock:
        return replace(trace, plus_late_s=offset_s)
    return replace(trace, time_s=trace.time_s - offset_s)


def _coefficient(trace: Trace, clock: Floats, others: Sequence[Floats]) -> float:
    """Return the coefficient of the clock's column beside all that other mismatch could explain."""
    k, n, _ = clock.shape
    flat = np.concatenate([clock, *others], axis=2).reshape(k * n, -1)
    scale = np.sqrt(np.sum(flat**2, axis=0))
    good = scale > 0.0
    if not good[0]:
        return 0.0
    flat = flat[:, good] / scale[good]
    gram = flat.T @ flat
    gram[np.diag_indices_from(gram)] += _RIDGE
    found = np.linalg.solve(gram, flat.T @ trace.residual.T.reshape(k * n))
    return float(found[0] / scale[0])
