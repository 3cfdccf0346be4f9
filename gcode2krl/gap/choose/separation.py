"""How far a program would set two answers apart: the T-optimal distance.

One answer is simulated along the program, the other is refitted to it: its numbers may move as far as the
measured runs allow, and the instruments of the new run have their mismatch. What no number of the other
answer takes away, over the noise as learnt, is the distance (Atkinson & Fedorov 1975). With a distance of d
the odds between them after the run are about exp(d²/2).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Inputs
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.beside.simulator import Simulator
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.choose.foretold import Foretold, foretold_of
from gcode2krl.gap.families.evidence import Evidence
from gcode2krl.gap.fit.fitted import Numbers
from gcode2krl.gap.fit.least_squares import derivative
from gcode2krl.gap.fit.likelihood import STEP_SHARE, Likelihood
from gcode2krl.gap.fit.noise import Noise, white
from gcode2krl.gap.fit.nuisance import nuisance_of
from gcode2krl.gap.fit.numbers import NORMAL_90
from gcode2krl.gap.fit.signatures import Signatures
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose


@dataclass(frozen=True, kw_only=True, eq=False)
class Apart:
    """What sets two answers apart in a program."""

    distance2: float
    """Squared, in standard deviations."""
    time_s: float
    """When they are farthest apart."""
    component: str
    first: float
    """What the first answer shows then, in the report's unit."""
    second: float
    """The same of the second one, with the numbers that the measured runs give it."""
    is_change: bool
    """They are changes since the run's start."""
    unit: str
    signal: str
    noise: float
    """Standard deviation of a value, in the report's unit."""
    is_open: tuple[bool, bool] = (False, False)
    """Of the first and the second: the measured runs do not say which way it goes."""


class Bench:
    """A program that a link would be measured in: signals of answers, and distances between them."""

    def __init__(self, found: Examination, inputs: Inputs, mismatch: Mismatch) -> None:
        self.found = found
        self.trace = _trace_of(found.traces[0], inputs)
        noise = [_with_model(each, self.trace.link.model_rms) for each in found.noise]
        nuisance = nuisance_of(self.trace, {}, mismatch, Signatures(), frozenset())
        self.likelihood = Likelihood([self.trace], [nuisance], noise)
        self._noise = noise

    def shown(self, applied: Sequence[Applied]) -> Floats:
        """Return what effects change in the signal (n, k)."""
        return self.trace.sample(applied) - self.trace.nominal if applied else np.zeros(self.trace.shape)

    def foretold(self, applied: Applied | None, information: Floats | None = None) -> Foretold:
        """Return what an effect shows in the program; None is one that does nothing there.

        ``information`` (p, p): that of the measured runs on its numbers, in typical sizes; without it they
        are free.
        """
        mean = self.shown(() if applied is None else (applied,))
        numbers = None if applied is None else Numbers.of((applied,), self.trace)
        x = np.zeros(0) if numbers is None or applied is None else numbers.start((applied,))
        if numbers is None or not len(x):
            return Foretold(mean, np.zeros((mean.shape[1], mean.shape[0], 0)), np.zeros((0, 0)))
        columns = self.likelihood.tangents(numbers, x)[0]
        return Foretold(mean, columns, np.zeros((len(x), len(x))) if information is None else information)

    def of_family(self, evidence: Evidence, traces: Sequence[Trace]) -> Foretold | None:
        """Return what a family shows in the program, as the measured traces know it."""
        return foretold_of(evidence, traces, self.trace, [each.sigma for each in self.found.noise])

    def apart(
        self, first: Applied | None, second: Applied | None, information: Floats | None = None
    ) -> Apart:
        """Return what sets two effects apart, the second one refitted as far as ``information`` lets it."""
        return self.between(self.foretold(first), self.foretold(second, information))

    def between(self, first: Foretold, second: Foretold) -> Apart:
        """Return what sets two answers apart, the second one moved towards the first as far as it may be."""
        missing = first.mean - second.mean
        left = missing - self._moved(missing, second)
        rest = self.likelihood.marginal(self.likelihood.whiten([left]))
        return self._farthest(float(rest @ rest), first, second)

    def _moved(self, missing: Floats, second: Foretold) -> Floats:
        """Return by how much the second answer moves towards what is missing (n, k), to first order."""
        width = second.columns.shape[2]
        if not width:
            return np.zeros_like(missing)
        columns = np.stack(
            [
                self.likelihood.projected(self.likelihood.whiten([second.columns[:, :, p].T])[:, None])[:, 0]
                for p in range(width)
            ],
            axis=1,
        )
        wanted = self.likelihood.projected(self.likelihood.whiten([missing])[:, None])[:, 0]
        normal = columns.T @ columns + second.information + _FREE * np.eye(width)
        step = np.linalg.solve(normal, columns.T @ wanted)
        moved: Floats = np.einsum("knp,p->nk", second.columns, step)
        return moved

    def _farthest(self, distance2: float, first: Foretold, second: Foretold) -> Apart:
        """Return the distance, and what both answers show where they differ most."""
        sigma = np.array([each.sigma for each in self._noise])
        off = (first.mean - second.mean) / sigma
        changed = off - off[0]
        # an instrument's zero may be anything: a change is told where the answers differ by one
        is_change = bool(np.abs(changed).max() >= _LIMITS.told_change * np.abs(off).max())
        which = np.abs(changed if is_change else off)
        row, column = (int(at) for at in np.unravel_index(int(np.argmax(which)), which.shape))
        values = [each.value(row, column, is_change) for each in (first, second)]
        factor = self.trace.factor
        return Apart(
            distance2=distance2,
            time_s=float(self.trace.time_s[row]),
            component=self.trace.components[column],
            first=factor * float(values[0]),
            second=factor * float(values[1]),
            is_change=is_change,
            unit=self.trace.unit,
            signal=self.trace.signal,
            noise=factor * float(sigma[column]),
            is_open=(first.is_open, second.is_open),
        )


