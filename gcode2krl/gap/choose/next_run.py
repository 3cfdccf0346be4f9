"""The canned program that parts best what a diagnosis leaves open.

What is left open are pairs of answers: a cause and its rivals, families that no effect stands for, and
something that the library lacks. Each program is simulated for each pair (`separation`); the best is the one
with the highest odds, each pair weighted by how open it is, and among nearly equal ones the shortest.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.canned import NAMES, REPEAT, around_minutes
from gcode2krl.canned.trial import Trial, trials_of
from gcode2krl.effects import Applied, Effect
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.choose.judged import Cause, Judgement
from gcode2krl.gap.choose.separation import Apart, Bench, allowed_by, information_of
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import S_PER_MIN

_LIMITS = THRESHOLDS.choose
_TINY = 1e-30


@dataclass(frozen=True, eq=False)
class Answer:
    """Something that may be right."""

    label: str
    probability: float
    applied: Applied | None = None
    """What it does, at its best values; None for what nobody can simulate."""


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


@dataclass(frozen=True)
class Family:
    """A family that the rest of a link depends on, and its probability."""

    link: str
    at: str
    on: str
    form: str
    probability: float

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
class Again:
    """A gap of which only one thing can be asked: whether it comes back."""

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
    again: Again | None = None


def choose_next_run(
    context: Context, judgements: Sequence[Judgement], families: Sequence[Family] = ()
) -> Choice | None:
    """Return the program with the best expected odds between what is left open.

    None where nothing is left open, or where robot and cell are not known well enough for a program.
    """
    if not context.pairs or not all(pair.known_robot for pair in context.pairs):
        return None
    pairs = sorted(open_pairs(context.offered, judgements, families), key=lambda pair: -pair.weight)
    pairs = pairs[: _LIMITS.most_open_pairs]
    runs = [pair.inputs for pair in context.pairs]
    if not pairs:
        return _again(judgements, float(np.ptp(runs[0].time_s)))
    hours = max(
        float(run.run_hours[-1]) for run in runs
    )  # as if it followed at once, as warm as the robot is
    trials = [replace(trial, inputs=replace(trial.inputs, hours=hours)) for trial in trials_of(runs[0].cell)]
    choices = _choices(pairs, trials, context.mismatch)
    return best(list(choices))


def _again(judgements: Sequence[Judgement], run_s: float) -> Choice | None:
    """Return the same program once more, where a gap is left and nothing is known of it; else None."""
    left = [judgement for judgement in judgements if judgement.verdict in ("unexplained", "partly_explained")]
    if not left:
        return None
    judgement = max(left, key=lambda each: each.size.power)
    size = judgement.size
    excess = max(size.after - size.floor, 0.0) / max(size.floor, _TINY)
    log_odds = min(0.5 * _LIMITS.trial_rows * excess, _LIMITS.most_log_odds)
    again = Again(
        rms=judgement.factor * max(size.after, 0.0) ** 0.5,
        unit=judgement.link.unit,
        signal=judgement.link.signal,
        odds=math.exp(log_odds),
    )
    return Choice(REPEAT, run_s / S_PER_MIN + around_minutes(), (), again)


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
    known: Mapping[str, Effect], judgements: Sequence[Judgement], families: Sequence[Family] = ()
) -> Iterator[OpenPair]:
    """Yield the pairs of answers that each link with a gap leaves open."""
    for judgement in judgements:
        if judgement.verdict == "no_gap":
            continue
        of_link = [
            answer_of(family, known, judgement)
            for family in families
            if family.link == judgement.link.name and family.probability >= _LIMITS.least_open
        ]
        likely = [cause for cause in judgement.causes if cause.probability >= _LIMITS.least_open]
        for cause in likely:
            yield from _pairs_of(cause, judgement, of_link)
        if not likely:
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
        yield OpenPair(own, family, family.probability, found, number)
    apart = sum(probability for rival, probability in compared if not rival.alike)
    unknown = max(0.0, 1.0 - cause.probability - apart)
    if cause.probability < _LIMITS.settled and unknown >= _LIMITS.least_open:
        none = Answer("something else", unknown)
        yield OpenPair(own, none, cause.probability * unknown, found, number)


def _between(families: Sequence[Answer], judgement: Judgement) -> Iterator[OpenPair]:
    """Yield the pairs of a link without a cause: its families, or the only one and something else."""
    found = judgement.examination
    for first, second in itertools.combinations(families, 2):
        yield OpenPair(first, second, first.probability * second.probability, found, None)
    if len(families) == 1 and families[0].probability < _LIMITS.settled:
        none = Answer("something else", 1.0 - families[0].probability)
        yield OpenPair(families[0], none, none.probability, found, None)


def answer_of(family: Family, known: Mapping[str, Effect], judgement: Judgement) -> Answer:
    """Return a family as an answer: the effect of the library that depends on it and on the least else."""
    trace = judgement.examination.traces[0]
    members = []
    for effect in known.values():
        depends = {each.value for each in effect.depends_on}
        target = next(
            (each for each in effect.targets(trace.inputs.cell) if _is_at(effect, each, family)), ""
        )
        if (
            family.on in depends
            and target != ""
            and judgement.link.name in effect.visible_links(frozenset({judgement.link.name}), target)
        ):
            members.append((len(depends), effect.name, effect, target))
    if not members:
        return Answer(family.label, family.probability)
    _, _, effect, target = min(members, key=lambda member: member[:2])
    typical = Applied(effect, target, effect.start(trace.inputs, target))
    return Answer(family.label, family.probability, typical)


def _is_at(effect: Effect, target: str | None, family: Family) -> bool:
    places = {each.value for each in effect.where}
    return target == family.at or (target is None and family.at in places)


# What programs make of it


def _choices(pairs: Sequence[OpenPair], trials: Sequence[Trial], mismatch: Mismatch) -> Iterator[Choice]:
    """Yield each program with the odds of every pair that it can show."""
    shown = [(_shown(pair, pair.first), _shown(pair, pair.second)) for pair in pairs]
    for trial in sorted(trials, key=lambda trial: trial.minutes):
        benches: dict[int, Bench] = {}
        partings = []
        for pair, (of_first, of_second) in zip(pairs, shown, strict=True):
            key = id(pair.found)
            try:
                if key not in benches:
                    benches[key] = Bench(pair.found, trial.inputs, mismatch)
                partings.append(_parting(pair, benches[key], of_first, of_second))
            except Gcode2KrlError:  # an effect that this program cannot show
                continue
        if partings:
            yield Choice(trial.name, trial.minutes, tuple(partings))


@dataclass(frozen=True, eq=False)
class _Shown:
    """What the measured runs say of an answer."""

    information: Floats | None
    every: tuple[Applied | None, ...]
    """What it may be: its best numbers, and others that the runs allow."""


def _shown(pair: OpenPair, answer: Answer) -> _Shown:
    if answer.applied is None:
        return _Shown(None, (None,))
    information = information_of(pair.found, pair.number, answer.applied)
    others = allowed_by(information, answer.applied, pair.found.traces[0])
    return _Shown(information, (answer.applied, *others))


def _parting(pair: OpenPair, bench: Bench, of_first: _Shown, of_second: _Shown) -> Parting:
    """Return the odds expected of a program, whichever of the two is right and whatever its numbers.

    The one that is wrong is refitted, as far as the measured runs let it.
    """
    ways = [bench.apart(one, pair.second.applied, of_second.information) for one in of_first.every]
    back = [bench.apart(other, pair.first.applied, of_first.information) for other in of_second.every]
    nats = 0.5 * np.array([apart.distance2 for apart in (*ways, *back)])
    odds = np.exp(np.minimum(nats, _LIMITS.most_log_odds).mean())
    return Parting(pair, float(odds), float(np.minimum(nats, _LIMITS.enough_nats).mean()), ways[0])
