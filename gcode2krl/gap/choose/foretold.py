"""What an answer shows in a program before it has run, and by how much it may be otherwise.

A family has no form of its own. What the measured runs say of it are weights of its functions,

    y = B·w + e,    w ~ N(0, a²·Λ),    e ~ N(0, sigma²)

with y what it was found to do, at rows that count as independent, and B the functions over the range of its
input in the runs and in the program together. There it does B'·E[w | y], uncertain by the covariance of w:
where the program leaves the range of the runs, and where each run goes its own way, only a and Λ are known.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.families.evidence import AMPLITUDES, Evidence
from gcode2krl.gap.families.grid import Grid, Place
from gcode2krl.gap.fit.numbers import NORMAL_90
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
_LEAST = 1e-12
"""Of information: keeps what nothing is known of finite."""


@dataclass(frozen=True, eq=False)
class Foretold:
    """An answer in a program of n rows: its mean, and columns (k, n, p) along which it may be otherwise."""

    mean: Floats
    """(n, k)."""
    columns: Floats
    information: Floats
    """(p, p) of the columns' weights."""
    is_open: bool = False
    """The runs do not say which way it goes: the mean is one way of many."""

    def value(self, row: int, column: int, is_change: bool) -> float:
        """Return what it shows in a row, or by how much that has changed since the first one.

        Where it is open, the size that it is within with a probability of 90 %.
        """
        if not self.is_open:
            return float(self.mean[row, column] - is_change * self.mean[0, column])
        along = self.columns[column, row] - is_change * self.columns[column, 0]
        return NORMAL_90 * float(np.sqrt(along @ np.linalg.solve(self.information, along)))

    def ways(self) -> "list[Foretold]":
        """Return it as it is most probably, and at both ends of 90 % along what is known least there.

        Where it is open, only these ends.
        """
        if not self.columns.shape[2]:
            return [self]
        ends = [replace(self, mean=self.mean + sign * step) for step in self._steps for sign in (1.0, -1.0)]
        return ends if self.is_open else [self, *ends]

    @cached_property
    def _steps(self) -> list[Floats]:
        """(n, k) each: to an end of 90 % along what is known least in the program."""
        k, n, width = self.columns.shape
        values, vectors = np.linalg.eigh(self.information)
        spread = self.columns.reshape(k * n, width) @ (vectors / np.sqrt(np.maximum(values, _LEAST)))
        along, sizes, _ = np.linalg.svd(spread, full_matrices=False)
        return [
            NORMAL_90 * sizes[i] * along[:, i].reshape(k, n).T for i in range(min(_LIMITS.widest_ways, width))
        ]

    def judged(self) -> "Foretold":
        """Return it as open where its mean is small beside what else it may be."""
        return replace(self, is_open=bool(np.sum(self.mean**2) < np.sum(self._steps[0] ** 2)))


def foretold_of(
    evidence: Evidence, traces: Sequence[Trace], trial: Trace, sigma: Sequence[float]
) -> Foretold | None:
    """Return what a family shows in a trial (n, k); None where it has no function of its input there.

    ``traces`` are those that ``evidence.signal`` is of; ``sigma`` (k,) of the noise.
    """
    thin = [_every(trace) for trace in traces]
    joined = [*(_rows(trace, rows) for trace, rows in zip(traces, thin, strict=True)), trial]
    component = evidence.place.component
    scale = np.array(sigma if component is None else [sigma[component]])
    y = np.concatenate(
        [(own[rows] / scale).T.ravel() for own, rows in zip(evidence.signal, thin, strict=True)]
    )
    best: tuple[float, Foretold] | None = None
    for columns, root in _functions(evidence, joined, sigma):
        white = [own @ root / scale[:, None, None] for own in columns]
        fitted = np.concatenate([own.reshape(-1, root.shape[1]) for own in white[:-1]])
        gram, score = fitted.T @ fitted, fitted.T @ y
        for a in AMPLITUDES:
            normal = np.eye(len(gram)) + a * a * gram
            weights = np.linalg.solve(normal, a * score)
            nats = 0.5 * float(a * score @ weights) - 0.5 * float(np.linalg.slogdet(normal)[1])
            if best is None or nats > best[0]:
                turned = a * (columns[-1] @ root)
                # neither noise nor families are exactly as modelled
                information = np.eye(len(gram)) + a * a * gram / _LIMITS.temperature
                best = nats, Foretold((turned @ weights).T, turned, information)
    if best is None:
        return None
    found = best[1].judged()
    return found if component is None else _in_all(found, component, trial.shape[1])


