"""When a run has gone how far: what the numbers of a time law are found from.

Late by a second, a signal tells nothing of the law that made it late: least squares on it have a minimum at
each stop. The time at which a place is reached is nearly proportional to the law's numbers instead.
"""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.beside.interpolation import values_of
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.numbers import Free

_PLACES = 400
_STEPS = 8
_STEP_SHARE = 0.1


class PlaceTimes:
    """The measured times at which runs have gone so far, to be compared with those of plans."""

    def __init__(self, traces: Sequence[Trace]) -> None:
        self.traces = list(traces)
        self.measured = [gone(trace.time_s, trace.measured, trace.link.least_step) for trace in traces]

    def late(self, applied: Sequence[Applied]) -> Floats:
        """Return how late (runs · places,) the runs are beside a plan with these effects, in s.

        Of each run its mean, which is its clock's, is taken off.
        """
        late = []
        for trace, (own_s, own_way) in zip(self.traces, self.measured, strict=True):
            signals = trace.signals(applied)
            values = values_of(signals, trace.plus)
            time_s, way = gone(signals.time_s, values[:, list(trace.columns)], 0.0)
            at = own_way[-1] * (np.arange(_PLACES) + 0.5) / _PLACES
            behind = np.interp(at, own_way, own_s) - np.interp(at, way, time_s)
            late.append(behind - behind.mean())
        return np.concatenate(late)

    def size(self, applied: Sequence[Applied]) -> float:
        """Return the rms by which runs are late beside a plan, in s; infinite where there is none."""
        try:
            return float(np.sqrt(np.mean(self.late(applied) ** 2)))
        except Gcode2KrlError:
            return np.inf

    def fitted(self, others: Sequence[Applied], free: Free, start: Applied) -> Applied:
        """Return the effect whose numbers meet the measured times best, by Gauss-Newton from a start."""
        x = free.start(start)
        best = self.size((*others, free.applied(x)))
        for _ in range(_STEPS):
            late = self.late((*others, free.applied(x)))
            columns = []
            for i in range(len(x)):
                moved = x.copy()
                step = _STEP_SHARE * free.scale[i]
                moved[i] += step if x[i] + step <= free.high[i] else -step
                change = self.late((*others, free.applied(moved))) - late
                columns.append(change / (moved[i] - x[i]))
            jacobian = np.stack(columns, axis=1) * free.scale
            move = -np.linalg.lstsq(jacobian, late, rcond=1e-6)[0] * free.scale
            for shrink in (1.0, 0.5, 0.2):
                trial = np.clip(x + shrink * move, free.low, free.high)
                size = self.size((*others, free.applied(trial)))
                if size < best:
                    break
            if size >= best:
                break
            settled = size > 0.98 * best
            x, best = trial, size
            if settled:
                break
        return free.applied(x)


def gone(time_s: Floats, values: Floats, least: float) -> tuple[Floats, Floats]:
    """Return times and how far the signal has gone by them; ways below ``least`` count once they add up."""
    kept = _anchors(values, least) if least > 0.0 else slice(None)
    time_s, values = time_s[kept], values[kept]
    return time_s, np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(values, axis=0), axis=1))])


def _anchors(values: Floats, least: float) -> Ints:
    """Return the rows that are at least so far from the kept row before them."""
    kept, last = [0], values[0]
    for row in range(1, len(values)):
        apart = values[row] - last
        if float(apart @ apart) >= least * least:
            kept.append(row)
            last = values[row]
    return np.array(kept)
