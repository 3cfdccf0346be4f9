"""The tangential part of the path link, as time: by how much the run is late at each place."""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied
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
