"""The canned program that parts best what a diagnosis leaves open.

What is left open are pairs of answers: a cause and its rivals, families that no effect stands for, and
something that the library lacks. Each program is simulated for each pair; the best is the one with the
highest odds, each pair weighted by how open it is, and among nearly equal ones the shortest.

**What is foretold.** A family has no form of its own. What the measured runs say of it are weights of its
functions,

    y = B·w + e,    w ~ N(0, a²·Λ),    e ~ N(0, sigma²)

with y what it was found to do, at rows that count as independent, and B the functions over the range of its
input in the runs and in the program together. There it does B'·E[w | y], uncertain by the covariance of w:
where the program leaves the range of the runs, and where each run goes its own way, only a and Λ are known.

**Separation.** One answer is simulated along the program, the other is refitted to it: its numbers may move
as far as the measured runs allow, and the instruments of the new run have their mismatch. What no number of
the other answer takes away, over the noise as learnt, is the distance (T-optimal: Atkinson & Fedorov 1975).
With a distance of d the odds between them after the run are about exp(d²/2).
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.canned import NAMES, REPEAT, around_minutes
from gcode2krl.canned.trial import Trial, trials_of
from gcode2krl.effects import Applied, Inputs
from gcode2krl.effects.dependence import Dependence
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.compare.interpolation import usual_step_s
from gcode2krl.gap.compare.pair import Simulator
from gcode2krl.gap.compare.trace import Context, Trace
from gcode2krl.gap.components import Functions, Grid, Place, Signatures
from gcode2krl.gap.noise.nuisance import nuisance_of
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.noise.source import are_repeats
from gcode2krl.gap.posterior.examination import Examination
from gcode2krl.gap.posterior.families import AMPLITUDES, Evidence
from gcode2krl.gap.posterior.judgement import Cause, Judgement
from gcode2krl.gap.posterior.least_squares import NORMAL_90, Numbers, derivative
from gcode2krl.gap.posterior.likelihood import STEP_SHARE, Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import S_PER_MIN

_LIMITS = THRESHOLDS.posterior
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
    judged = best[1].judged()
    return judged if component is None else _in_all(judged, component, trial.shape[1])


def _in_all(foretold: Foretold, component: int, k: int) -> Foretold:
    """Return what is of one component alone as one of all k."""
    mean, columns = np.zeros((len(foretold.mean), k)), np.zeros((k, *foretold.columns.shape[1:]))
    mean[:, component], columns[component] = foretold.mean[:, 0], foretold.columns[0]
    return replace(foretold, mean=mean, columns=columns)


def _every(trace: Trace) -> Ints:
    """Return rows of a trace that are far enough apart to count as independent."""
    step_s = usual_step_s(trace.time_s) if len(trace.time_s) > 1 else _LIMITS.trial_step_s
    return np.arange(0, len(trace.time_s), max(1, round(_LIMITS.trial_step_s / max(step_s, 1e-9))))


def _rows(trace: Trace, rows: Ints) -> Trace:
    count = len(rows)
    return replace(
        trace, time_s=trace.time_s[rows], measured=trace.measured[rows], segments=np.array([[0, count]])
    )


def _functions(
    evidence: Evidence, traces: Sequence[Trace], sigma: Sequence[float]
) -> Iterator[tuple[list[Floats], Floats]]:
    """Yield columns (k, n, c) of each trace and a root (c, c') of the covariance of their weights."""
    grid, name = Grid(traces, sigma), evidence.place.name
    if evidence.at is not None:
        for place in (each for each in grid.places if each.name == name):
            columns, _ = place.lifted(Functions(tuple(_at(evidence, traces, place)), ()))
            yield columns, np.eye(columns[0].shape[2])
        return
    for family in grid.families(evidence.on, name):
        if family.on is evidence.on:
            yield from ((list(family.columns), root) for root in family.roots)


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

    def __init__(self, examination: Examination, inputs: Inputs, mismatch: Mismatch) -> None:
        self._instruments = [model.sigma for model in examination.noise]
        self.trace = _trace_of(examination.traces[0], inputs)
        # the model's error comes to the instrument's noise
        off = self.trace.link.model_rms
        noise = [white(float(np.hypot(model.sigma, off))) for model in examination.noise]
        nuisance = nuisance_of(self.trace, {}, mismatch, Signatures(), frozenset())
        self.likelihood = Likelihood([self.trace], [nuisance], noise)
        self._noise = noise

    def shown(self, applied: Sequence[Applied]) -> Floats:
        """Return what effects change in the signal (n, k)."""
        return self.trace.sample(applied) - self.trace.nominal if applied else np.zeros(self.trace.shape)

    def foretold(self, applied: Sequence[Applied], information: Floats | None = None) -> Foretold:
        """Return what effects show together in the program.

        ``information`` (p, p): that of the measured runs on its numbers, in typical sizes; without it they
        are free.
        """
        mean, numbers = self.shown(applied), Numbers.of(applied, self.trace)
        x = numbers.start(applied)
        if not len(x):
            return Foretold(mean, np.zeros((mean.shape[1], mean.shape[0], 0)), np.zeros((0, 0)))
        columns = self.likelihood.tangents(numbers, x)[0]
        return Foretold(mean, columns, np.zeros((len(x), len(x))) if information is None else information)

    def of_family(self, evidence: Evidence, traces: Sequence[Trace]) -> Foretold | None:
        """Return what a family shows in the program, as the measured traces know it."""
        return foretold_of(evidence, traces, self.trace, self._instruments)

    def between(self, first: Foretold, second: Foretold) -> Apart:
        """Return what sets two answers apart, the second one moved towards the first as far as it may be."""
        missing = first.mean - second.mean
        unfitted = missing - self._moved(missing, second)
        whitened = self.likelihood.marginal(self.likelihood.whiten([unfitted]))
        return self._farthest(float(whitened @ whitened), first, second)

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
            unit=self.trace.link.unit,
            signal=self.trace.signal,
            noise=factor * float(sigma[column]),
            is_open=(first.is_open, second.is_open),
        )


