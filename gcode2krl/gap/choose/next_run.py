"""The canned program that parts best what a diagnosis leaves open.

What is left open are pairs of answers: a cause and its rivals, families that no effect stands for, and
something that the library lacks. Each program is simulated for each pair (`separation`); the best is the one
with the highest odds, each pair weighted by how open it is, and among nearly equal ones the shortest.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.canned import NAMES, REPEAT, around_minutes
from gcode2krl.canned.trial import Trial, trials_of
from gcode2krl.effects import Applied, Inputs
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.choose.foretold import Foretold
from gcode2krl.gap.choose.judged import Cause, Judgement
from gcode2krl.gap.choose.separation import Apart, Bench, allowed_by, information_of
from gcode2krl.gap.families.evidence import Evidence
from gcode2krl.gap.fit.noise_source import are_repeats
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import S_PER_MIN

_LIMITS = THRESHOLDS.choose
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
    applied: Applied | None = None
    """What it does, at its best values."""
    evidence: Evidence | None = None
    """Of a family. With neither it is something that nobody can simulate."""


@dataclass(frozen=True, eq=False)
class OpenPair:
    """Two answers that the data leave open in a link."""

    first: Answer
    second: Answer
    weight: float
    """Product of their probabilities; the one they share where the data cannot tell them apart."""
    found: Examination
    number: int | None
    """Which accepted effect both would stand in place of."""
    traces: tuple[Trace, ...] = ()
    """Those that families are known from."""


@dataclass(frozen=True, eq=False)
class Family:
    """A family that the rest of a link depends on, and its probability."""

    link: str
    at: str
    on: str
    form: str
    probability: float
    evidence: Evidence | None = None

    @property
    def label(self) -> str:
        """Return its words, ``A2, reversals``."""
        return f"{self.at}, {self.on}"


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
    context: Context, judgements: Sequence[Judgement], families: Sequence[Family] = ()
) -> Choice | None:
    """Return the program with the best expected odds between what is left open.

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
    left = [
        judgement
        for judgement in judgements
        if judgement.verdict in ("unexplained", "partly_explained")
        and not (_is_event(judgement) and has_repeats(judgement))
    ]
    if not left:
        return None
    judgement = max(left, key=lambda each: each.size.power)
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
    rest = judgement.rest
    return bool(judgement.impulses) and not judgement.told.significant and not (rest and rest.is_gap)


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


def open_pairs(judgements: Sequence[Judgement], families: Sequence[Family] = ()) -> Iterator[OpenPair]:
    """Yield the pairs of answers that each link with a gap leaves open."""
    for judgement in judgements:
        if judgement.verdict == "no_gap":
            continue
        of_link = [
            Answer(family.label, family.probability, evidence=family.evidence)
            for family in families
            if family.link == judgement.link.name and family.probability >= _LIMITS.least_open
        ]
        likely = [cause for cause in judgement.causes if cause.probability >= _LIMITS.least_open]
        for cause in likely:
            yield from _pairs_of(cause, judgement, of_link)
        if not judgement.applied:  # a cause without a name leaves its families open
            yield from _between(of_link, judgement)


def _pairs_of(cause: Cause, judgement: Judgement, families: Sequence[Answer]) -> Iterator[OpenPair]:
    """Yield the pairs of a cause: with each rival, with what the rest depends on, with the unknown."""
    found = judgement.examination
    number = next((n for n in found.cause_numbers if found.applied[n] == cause.applied), None)
    own = Answer(cause.applied.label, cause.probability, cause.applied)
    compared = cause.rivals or ()
    for rival, probability in compared:
        if rival.alike or (probability >= _LIMITS.least_open and cause.probability < _LIMITS.settled):
            other = Answer(rival.applied.label, probability, rival.applied)
            weight = cause.probability * (1.0 if rival.alike else probability)
            yield OpenPair(own, other, weight, found, number)
    for family in families:
        yield OpenPair(own, family, family.probability, found, number, judgement.every)
    apart = sum(probability for rival, probability in compared if not rival.alike)
    unknown = max(0.0, 1.0 - cause.probability - apart)
    if cause.probability < _LIMITS.settled and unknown >= _LIMITS.least_open:
        none = Answer("something else", unknown)
        yield OpenPair(own, none, cause.probability * unknown, found, number)


def _between(families: Sequence[Answer], judgement: Judgement) -> Iterator[OpenPair]:
    """Yield the pairs of a link without a named cause: of each signal its families, or the only one and none.

    Families of two joints are no rivals: both may be right. One that stands alone has to foretell a program.
    """
    found, every = judgement.examination, judgement.every
    signals: dict[int | None, list[Answer]] = {}
    for family in families:
        component = None if family.evidence is None else family.evidence.place.component
        signals.setdefault(component, []).append(family)
    for answers in signals.values():
        for first, second in itertools.combinations(answers, 2):
            yield OpenPair(first, second, first.probability * second.probability, found, None, every)
        if len(answers) == 1:
            none = Answer("something else", 1.0 - answers[0].probability)
            weight = answers[0].probability * none.probability
            yield OpenPair(answers[0], none, weight, found, None, every)


# What programs make of it


def _choices(pairs: Sequence[OpenPair], trials: Sequence[Trial], mismatch: Mismatch) -> Iterator[Choice]:
    """Yield each program with the odds of every pair that it can show."""
    known = [(_known(pair, pair.first), _known(pair, pair.second)) for pair in pairs]
    for trial in sorted(trials, key=lambda trial: trial.minutes):
        benches: dict[int, Bench] = {}
        partings = []
        for pair, (of_first, of_second) in zip(pairs, known, strict=True):
            key = id(pair.found)
            try:
                if key not in benches:
                    benches[key] = Bench(pair.found, trial.inputs, mismatch)
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
    others: tuple[Applied, ...] = ()
    """Other numbers of an effect that the runs allow."""


def _known(pair: OpenPair, answer: Answer) -> _Known:
    if answer.applied is None:
        return _Known(answer)
    information = information_of(pair.found, pair.number, answer.applied)
    return _Known(answer, information, allowed_by(information, answer.applied, pair.found.traces[0]))


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
