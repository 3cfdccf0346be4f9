"""One link, from its traces to a judgement: causes, their probability, and what held-out data say of them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied
from gcode2krl.gap.beside.holdout import folds_of
from gcode2krl.gap.beside.links.base import Link
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.fitted_joints import fitted_signal
from gcode2krl.gap.choose.gap_size import Size, size_of_gap
from gcode2krl.gap.choose.intervals import Interval, intervals_of
from gcode2krl.gap.choose.rivals import (
    UNKNOWN_SHARE,
    Rival,
    probabilities,
    rivals_of,
    unknown_probability,
)
from gcode2krl.gap.choose.selection import PRUNE, Examination, Question, acts, examine, nuisance_for
from gcode2krl.gap.choose.set_clocks import with_set_clocks
from gcode2krl.gap.fit.noise import Noise
from gcode2krl.gap.fit.signatures import Signatures

NAMED = 0.5
MOST_TOGETHER = 2
"""More effects in one link than this at once imitate something that the library does not have."""
LEAST_BROUGHT = 0.4
"""A cause that takes less than this of what those above it leave on held-out data is not named."""
_TOGETHER = 0.5
"""Share of an effect's data from which on it acts where others do."""
CROWDED = 0.4
"""Times this, or at most one less this: what is left for a cause that nothing on held-out data supports."""


@dataclass(frozen=True)
class Cause:
    """One effect at one target."""

    applied: Applied
    link: str
    probability: float
    parameters: dict[str, Interval]
    shrink: float | None
    """Share of the explainable gap that it takes on held-out data, on top of those above it."""
    rms_after: float | None
    rivals: tuple[tuple[Rival, float], ...] = ()


@dataclass(frozen=True)
class Judgement:
    """What is known of one link."""

    link: Link
    traces: tuple[Trace, ...]
    verdict: str
    causes: tuple[Cause, ...]
    size: Size
    held_out: bool
    examination: Examination
    usual: tuple[Applied, ...] = field(default=())
    every: tuple[Trace, ...] = field(default=())
    """The parts with the held-out ones."""

    @property
    def applied(self) -> tuple[Applied, ...]:
        """Return the named causes."""
        return tuple(cause.applied for cause in self.causes if cause.probability >= NAMED)

    def fitted(self, trace: Trace) -> Floats:
        """Return what the fitted model says of a trace (n, k), without what only its instrument shows."""
        return fitted_signal(trace, self.examination)

    def without(self, applied: Applied) -> "Judgement":
        """Return the judgement without a cause that a later link has shown to be elsewhere."""
        return replace(self, causes=tuple(cause for cause in self.causes if cause.applied != applied))


def judge(link: Link, traces: Sequence[Trace], held: Sequence[Trace], question: Question) -> Judgement:
    """Examine a link on some traces and report on the held-out ones; without any, each trace by turns."""
    known = Signatures()
    moved = with_set_clocks([*traces, *held], question, known)
    traces, held = moved[: len(traces)], moved[len(traces) :]
    found = examine(link, traces, question, known)
    usual = tuple(each for each in found.applied if each not in found.causes)
    if not found.causes:
        everything = [*traces, *held]
        size = _size(everything, found, question, known, (), usual)
        verdict = "unexplained" if size.significant else "no_gap"
        return Judgement(link, tuple(traces), verdict, (), size, True, found, usual, tuple(everything))
    trials = _trials(link, traces, held, question, known, found)
    counts = range(len(found.causes) + 1)
    if trials:
        sizes = [_pooled([trial(count) for trial in trials]) for count in counts]
    else:
        sizes = [_size(traces, found, question, known, found.causes[:count], usual) for count in counts]
    whole = _size(traces, found, question, known, found.causes, usual)
    judged = _judgement(link, traces, found, usual, sizes, whole, bool(trials))
    return replace(judged, every=(*traces, *held))


def _trials(
    link: Link, traces: Sequence[Trace], held: Sequence[Trace], question: Question, known: Signatures,
    found: Examination,
) -> list["_Trial"]:  # fmt: skip
    """Return one trial a split: what was chosen without the held-out data, and these."""
    if held:
        return [_Trial(found, list(held), question, known, found)]
    return [
        _Trial(examine(link, train, question, known, found.noise), test, question, known, found)
        for train, test in folds_of(traces, _power(traces, found))
    ]