def allowed_by(
    information: Floats | None, applied: Sequence[Applied], trace: Trace
) -> tuple[tuple[Applied, ...], ...]:
    """Return an answer with other numbers that the measured runs allow, where they allow most.

    ``information`` (p, p) as `information_of` returns it. Its numbers are known to their typical size before
    any run; along the directions that the runs have shown least they are moved to both ends of a 90 %
    interval, and stay in their range.
    """
    numbers = Numbers.of(applied, trace)
    x = numbers.start(applied)
    if information is None or not len(x):
        return ()
    limits = numbers.box.low, numbers.box.high
    precision, directions = np.linalg.eigh(information + np.eye(len(x)))
    ends = []
    for which in range(min(_LIMITS.widest_ways, len(x))):  # the least known first
        step = NORMAL_90 / np.sqrt(precision[which]) * directions[:, which] * numbers.box.scale
        ends += [np.clip(x + step, *limits), np.clip(x - step, *limits)]
    return tuple(numbers.applied(end) for end in ends)


_FREE = 1e-9
"""Keeps a normal matrix regular where a number does nothing."""


def information_of(examination: Examination, number: int | None, second: Sequence[Applied]) -> Floats | None:
    """Return what the measured runs say of an answer's numbers (p, p), in typical sizes.

    ``number``: the accepted effect in whose place it stands. Over the temperature of probabilities, as
    neither noise nor effects are exactly as modelled. None where it cannot be simulated there.
    """
    others = examination.applied if number is None else examination.without(number)
    likelihood = examination.likelihood
    numbers = Numbers.of(second, examination.traces[0])
    x = numbers.start(second)
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
    return projected.T @ projected / _LIMITS.temperature


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


_TINY = 1e-30
BACK, ONCE = "it comes back", "it happened once"
CUT, MOTION, ALWAYS = "it comes with the cut", "it comes with motion", "it is there at rest too"
_IN_AIR = "circle"
"""The shortest program that moves far without a cut, with stops at the reference points."""


@dataclass(frozen=True, eq=False)
class Answer:
    """Something that may be right."""

    label: str
    probability: float
    applied: tuple[Applied, ...] = ()
    """What does it, at its best values."""
    evidence: Evidence | None = None
    """Of a family. With neither it is something that nobody can simulate."""


@dataclass(frozen=True, eq=False)
class OpenPair:
    """Two answers that the data leave open in a link."""

    first: Answer
    second: Answer
    weight: float
    """Product of their probabilities; the one they share where the data cannot tell them apart."""
    examination: Examination
    number: int | None
    """Which accepted effect both would stand in place of."""
    traces: tuple[Trace, ...] = ()
    """Those that families are known from."""


@dataclass(frozen=True, eq=False)
class Parting:
    """A pair with what a program makes of it."""

    pair: OpenPair
    odds: float
    """As told."""
    nats: float
    """What they are chosen by: the logarithm of the odds, with a wider limit."""
    apart: Apart


@dataclass(frozen=True, eq=False)
class Bare:
    """A gap of which nothing is known yet but its size, and what one run would tell of it."""

    asks: tuple[str, ...]
    """Of `BACK`, `ONCE`, `CUT`, `MOTION`, `ALWAYS` those that the runs leave open."""
    rms: float
    """What is left of it, in the report's unit."""
    unit: str
    signal: str
    odds: float


@dataclass(frozen=True, eq=False)
class Choice:
    """The program to run next."""

    program: str
    minutes: float
    partings: tuple[Parting, ...]
    """The most open pair first; empty where no answer can be simulated."""
    bare: Bare | None = None


