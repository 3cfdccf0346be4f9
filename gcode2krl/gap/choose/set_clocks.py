"""Clocks within normal mismatch, run by run: stamps are moved so that what is left of them is linear.

A clock that is 2 ms off leaves a·t²/2, some micrometres at every change of speed, beside its linear
signature; over thousands of samples that is enough to look like something else.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.mismatch import sigma
from gcode2krl.gap.beside.instruments import CLOCK
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.design import Question, nuisance_for
from gcode2krl.gap.fit.nuisance import Nuisance
from gcode2krl.gap.fit.signatures import Signatures
from gcode2krl.gap.thresholds import THRESHOLDS

_MOST_S = THRESHOLDS.choose.clock_most_s
_ROUNDS = 2
"""The second takes off what the first leaves of its own linearisation."""
_RIDGE = 1e-6
"""Keeps columns apart that are equal to rounding; of unit length each."""


def with_set_clocks(traces: Sequence[Trace], question: Question, known: Signatures) -> list[Trace]:
    """Return the traces with each run's own clock error taken off its stamps; signatures stay as they are.

    What all runs share is kept where it is more than mismatch: it is a cause to be found.
    """
    traces = list(traces)
    if not traces or not traces[0].link.sets_clocks:
        return traces
    nuisance = nuisance_for(traces, question, known)
    limit_s = question.mismatch.clock_s * question.clocks
    unit_s = sigma(question.mismatch.clock_s) * question.clocks**0.5
    offsets_s = np.zeros(len(traces))
    current = traces
    for _ in range(_ROUNDS):
        offsets_s += [unit_s * _clock_of(trace, own) for trace, own in zip(current, nuisance, strict=True)]
        common_s = float(np.median(np.clip(offsets_s, -_MOST_S, _MOST_S)))
        kept_s = common_s if abs(common_s) > limit_s else 0.0
        offsets_s = kept_s + np.clip(offsets_s - kept_s, -limit_s, limit_s)
        moves_s = (offsets_s - kept_s).tolist()
        current = [_later(trace, move_s) for trace, move_s in zip(traces, moves_s, strict=True)]
        if kept_s:
            break
    for before, after in zip(traces, current, strict=True):
        known.same(before, after)
    return current


def _clock_of(trace: Trace, nuisance: Sequence[Nuisance]) -> float:
    """Return the coefficient of a trace's clock beside its other nuisance; 0 where it has none."""
    others = [each.columns for each in nuisance if each.name != CLOCK]
    clock = [each.columns for each in nuisance if each.name == CLOCK]
    return _coefficient(trace, clock[0], others) if clock else 0.0


def _later(trace: Trace, offset_s: float) -> Trace:
    """Return the trace with a clock error taken off: of the load encoders alone, or of the whole table."""
    if trace.link.own_clock:
        return replace(trace, plus_late_s=offset_s, clock_set_s=offset_s)
    return replace(trace, time_s=trace.time_s - offset_s, clock_set_s=offset_s)


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
    coefficients = np.linalg.solve(gram, flat.T @ trace.residual.T.reshape(k * n))
    return float(coefficients[0] / scale[0])