def _power(traces: Sequence[Trace], found: Examination) -> list[Floats]:
    """Return the power (n,) of what the causes do in each row of each trace."""
    return [np.sum((trace.sample(found.causes) - trace.nominal) ** 2, axis=1) for trace in traces]


@dataclass(frozen=True, eq=False)
class _Trial:
    """Held-out parts and what the other parts say is at work."""

    chosen: Examination
    held: list[Trace]
    question: Question
    known: Signatures
    main: Examination

    def __call__(self, count: int) -> Size:
        """Return the size of the held-out gap with those of its effects that are among the first causes."""
        names = [(each.effect.name, each.target) for each in self.main.causes[:count]]
        mine = [each for each in self.chosen.causes if (each.effect.name, each.target) in names]
        if count == len(self.main.causes):
            mine = list(self.chosen.causes)
        usual = [each for each in self.chosen.applied if each not in self.chosen.causes]
        return _size(self.held, self.chosen, self.question, self.known, mine, usual)


def _size(
    traces: Sequence[Trace], found: Examination, question: Question, known: Signatures,
    applied: Sequence[Applied], usual: Sequence[Applied],
) -> Size:  # fmt: skip
    noise: list[Noise] = found.noise
    return size_of_gap(traces, nuisance_for(traces, question, known), noise, applied, usual)


def _pooled(sizes: Sequence[Size]) -> Size:
    """Return the mean over splits, each by its rows."""
    rows = sum(size.rows for size in sizes)

    def mean(name: str) -> float:
        return sum(float(getattr(size, name)) * size.rows for size in sizes) / rows

    return Size(
        rows=rows,
        before=mean("before"),
        after=mean("after"),
        floor=mean("floor"),
        noise=mean("noise"),
        excess=mean("excess"),
        excess_before=mean("excess_before"),
        deviation=mean("deviation") / len(sizes) ** 0.5,
        largest_before=max(size.largest_before for size in sizes),
        largest_after=max(size.largest_after for size in sizes),
    )


def _beside_others(found: Examination, positions: Sequence[int]) -> bool:
    """Tell whether the last of some accepted effects acts where those before it do: in the same joints, say.

    Only there can it be what is left of their form.
    """
    if len(positions) == 1:
        return True
    mine = acts(found, positions[-1])
    others = np.any([acts(found, position) for position in positions[:-1]], axis=0)
    return float(np.mean(others[mine])) > _TOGETHER if mine.any() else True


def _judgement(
    link: Link, traces: Sequence[Trace], found: Examination, usual: tuple[Applied, ...], sizes: list[Size],
    whole: Size, held_out: bool,
) -> Judgement:  # fmt: skip
    last = sizes[-1]
    # what is left on held-out data alone is what few runs do not settle of a cause's numbers
    left = last.significant and whole.significant
    unknown = unknown_probability(last.share_left, left)
    if len(found.causes) > MOST_TOGETHER:
        unknown = max(unknown, 1.0 - CROWDED)
    causes = []
    positions = [i for i, flag in enumerate(found.usual) if not flag]
    intervals = intervals_of(found)
    for order, number in enumerate(positions):
        rivals = rivals_of(found, number)
        own, others = probabilities(rivals, found.surprises[number], found.level, unknown)
        brings = max(0.0, sizes[order + 1].shrink - sizes[order].shrink)
        least = PRUNE if _beside_others(found, positions[: order + 1]) else 0.0
        if held_out and brings < max(least, LEAST_BROUGHT * (1.0 - sizes[order].shrink)):
            own *= CROWDED
        causes.append(
            Cause(
                applied=found.applied[number],
                link=link.name,
                probability=own,
                parameters=intervals[number],
                shrink=brings if held_out else None,
                rms_after=sizes[order + 1].after ** 0.5,
                rivals=tuple(zip(rivals, others, strict=True)),
            )
        )
    causes.sort(key=lambda cause: -cause.probability)
    named = [cause for cause in causes if cause.probability >= NAMED]
    if named and not (left and last.share_left > UNKNOWN_SHARE):
        verdict = "explained"
    elif named:
        verdict = "partly_explained"
    else:
        verdict = "unexplained" if sizes[0].significant else "no_gap"
    return Judgement(link, tuple(traces), verdict, tuple(causes), last, held_out, found, usual)