def choose_next_run(
    context: Context,
    judgements: Sequence[Judgement],
    families: Mapping[str, Sequence[Answer]] = MappingProxyType({}),
) -> Choice | None:
    """Return the program with the best expected odds between what is left open; ``families`` by link.

    None where nothing is left open, or where robot and cell are not known well enough for a program.
    """
    if not context.pairs or not all(pair.known_robot for pair in context.pairs):
        return None
    pairs = sorted(open_pairs(judgements, families), key=lambda pair: -pair.weight)
    pairs = pairs[: _LIMITS.most_open_pairs]
    runs = [pair.inputs for pair in context.pairs]
    if not pairs:
        return _bare(judgements, runs[0])
    hours = max(
        float(run.run_hours[-1]) for run in runs
    )  # as if it followed at once, as warm as the robot is
    trials = [replace(trial, inputs=replace(trial.inputs, hours=hours)) for trial in trials_of(runs[0].cell)]
    choices = _choices(pairs, trials, context.mismatch)
    return best(list(choices))


def _bare(judgements: Sequence[Judgement], run: Inputs) -> Choice | None:
    """Return the run that asks the first thing of a gap of which nothing is known; None without one.

    That is the same program once more only where no two runs are of one program: else they show already
    whether the gap comes back. Then it is a run in air, with motion and at rest. What happens in a moment is
    told as an event; no program makes it happen again.
    """
    unnamed = [
        judgement
        for judgement in judgements
        if judgement.verdict in ("unexplained", "partly_explained")
        and not (_is_event(judgement) and has_repeats(judgement))
    ]
    if not unnamed:
        return None
    judgement = max(unnamed, key=lambda each: each.size.power)
    size = judgement.size
    excess = max(size.after - size.floor, 0.0) / max(size.floor, _TINY)
    log_odds = min(0.5 * _LIMITS.trial_rows * excess, _LIMITS.most_log_odds)
    asks: tuple[str, ...] = (BACK, ONCE)
    program, minutes = REPEAT, float(np.ptp(run.time_s)) / S_PER_MIN + around_minutes()
    if has_repeats(judgement):
        cuts = [bool(np.any(trace.inputs.force_base_N)) for trace in judgement.every or judgement.traces]
        asks = (*((CUT,) if all(cuts) else ()), MOTION, ALWAYS)
        program = _IN_AIR
        trial = next((each for each in trials_of(run.cell) if each.name == program), None)
        if trial is None:
            return None
        minutes = trial.minutes
    bare = Bare(
        asks=asks,
        rms=judgement.factor * max(size.after, 0.0) ** 0.5,
        unit=judgement.link.unit,
        signal=judgement.link.signal,
        odds=math.exp(log_odds),
    )
    return Choice(program, minutes, (), bare)


def has_repeats(judgement: Judgement) -> bool:
    """Tell whether two runs of a link are of one program: they show whether a gap comes back."""
    traces = judgement.every or judgement.traces
    return any(are_repeats(pair) for pair in itertools.combinations(traces, 2))


def _is_event(judgement: Judgement) -> bool:
    """Tell whether what is left of a link is an impulse and nothing else."""
    is_gap = judgement.told.significant or (judgement.rest is not None and judgement.rest.is_gap)
    return bool(judgement.impulses) and not is_gap


def best(choices: Sequence[Choice]) -> Choice | None:
    """Return the choice with the highest mean log odds; of those nearly as good, the shortest."""
    if not choices:
        return None
    most = max(_worth(choice) for choice in choices)
    good = [choice for choice in choices if _worth(choice) >= (1.0 - _LIMITS.nearly_best) * most]
    return min(good, key=lambda choice: (choice.minutes, NAMES.index(choice.program)))


def _worth(choice: Choice) -> float:
    return sum(parting.pair.weight * parting.nats for parting in choice.partings)


# What is left open


def open_pairs(
    judgements: Sequence[Judgement], families: Mapping[str, Sequence[Answer]] = MappingProxyType({})
) -> Iterator[OpenPair]:
    """Yield the pairs of answers that each link with a gap leaves open; ``families`` by the link's name."""
    for judgement in judgements:
        if judgement.verdict == "no_gap":
            continue
        of_link = families.get(judgement.link.name, ())
        of_link = [family for family in of_link if family.probability >= _LIMITS.least_open]
        likely = [cause for cause in judgement.causes if cause.probability >= _LIMITS.least_open]
        for cause in likely:
            yield from _pairs_of(cause, judgement, of_link)
        if not judgement.applied:  # a cause without a name leaves its families open
            yield from _between(of_link, judgement)


