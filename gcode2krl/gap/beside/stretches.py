"""Stretches of time: rows of one stretch share the errors of a model and stay together in every split."""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Ints
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS

STRETCH_S = THRESHOLDS.beside.stretch_s


def stretches_of(trace: Trace) -> Ints:
    """Return the number (n,) of the stretch of time each row of a trace belongs to.

    Of a long run they are longer, so that what is kept of each does not grow with it.
    """
    since_s = trace.time_s - trace.inputs.time_s[0]
    longest_s = (float(since_s[-1]) + 1e-6) / THRESHOLDS.beside.stretches_most
    lasts_s = max(STRETCH_S, longest_s)
    number: Ints = (since_s / lasts_s).astype(np.int64)
    return number


def stretches_of_all(traces: Sequence[Trace]) -> Ints:
    """Return the number of the stretch of each value of all traces, component after component.

    No two runs have a number in common, however long they are.
    """
    numbers, first = [], 0
    for trace in traces:
        number = stretches_of(trace)
        number -= number.min(initial=0)  # a table may begin before its model
        numbers.append(np.tile(first + number, trace.shape[1]))
        first += int(number.max(initial=-1)) + 1
    return np.concatenate(numbers)
