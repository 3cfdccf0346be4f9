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

from gcode2krl.canned import NAMES, REPEAT, around_minutes
from gcode2krl.canned.trial import Trial, trials_of
from gcode2krl.effects import Applied, Effect
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.choose.intervals import Interval
from gcode2krl.gap.choose.judged import Cause, Judgement
from gcode2krl.gap.choose.separation import Apart, Bench, information_of
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
    draws: tuple[Applied, ...] = ()
    """Other values that the data allow."""

    @property
    def every(self) -> tuple[Applied | None, ...]:
        """Return what it may be: its best values and the others."""
        return (self.applied, *self.draws)


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
    return sum(parting.pair.weight * math.log(parting.odds) for parting in choice.partings)


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
    own = Answer(cause.applied.label, cause.probability, cause.applied, tuple(draws_of(cause)))
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


def draws_of(cause: Cause) -> Iterator[Applied]:
    """Yield a cause with all its numbers at the low and at the high ends of their intervals."""
    for end in ("low", "high"):
        values = dict(cause.applied.values)
        for parameter in cause.applied.effect.sizes:
            interval: Interval | None = cause.parameters.get(parameter.name)
            if interval is not None:
                ends = float(np.clip(getattr(interval, end), parameter.low, parameter.high))
                values[parameter.name] = max(ends, parameter.minimum)
        yield replace(cause.applied, values=values)


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
    known = [_informations(pair) for pair in pairs]
    for trial in sorted(trials, key=lambda trial: trial.minutes):
        benches: dict[int, Bench] = {}
        partings = []
        for pair, information in zip(pairs, known, strict=True):
            key = id(pair.found)
            try:
                if key not in benches:
                    benches[key] = Bench(pair.found, trial.inputs, mismatch)
                partings.append(_parting(pair, benches[key], information))
            except Gcode2KrlError:  # an effect that this program cannot show
                continue
        if partings:
            yield Choice(trial.name, trial.minutes, tuple(partings))


def _informations(pair: OpenPair) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return what the measured runs say of the numbers of both answers."""
    first, second = pair.first.applied, pair.second.applied
    return (
        None if first is None else information_of(pair.found, pair.number, first),
        None if second is None else information_of(pair.found, pair.number, second),
    )


def _parting(
    pair: OpenPair, bench: Bench, information: tuple[np.ndarray | None, np.ndarray | None]
) -> Parting:
    """Return the odds that a program is expected to give: whichever of the two is right, over its draws."""
    of_first, of_second = information
    ways = [bench.apart(one, pair.second.applied, of_second) for one in pair.first.every]
    back = [bench.apart(other, pair.first.applied, of_first) for other in pair.second.every]
    logs = [min(0.5 * apart.distance2, _LIMITS.most_log_odds) for apart in (*ways, *back)]
    return Parting(pair, float(np.exp(np.mean(logs))), ways[0])