def _pairs_of(cause: Cause, judgement: Judgement, families: Sequence[Answer]) -> Iterator[OpenPair]:
    """Yield the pairs of a cause: with each rival, with what the rest depends on, with the unknown."""
    examination = judgement.examination
    number = next((n for n in examination.cause_numbers if examination.applied[n] == cause.applied), None)
    answer = Answer(cause.applied.label, cause.probability, (cause.applied,))
    compared = cause.rivals or ()
    for rival, probability in compared:
        if rival.alike or (probability >= _LIMITS.least_open and cause.probability < _LIMITS.settled):
            label = " and ".join(each.label for each in rival.together)
            other = Answer(label, probability, rival.together)
            weight = cause.probability * (1.0 if rival.alike else probability)
            yield OpenPair(answer, other, weight, examination, number)
    for family in families:
        yield OpenPair(answer, family, family.probability, examination, number, judgement.every)
    apart = sum(probability for rival, probability in compared if not rival.alike)
    unknown = max(0.0, 1.0 - cause.probability - apart)
    if cause.probability < _LIMITS.settled and unknown >= _LIMITS.least_open:
        none = Answer("something else", unknown)
        yield OpenPair(answer, none, cause.probability * unknown, examination, number)


def _between(families: Sequence[Answer], judgement: Judgement) -> Iterator[OpenPair]:
    """Yield the pairs of a link without a named cause: of each signal its families, or the only one and none.

    Families of two joints are no rivals: both may be right. One that stands alone has to foretell a program.
    """
    examination, every = judgement.examination, judgement.every
    signals: dict[int | None, list[Answer]] = {}
    for family in families:
        component = None if family.evidence is None else family.evidence.place.component
        signals.setdefault(component, []).append(family)
    for answers in signals.values():
        for first, second in itertools.combinations(answers, 2):
            yield OpenPair(first, second, first.probability * second.probability, examination, None, every)
        if len(answers) == 1:
            none = Answer("something else", 1.0 - answers[0].probability)
            weight = answers[0].probability * none.probability
            yield OpenPair(answers[0], none, weight, examination, None, every)


# What programs make of it


def _choices(pairs: Sequence[OpenPair], trials: Sequence[Trial], mismatch: Mismatch) -> Iterator[Choice]:
    """Yield each program with the odds of every pair that it can show."""
    known = [(_known(pair, pair.first), _known(pair, pair.second)) for pair in pairs]
    for trial in sorted(trials, key=lambda trial: trial.minutes):
        benches: dict[int, Bench] = {}
        partings = []
        for pair, (of_first, of_second) in zip(pairs, known, strict=True):
            key = id(pair.examination)
            try:
                if key not in benches:
                    benches[key] = Bench(pair.examination, trial.inputs, mismatch)
                first, second = (_shown(pair, benches[key], each) for each in (of_first, of_second))
                partings.append(_parting(pair, first, second, benches[key]))
            except Gcode2KrlError:  # an effect that this program cannot show
                continue
        if partings:
            yield Choice(trial.name, trial.minutes, tuple(partings))


@dataclass(frozen=True, eq=False)
class _Known:
    """What the measured runs say of an answer."""

    answer: Answer
    information: Floats | None = None
    others: tuple[tuple[Applied, ...], ...] = ()
    """Other numbers of its effects that the runs allow."""


def _known(pair: OpenPair, answer: Answer) -> _Known:
    if not answer.applied:
        return _Known(answer)
    information = information_of(pair.examination, pair.number, answer.applied)
    return _Known(answer, information, allowed_by(information, answer.applied, pair.examination.traces[0]))


def _shown(pair: OpenPair, bench: Bench, known: _Known) -> tuple[Foretold, list[Foretold]]:
    """Return what an answer shows in a program: as it most probably is, and the ways in which it may be."""
    answer = known.answer
    family = None if answer.evidence is None else bench.of_family(answer.evidence, pair.traces)
    if family is not None:
        return family, family.ways()
    ways = [bench.foretold(each, known.information) for each in (answer.applied, *known.others)]
    return ways[0], ways


def _parting(
    pair: OpenPair,
    first: tuple[Foretold, Sequence[Foretold]],
    second: tuple[Foretold, Sequence[Foretold]],
    bench: Bench,
) -> Parting:
    """Return the odds expected of a program, whichever of the two is right and whatever its numbers.

    The one that is wrong is refitted, as far as the measured runs let it.
    """
    ways = [bench.between(each, second[0]) for each in first[1]]
    back = [bench.between(each, first[0]) for each in second[1]]
    nats = 0.5 * np.array([apart.distance2 for apart in (*ways, *back)])
    odds = np.exp(np.minimum(nats, _LIMITS.most_log_odds).mean())
    return Parting(pair, float(odds), float(np.minimum(nats, _LIMITS.enough_nats).mean()), ways[0])
