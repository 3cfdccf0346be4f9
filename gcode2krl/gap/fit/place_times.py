"""The times at which a run reaches each place of its path: data from which a time law is fitted.

Least squares on a signal that is late by a second have a minimum at each stop. The time at which a place is
reached is nearly proportional to the numbers of the law instead.
"""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.beside.interpolation import values_of
from gcode2krl.gap.beside.timing import gone
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.fitted import Numbers
from gcode2krl.gap.fit.least_squares import Shortened, gauss_newton

_PLACES = 400
"""Of a run, at equal ways."""
_STEPS = 8
_STEP_SHARE = 0.1
"""Of a typical size: a controller's times are whole cycles, and smaller differences are none."""
_SETTLED_SHARE = 0.98
"""A step that leaves more of the rms ends the fit: a refit on the signals follows."""


class PlaceTimes:
    """The measured times at which runs reach places, to be compared with those of plans."""

    def __init__(self, traces: Sequence[Trace]) -> None:
        self.traces = list(traces)
        self.measured = [gone(trace.time_s, trace.measured, trace.link.least_step) for trace in traces]

    def late(self, applied: Sequence[Applied]) -> Floats:
        """Return how late (runs · places,) the runs are beside a plan with these effects, in s.

        Of each run its mean, which is its clock's, is taken off.
        """
        late = []
        for trace, (measured_s, measured_way) in zip(self.traces, self.measured, strict=True):
            signals = trace.signals(applied)
            values = values_of(signals, trace.plus)
            time_s, way = gone(signals.time_s, values[:, list(trace.columns)], 0.0)
            at = measured_way[-1] * (np.arange(_PLACES) + 0.5) / _PLACES
            behind = np.interp(at, measured_way, measured_s) - np.interp(at, way, time_s)
            late.append(behind - behind.mean())
        return np.concatenate(late)

    def size(self, applied: Sequence[Applied]) -> float:
        """Return the rms by which runs are late beside a plan, in s; infinite where there is none."""
        try:
            return float(np.sqrt(np.mean(self.late(applied) ** 2)))
        except Gcode2KrlError:
            return np.inf

    def fitted(self, others: Sequence[Applied], start: Applied) -> Applied:
        """Return the effect whose numbers meet the measured times best, from a start."""
        numbers = Numbers.of([start], self.traces[0])

        def late(x: Floats) -> Floats:
            return self.late((*others, *numbers.applied(x)))

        try:
            control = Shortened(numbers.box)
            x = numbers.start([start])
            least = gauss_newton(
                late, x, numbers.box, control, _settled, most_steps=_STEPS, step_share=_STEP_SHARE
            )
        except Gcode2KrlError:
            return start
        return numbers.applied(least.x)[0]


def _settled(before: float, after: float) -> bool:
    return after > _SETTLED_SHARE**2 * before