def allowed_by(information: Floats | None, applied: Applied, trace: Trace) -> tuple[Applied, ...]:
    """Return an answer with other numbers that the measured runs allow, where they allow most.

    ``information`` (p, p) as `information_of` returns it. Its numbers are known to their typical size before
    any run; along the directions that the runs have shown least they are moved to both ends of a 90 %
    interval, and stay in their range.
    """
    numbers = Numbers.of((applied,), trace)
    x = numbers.start((applied,))
    if information is None or not len(x):
        return ()
    limits = numbers.box.low, numbers.box.high
    precision, directions = np.linalg.eigh(information + np.eye(len(x)))
    ends = []
    for which in range(min(_LIMITS.widest_ways, len(x))):  # the least known first
        step = NORMAL_90 / np.sqrt(precision[which]) * directions[:, which] * numbers.box.scale
        ends += [np.clip(x + step, *limits), np.clip(x - step, *limits)]
    return tuple(numbers.applied(end)[0] for end in ends)


_FREE = 1e-9
"""Keeps a normal matrix regular where a number does nothing."""


def information_of(found: Examination, number: int | None, second: Applied) -> Floats | None:
    """Return what the measured runs say of an answer's numbers (p, p), in typical sizes.

    ``number``: the accepted effect in whose place it stands. Over the temperature of probabilities, as
    neither noise nor effects are exactly as modelled. None where it cannot be simulated there.
    """
    others = found.applied if number is None else found.without(number)
    likelihood = found.likelihood
    numbers = Numbers.of((second,), found.traces[0])
    x = numbers.start((second,))
    if not len(x):
        return None

    def model(at: Floats) -> Floats:
        applied = (*others, *numbers.applied(at))
        return likelihood.whiten([trace.sample(applied) for trace in likelihood.traces])

    try:
        slopes = derivative(model, x, model(x), numbers.box.steps(x, STEP_SHARE)) * numbers.box.scale
    except Gcode2KrlError:
        return None
    projected = likelihood.projected(slopes)
    found_information: Floats = projected.T @ projected / _LIMITS.temperature
    return found_information


def _trace_of(like: Trace, inputs: Inputs) -> Trace:
    """Return the trace of an instrument along a program, at few stamps that are taken as independent."""
    last = float(inputs.time_s[-1])
    count = int(np.clip(last / _LIMITS.trial_step_s, 2, _LIMITS.trial_rows))
    stamps = np.linspace(float(inputs.time_s[0]), last, count)
    return replace(
        like,
        run="trial",
        simulator=Simulator(),
        inputs=inputs,
        base=(),
        time_s=stamps,
        measured=np.zeros((count, len(like.components))),
        segments=np.array([[0, count]]),
        plus_late_s=0.0,
    )


def _with_model(noise: Noise, model_rms: float) -> Noise:
    """Return white noise as large as an instrument's and the model's error together."""
    return white(float(np.hypot(noise.sigma, model_rms)))