def _in_all(own: Foretold, component: int, k: int) -> Foretold:
    """Return what is of one component alone as one of all k."""
    mean, columns = np.zeros((len(own.mean), k)), np.zeros((k, *own.columns.shape[1:]))
    mean[:, component], columns[component] = own.mean[:, 0], own.columns[0]
    return replace(own, mean=mean, columns=columns)


def _every(trace: Trace) -> Ints:
    """Return rows of a trace that are far enough apart to count as independent."""
    step_s = float(np.median(np.diff(trace.time_s))) if len(trace.time_s) > 1 else _LIMITS.trial_step_s
    return np.arange(0, len(trace.time_s), max(1, round(_LIMITS.trial_step_s / max(step_s, 1e-9))))


def _rows(trace: Trace, rows: Ints) -> Trace:
    count = len(rows)
    return replace(
        trace, time_s=trace.time_s[rows], measured=trace.measured[rows], segments=np.array([[0, count]])
    )


class _OnePlace(Grid):
    """The hypotheses of one place."""

    def __init__(self, name: str, traces: Sequence[Trace], sigma: Sequence[float]) -> None:
        super().__init__(traces, sigma)
        self._name = name

    @property
    def places(self) -> tuple[Place, ...]:
        return tuple(place for place in super().places if place.name == self._name)


def _functions(
    evidence: Evidence, traces: Sequence[Trace], sigma: Sequence[float]
) -> Iterator[tuple[list[Floats], Floats]]:
    """Yield columns (k, n, c) of each trace and a root (c, c') of the covariance of their weights."""
    grid = _OnePlace(evidence.place.name, traces, sigma)
    if evidence.at is not None:
        for place in grid.places:
            columns = _lifted(place, list(_at(evidence, traces, place)))
            yield columns, np.eye(columns[0].shape[2])
        return
    for family in grid.families(evidence.on):
        if family.on is evidence.on and family.place.name == evidence.place.name:
            yield from ((list(family.columns), root) for root in family.roots)


def _lifted(place: Place, functions: Sequence[Floats]) -> list[Floats]:
    """Return functions (n, f) of each trace at a place, (k, n, f·d)."""
    return [
        (own[None, :, :, None] * unit[:, :, None, :]).reshape(*unit.shape[:2], -1)
        for own, unit in zip(functions, place.units, strict=True)
    ]


def _at(evidence: Evidence, traces: Sequence[Trace], place: Place) -> Iterator[Floats]:
    """Yield functions (n, f) of each trace of a step at its moment, or of a tone at its frequency."""
    number, value = evidence.at or (0, 0.0)
    hours = [float(trace.inputs.run_hours[0]) for trace in traces]
    for i, trace in enumerate(traces):
        if evidence.on is Dependence.RUN_TIME_STEP:
            is_later = evidence.stays and hours[i] > hours[number]
            begun = trace.time_s >= value if i == number else np.full(len(trace.time_s), is_later)
            yield begun[:, None].astype(np.float64)
            continue
        joint = place.joint or 0
        angle = np.interp(trace.time_s, trace.inputs.time_s, trace.inputs.q_cmd_rad[:, joint])
        turn = value * angle if evidence.on is Dependence.MOTOR_ANGLE else 2.0 * np.pi * value * trace.time_s
        wave = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        if evidence.on is Dependence.MOTOR_ANGLE:
            yield wave
            continue
        columns = np.zeros((len(wave), len(traces), 2))  # each run has a phase of its own
        columns[:, i] = wave
        yield columns.reshape(len(wave), -1)
