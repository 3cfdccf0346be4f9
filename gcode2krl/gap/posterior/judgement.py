"""One link, from its traces to a judgement: causes, their probability, and what held-out data say of them.

**Clocks** within normal mismatch are set run by run: stamps are moved so that what is left of them is linear.
A clock that is 2 ms off leaves a·t²/2, some micrometres at every change of speed, beside its linear
signature; over thousands of samples that is enough to look like something else.

**Wander of an instrument** is what each run has in its own way over time, within what noise may be. Random
walks, 1/f noise and the zero of an amplifier are smooth in time, or nearly so, in all runs and alike in no
two. Where time in each run says clearly more of a rest than any other input, moves the signal by no more than
slow noise may (`noise_most_slow`), and leaves nothing significant once taken off, it is noise of a long
memory. Effects that all runs share and that together say nearly as much (`time_ahead_share`) are no noise,
whether or not they get their names. What happens in one run alone is an event.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied
from gcode2krl.effects.dependence import Dependence
from gcode2krl.effects.mismatch import sigma
from gcode2krl.gap.compare.links import CLOCK
from gcode2krl.gap.compare.trace import Event, Link, Trace, Whose, folds_of
from gcode2krl.gap.components import Signatures
from gcode2krl.gap.noise.nuisance import Nuisance, Question, nuisance_for
from gcode2krl.gap.noise.short import Noise
from gcode2krl.gap.posterior.calibrated import (
    MOST_UNNAMED,
    Features,
    HeldOut,
    features_of,
    probabilities_table,
)
from gcode2krl.gap.posterior.cause_tests import (
    NOTHING_LEFT,
    Constancy,
    FamilyTests,
    Interval,
    LinkFamilies,
    Rest,
    constancy_of,
    intervals_of,
)
from gcode2krl.gap.posterior.examination import (
    Examination,
    Size,
    fitted_signal,
    pooled,
    size_of_gap,
    unexplained_by_mismatch,
)
from gcode2krl.gap.posterior.excursions import with_excursions
from gcode2krl.gap.posterior.families import Evidence
from gcode2krl.gap.posterior.likelihood import Key, Likelihood, refit
from gcode2krl.gap.posterior.selection import (
    Rival,
    examine,
    rival_probabilities,
    rivals_of,
    with_rival,
    with_set_rival,
)
from gcode2krl.gap.thresholds import THRESHOLDS

NAMED = THRESHOLDS.posterior.named
"""A cause counts as named from this probability on."""


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
    rivals: tuple[tuple[Rival, float], ...] | None = ()
    """None where no other effect was compared with it."""
    constant: Constancy | None = None
    tests: FamilyTests | None = None
    """What families say of it; None where they were not asked."""
    features: Features | None = None
    """The results of all tests; None where none was made."""
    family_probability: float | None = None
    """That place and family are right; None where they were not asked."""
    unknown_probability: float | None = None
    """That the library lacks what is at work; None where that was not asked."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """What every judgement of a link says; sizes are in the link's inner unit."""

    link: Link
    verdict: str
    causes: tuple[Cause, ...]
    size: Size
    held_out: bool
    factor: float
    """From the inner unit to that of the report."""
    nearly_all: bool = False
    """What is left of the gap is more than noise, but a small share of it."""
    size_with_named: Size | None = None
    """The size with the named causes alone in the model; None where that is ``size``."""

    @property
    def told(self) -> Size:
        """Return the size that the answer states: a cause without a name takes nothing of the gap."""
        return self.size if self.size_with_named is None else self.size_with_named

    @property
    def unknown(self) -> float | None:
        """Return the probability that the library lacks what is at work; None without a gap, or not asked."""
        if self.verdict == "no_gap":
            return None
        if not self.causes:
            return probabilities_table().unknown_without_cause
        return max(self.causes, key=lambda cause: cause.probability).unknown_probability

    @property
    def applied(self) -> tuple[Applied, ...]:
        """Return the named causes."""
        return tuple(cause.applied for cause in self.causes if cause.probability >= NAMED)

    @property
    def shrink(self) -> float | None:
        """Return the share of the explainable gap that is gone on held-out data; None without a name."""
        return self.told.shrink if self.applied and self.held_out else None

    @property
    def reported(self) -> tuple[Cause, ...]:
        """Return the causes that the answer lists: those of a gap."""
        return self.causes if self.verdict != "no_gap" else ()

    def without(self, applied: Applied) -> Self:
        """Return the judgement without a cause that a later link has shown to be elsewhere."""
        return replace(self, causes=tuple(cause for cause in self.causes if cause.applied != applied))


@dataclass(frozen=True, kw_only=True)
class Judgement(Judged):
    """The judgement of a link whose signal is one in time."""

    traces: tuple[Trace, ...]
    examination: Examination
    usual: tuple[Applied, ...] = field(default=())
    """Accepted effects that are within normal mismatch."""
    every: tuple[Trace, ...] = field(default=())
    """The traces with the held-out ones."""
    rest: Rest | None = None
    """On what depends what is left beside the named causes; None where it was not asked."""

    @property
    def events(self) -> tuple[Event, ...]:
        """Return the events of all runs, in the order of the runs."""
        return tuple(event for trace in self.every or self.traces for event in trace.events)

    @property
    def impulses(self) -> tuple[Event, ...]:
        """Return the events that are a gap by themselves: something hit or was hit."""
        return tuple(event for event in self.events if event.whose is Whose.IMPULSE)

    @property
    def slips(self) -> tuple[Event, ...]:
        """Return the changes of the level that another table shows too: they are of the machine."""
        return tuple(event for event in self.events if event.whose is Whose.SLIP and event.is_shared)

    def fitted(self, trace: Trace, stamps_s: Floats) -> Floats:
        """Return what the fitted model says of a trace's run at some stamps (n,), as (n, k).

        Without what only its instrument shows.
        """
        return fitted_signal(trace, self.examination, stamps_s)


_MOST_S = THRESHOLDS.posterior.clock_most_s
_ROUNDS = 2
"""The second takes off what the first leaves of its own linearisation."""
_RIDGE = 1e-6
"""Keeps columns apart that are equal to rounding; of unit length each."""


def with_set_clocks(traces: Sequence[Trace], question: Question, known: Signatures) -> list[Trace]:
    """Return the traces with each run's own clock error taken off its stamps; signatures stay as they are.

    What all runs share is kept where it is more than mismatch: it is a cause to be found.
    """
    traces = list(traces)
    if not traces or not traces[0].link.sets_clocks:
        return traces
    nuisance = nuisance_for(traces, question, known)
    limit_s = question.mismatch.clock_s * question.clocks
    unit_s = sigma(question.mismatch.clock_s) * question.clocks**0.5
    offsets_s = np.zeros(len(traces))
    current = traces
    for _ in range(_ROUNDS):
        offsets_s += [unit_s * _clock_of(trace, own) for trace, own in zip(current, nuisance, strict=True)]
        common_s = float(np.median(np.clip(offsets_s, -_MOST_S, _MOST_S)))
        kept_s = common_s if abs(common_s) > limit_s else 0.0
        offsets_s = kept_s + np.clip(offsets_s - kept_s, -limit_s, limit_s)
        moves_s = (offsets_s - kept_s).tolist()
        current = [_later(trace, move_s) for trace, move_s in zip(traces, moves_s, strict=True)]
        if kept_s:
            break
    for before, after in zip(traces, current, strict=True):
        known.same(before, after)
    return current


def _clock_of(trace: Trace, nuisance: Sequence[Nuisance]) -> float:
    """Return the coefficient of a trace's clock beside its other nuisance; 0 where it has none."""
    others = [each.columns for each in nuisance if each.name != CLOCK]
    clock = [each.columns for each in nuisance if each.name == CLOCK]
    return _coefficient(trace, clock[0], others) if clock else 0.0


def _later(trace: Trace, offset_s: float) -> Trace:
    """Return the trace with a clock error taken off: of the load encoders alone, or of the whole table."""
    if trace.link.own_clock:
        return replace(trace, plus_late_s=offset_s, clock_set_s=offset_s)
    return replace(trace, time_s=trace.time_s - offset_s, clock_set_s=offset_s)


def _coefficient(trace: Trace, clock: Floats, others: Sequence[Floats]) -> float:
    """Return the coefficient of the clock's column beside all that other mismatch could explain."""
    k, n, _ = clock.shape
    flat = np.concatenate([clock, *others], axis=2).reshape(k * n, -1)
    scale = np.sqrt(np.sum(flat**2, axis=0))
    good = scale > 0.0
    if not good[0]:
        return 0.0
    flat = flat[:, good] / scale[good]
    gram = flat.T @ flat
    gram[np.diag_indices_from(gram)] += _RIDGE
    coefficients = np.linalg.solve(gram, flat.T @ trace.residual.T.reshape(k * n))
    return float(coefficients[0] / scale[0])


def is_wander(
    examination: Examination, traces: Sequence[Trace], rest: Rest, effects_nats: float = 0.0
) -> bool:
    """Tell whether what is left of a link without any cause (`rest`, of these traces) is such a wander.

    ``effects_nats``: what the accepted effects say of it together. Trackers and force sensors wander; an
    encoder counts.
    """
    if (
        examination.link.of_joints
        or len(traces) < 2
        or not rest.study.evidences
        or not _is_own_time(rest.study.evidences)
    ):
        return False
    best = rest.study.evidences[0]
    if effects_nats > (1.0 - THRESHOLDS.posterior.time_ahead_share) * best.nats:
        return False
    if not _is_small(best, examination.noise):
        return False
    steady = [_less(trace, best, signal) for trace, signal in zip(traces, best.signal, strict=True)]
    for before, after in zip(traces, steady, strict=True):
        examination.data.known.same(before, after)  # what was measured changes no signature
    plain = _causes_taken_out(examination)
    nuisance = nuisance_for(steady, examination.question, examination.data.known)
    if size_of_gap(steady, nuisance, examination.noise, (), examination.mismatch).significant:
        return False
    return not LinkFamilies(plain, steady).rest.is_gap


def _is_own_time(evidences: Sequence[Evidence]) -> bool:
    """Tell whether time in each run, smoothly, says clearly more than every other input."""
    best = evidences[0]
    others = [each.nats for each in evidences if each.on is not Dependence.RUN_TIME]
    least = THRESHOLDS.posterior.alike_nats * best.inflation
    return best.on is Dependence.RUN_TIME and best.nats - max(others, default=0.0) > least


def _is_small(evidence: Evidence, noise: Sequence[Noise]) -> bool:
    """Tell whether a family moves each component by no more than slow noise may, and every run moves."""
    component = evidence.place.component
    at = slice(None) if component is None else slice(component, component + 1)
    rms = np.sqrt(np.mean(np.concatenate(evidence.signal) ** 2, axis=0))
    most = THRESHOLDS.noise.noise_most_slow * np.array([each.short_sigma for each in noise[at]])
    moved = [float(np.linalg.norm(np.std(signal, axis=0))) for signal in evidence.signal]
    is_stationary = min(moved) >= THRESHOLDS.posterior.noise_wander_share * max(moved)
    return is_stationary and bool(np.all(rms <= most))


def _less(trace: Trace, evidence: Evidence, signal: Floats) -> Trace:
    component = evidence.place.component
    measured = trace.measured.copy()
    if component is None:
        measured -= signal
    else:
        measured[:, component] -= signal[:, 0]
    return replace(trace, measured=measured)


def _causes_taken_out(examination: Examination) -> Examination:
    while examination.cause_numbers:
        number = examination.cause_numbers[-1]
        examination = examination.dropping(number, refit(examination.likelihood, examination.without(number)))
    return examination


_LIMITS = THRESHOLDS.posterior
_SURE_DEVIATIONS = 2.0
"""Of the excess on data not used, beyond which it is no chance."""
_LEAST_REST = 1e-6
"""Of the gap: nobody takes a share of less."""


def judge(link: Link, traces: Sequence[Trace], held: Sequence[Trace], question: Question) -> Judgement:
    """Examine a link on some traces and report on the held-out ones; without any, each held out in turn."""
    judged = _judged(link, traces, held, question)
    return replace(judged, examination=judged.examination.settled())


def _judged(link: Link, traces: Sequence[Trace], held: Sequence[Trace], question: Question) -> Judgement:
    known = Signatures()
    moved = with_set_clocks([*traces, *held], question, known)
    traces, held = moved[: len(traces)], moved[len(traces) :]
    examination, rivals, swaps = _settled(examine(link, traces, question, known))
    every = (*traces, *held)
    if not examination.causes:
        return _with_impulses(_with_excursions(_without_causes(examination.settled(), every)))
    trials = list(_trials(examination, held, swaps))
    examination = examination.settled()  # what families say of each cause needs as much memory again
    families = LinkFamilies(examination, every)
    counts = range(len(examination.causes) + 1)
    if trials:
        sizes = [pooled([trial.size(count) for trial in trials]) for count in counts]
    else:
        sizes = [_size(examination, traces, examination.causes[:count]) for count in counts]
    whole = _size(examination, traces, examination.causes)
    judged = _judgement(examination, sizes, whole, families, trials, rivals)
    with_named = _size_with_named(judged, sizes, trials)
    judged = replace(judged, every=every, size_with_named=with_named)
    judged = judged if judged.verdict != "explained" else _beside_its_rest(judged, whole)
    return _with_impulses(_with_excursions(judged))


def _settled(examination: Examination) -> tuple[Examination, dict[int, list[Rival]], dict[Key, Applied]]:
    """Return the examination in which no rival of a cause is better than it, with the rivals and the swaps.

    The rivals of each cause by its number; what was put in place of the effects that were accepted first.
    """
    swaps: dict[Key, Applied] = {}
    while True:
        rivals = {number: rivals_of(examination, number) for number in examination.cause_numbers}
        better = [
            (each, number)
            for number, every in rivals.items()
            for each in every
            if each.is_better and not (examination.is_of_set(number) and each.is_rarer)
        ]
        if not better or len(swaps) >= len(examination.causes):
            break
        best, number = min(better, key=lambda pair: pair[0].cost_difference)
        swapped = with_rival(examination, number, best.applied)
        if swapped is None or swapped.cost >= examination.cost:
            break
        swaps[examination.applied[number].key] = best.applied
        examination = swapped
    rivals = {number: with_set_rival(examination, number, each) for number, each in rivals.items()}
    return examination, rivals, swaps


def _with_excursions(judged: Judgement) -> Judgement:
    """Return the judgement; where there is no gap, with what moves its signal one way in few stretches."""
    if judged.verdict != "no_gap":
        return judged
    examination = judged.examination
    nuisance = nuisance_for(judged.every, examination.question, examination.data.known)
    likelihood = Likelihood(judged.every, nuisance, examination.noise)
    rests = unexplained_by_mismatch(
        likelihood, [trace.measured - trace.sample(judged.usual) for trace in judged.every]
    )
    return replace(judged, every=with_excursions(likelihood, rests))


def _with_impulses(judged: Judgement) -> Judgement:
    """Return the judgement: an impulse of the machine is a gap whose rows no other test has.

    A change that two tables show is one, too, where nothing else tells of it.
    """
    if judged.slips and judged.verdict == "no_gap":
        return replace(judged, verdict="unexplained")
    if judged.impulses and judged.verdict in ("no_gap", "explained"):
        verdict = "unexplained" if judged.verdict == "no_gap" else "partly_explained"
        return replace(judged, verdict=verdict, nearly_all=judged.verdict == "explained")
    return judged


def _beside_its_rest(judged: Judgement, whole: Size) -> Judgement:
    """Return the judgement: a gap is not explained beside a rest that noise and mismatch do not explain.

    The rest must show in the data that explained too: on held-out data alone it is what few runs do not
    settle of a cause's numbers, as the moment of a step in the run that is held out. Where it is a small
    share of the gap, later links go by the model all the same. ``whole`` is the size with all causes.
    """
    if len(judged.applied) < len(judged.causes):
        whole = _size(judged.examination, judged.traces, judged.applied)
    families = judged.rest is not None and judged.rest.is_gap and judged.link.model_rms == 0.0
    if not (families or (judged.told.significant and whole.significant)):
        return judged
    return replace(judged, verdict="partly_explained", nearly_all=True)


def _size_with_named(judged: Judgement, sizes: Sequence[Size], trials: Sequence["_Trial"]) -> Size | None:
    """Return the size with the named causes alone in the model; None where all of the causes are named."""
    named = judged.applied
    if len(named) == len(judged.causes):
        return None
    if not named:
        return sizes[0]
    if trials:
        return pooled([trial.size_with(named) for trial in trials])
    return _size(judged.examination, judged.traces, named)


def _size(examination: Examination, traces: Sequence[Trace], causes: Sequence[Applied]) -> Size:
    """Return the size of the gap of some traces, with and without causes."""
    nuisance = nuisance_for(traces, examination.question, examination.data.known)
    return size_of_gap(traces, nuisance, examination.noise, causes, examination.mismatch)


def _without_causes(examination: Examination, every: tuple[Trace, ...]) -> Judgement:
    size = _size(examination, every, ())
    # families say nothing of a model that is met to its own accuracy: what it leaves is no noise
    is_asked = size.significant or examination.link.model_rms == 0.0
    unnamed = LinkFamilies(examination, every).rest if is_asked else NOTHING_LEFT
    unnamed = replace(unnamed, is_sized=size.significant)
    is_gap = _is_gap(examination, size, unnamed) and not is_wander(examination, every, unnamed)
    verdict = "unexplained" if is_gap else "no_gap"
    return replace(_of(examination, verdict, (), size, unnamed, held_out=True), every=every)


def _of(
    examination: Examination,
    verdict: str,
    causes: tuple[Cause, ...],
    size: Size,
    unnamed: Rest,
    *,
    held_out: bool,
) -> Judgement:
    return Judgement(
        link=examination.link,
        verdict=verdict,
        causes=causes,
        size=size,
        held_out=held_out,
        factor=examination.traces[0].factor,
        traces=examination.traces,
        examination=examination,
        usual=examination.mismatch,
        rest=unnamed,
    )


# Held-out data


@dataclass(frozen=True, eq=False)
class _Trial:
    """Held-out traces and what the other traces say is at work."""

    chosen: Examination
    held: Sequence[Trace]
    causes: tuple[Applied, ...]
    """What all traces say is at work."""
    is_fold: bool
    """Some of the traces were held out for it: what is chosen is chosen anew."""

    def size(self, count: int) -> Size:
        """Return the size of the held-out gap with those of its effects that are among the first causes."""
        if count >= len(self.causes):
            return _size(self.chosen, self.held, self.chosen.causes)
        return self.size_with(self.causes[:count])

    def size_with(self, named: Sequence[Applied]) -> Size:
        """Return the size of the held-out gap with those of its effects that bear these names."""
        keys = [applied.key for applied in named]
        causes = [applied for applied in self.chosen.causes if applied.key in keys]
        return _size(self.chosen, self.held, causes)


def _trials(
    examination: Examination, held: Sequence[Trace], swaps: Mapping[Key, Applied]
) -> Iterator[_Trial]:
    """Yield one trial a split: what was chosen without the held-out data, and these.

    ``swaps``: better rivals of what is accepted first, which take their place in each split too.
    """
    if held:
        yield _Trial(examination.chosen(), held, examination.causes, is_fold=False)
        return
    power = [
        np.sum((trace.sample(examination.causes) - trace.nominal) ** 2, axis=1)
        for trace in examination.traces
    ]  # of what the causes do in each row
    for train, test in folds_of(examination.traces, power):
        chosen = examine(
            examination.link, train, examination.question, examination.data.known, examination.noise
        )
        for key, rival in swaps.items():
            number = next((i for i, each in enumerate(chosen.applied) if each.key == key), None)
            chosen = (None if number is None else with_rival(chosen, number, rival)) or chosen
        yield _Trial(chosen.chosen(), test, examination.causes, is_fold=True)


# Causes and verdict


def _judgement(
    examination: Examination,
    sizes: Sequence[Size],
    whole: Size,
    families: LinkFamilies,
    trials: Sequence[_Trial],
    rivals: Mapping[int, Sequence[Rival]],
) -> Judgement:
    """Return the judgement from the sizes of the gap with the first 0, 1, 2 … causes.

    ``whole`` is the size on the data that the causes were fitted to.
    """
    last = sizes[-1]
    # what is left on held-out data alone is what few runs do not settle of a cause's numbers
    is_significant = last.significant and whole.significant
    every = replace(families.rest, is_sized=is_significant)
    all_causes = list(_causes(examination, sizes, families, every, trials, rivals))
    if _leave_much(examination, all_causes, sizes, trials):
        all_causes = [_unnamed(cause) for cause in all_causes]
    elif examination.question.unnamed_before:
        all_causes = [_unnamed(each) if _may_follow(examination, each) else each for each in all_causes]
    causes = sorted(all_causes, key=lambda cause: -cause.probability)
    named = [examination.applied.index(cause.applied) for cause in causes if cause.probability >= NAMED]
    is_sized = is_significant if named else sizes[0].significant
    unnamed = replace(families.beside(named), is_sized=is_sized)
    is_left = is_significant and last.share_left >= THRESHOLDS.posterior.other_share
    # loud rows that the causes tell on data not used are no bursts of an instrument
    is_foretold = bool(trials) and sizes[0].is_loud and last.share_left <= _LIMITS.named_left
    is_gap = _is_gap(examination, sizes[0], unnamed) or is_foretold
    if not named and is_gap:
        is_gap = not is_wander(examination, families.traces, unnamed, families.effects_nats)
    verdict = _verdict(bool(named), is_left or bool(unnamed.worth_naming), is_gap)
    return _of(examination, verdict, tuple(causes), last, unnamed, held_out=bool(trials))


def _leave_much(
    examination: Examination, causes: Sequence[Cause], sizes: Sequence[Size], trials: Sequence["_Trial"]
) -> bool:
    """Tell whether the named causes leave a large share of the gap on data not used: then they are not it."""
    named = [cause.applied for cause in causes if cause.probability >= NAMED]
    if not named or not trials or examination.link.model_rms:
        return False
    size = sizes[-1] if len(named) == len(causes) else pooled([trial.size_with(named) for trial in trials])
    return size.share_left > _LIMITS.named_left and size.excess > _SURE_DEVIATIONS * size.deviation


def _may_follow(examination: Examination, cause: Cause) -> bool:
    """Tell whether what a cause does may be what an unnamed gap of a link before it does here.

    It acts in the same joint, or it changes as that does: a share of its power is a sum of the gap's
    components, offsets apart.
    """
    unnamed = [each for each in examination.question.unnamed_before if isinstance(each, Judgement)]
    if len(unnamed) < len(examination.question.unnamed_before):
        return True
    families = [each for judged in unnamed if judged.rest for each in judged.rest.worth_naming]
    if any(each.place.name == cause.applied.target for each in families):
        return True
    others = examination.without(examination.applied.index(cause.applied))
    gaps, moved = [], []
    for trace in examination.traces:
        of_run = [_unexplained_at(trace, judged) for judged in unnamed]
        if all(gap is not None for gap in of_run):
            columns = np.concatenate([gap for gap in of_run if gap is not None], axis=1)
            gaps.append(columns - columns.mean(axis=0))  # an encoder's offset is no gap
            moved.append(trace.sample(examination.applied) - trace.sample(others))
    if not gaps or len({columns.shape[1] for columns in gaps}) > 1:
        return True  # runs that measured other joints cannot be asked together
    return share_told(np.concatenate(gaps), np.concatenate(moved)) > _LIMITS.follows_share


def _unexplained_at(trace: Trace, judged: Judgement) -> Floats | None:
    """Return what a judged link leaves of a trace's run, at its stamps: (n, k); None without that run."""
    measured = next((other for other in judged.every if other.run_number == trace.run_number), None)
    if measured is None:
        return None
    gap = measured.measured - judged.fitted(measured, measured.time_s)
    return np.stack([np.interp(trace.time_s, measured.time_s, column) for column in gap.T], axis=1)


def share_told(columns: Floats, signal: Floats) -> float:
    """Return the share of a signal's power (n, k) that sums of some columns (n, c) take."""
    fitted = columns @ np.linalg.lstsq(columns, signal, rcond=None)[0]
    return float(np.sum(fitted**2) / max(np.sum(signal**2), 1e-300))


def _unnamed(cause: Cause) -> Cause:
    """Return a cause without a name, but for one that plans the motion anew: all links show that one."""
    if cause.applied.effect.plans_anew:
        return cause
    return replace(cause, probability=min(cause.probability, MOST_UNNAMED))


def _is_gap(examination: Examination, size: Size, rest: Rest) -> bool:
    """Tell whether there is a gap: by its size, or by what it depends on.

    A model that is met to its own accuracy leaves what no noise explains, and is met all the same.
    """
    return size.significant or (rest.is_gap and examination.link.model_rms == 0.0)


def _verdict(named: bool, is_left: bool, gap: bool) -> str:
    if named:
        return "partly_explained" if is_left else "explained"
    return "unexplained" if gap else "no_gap"


def _causes(
    examination: Examination,
    sizes: Sequence[Size],
    families: LinkFamilies,
    every: Rest,
    trials: Sequence[_Trial],
    compared: Mapping[int, Sequence[Rival]],
) -> Iterator[Cause]:
    """Yield the causes in the order in which they were accepted; ``every`` is what all of them leave."""
    intervals = intervals_of(examination)
    for order, number in enumerate(examination.cause_numbers):
        tests, constant, rivals = families.tests[order], constancy_of(examination, number), compared[number]
        features = features_of(
            examination,
            number,
            tests=tests,
            gap_p=families.gap_p[order],
            constant=constant,
            parameters=intervals[number],
            held_out=_held_out(examination, order, sizes, every, trials),
        )
        table = probabilities_table()
        probability = table.name(features)
        yield Cause(
            applied=examination.applied[number],
            link=examination.link.name,
            probability=probability,
            parameters=intervals[number],
            shrink=max(0.0, sizes[order + 1].shrink - sizes[order].shrink) if trials else None,
            rms_after=sizes[order + 1].after ** 0.5,
            rivals=tuple(zip(rivals, rival_probabilities(rivals, probability), strict=True)),
            constant=constant,
            tests=tests,
            features=features,
            family_probability=table.family(features),
            unknown_probability=table.unknown(features),
        )


def _held_out(
    examination: Examination, order: int, sizes: Sequence[Size], every: Rest, trials: Sequence[_Trial]
) -> HeldOut:
    """Return what held-out data say of a cause, by its place in the order of acceptance."""
    number = examination.cause_numbers[order]
    share_left = sizes[-1].share_left if every.is_sized else 0.0
    if not trials:
        return HeldOut(None, None, None, None, share_left)
    before, after = sizes[order].shrink, sizes[order + 1].shrink
    if examination.is_of_set(number):  # what several do together none does beside the first ones alone
        others = [examination.applied[cause] for cause in examination.cause_numbers if cause != number]
        without = [trial.size_with(others) for trial in trials]
        before, after = pooled(without).shrink, sizes[-1].shrink
    gone = max(0.0, after - before)
    applied = examination.applied[number]
    folds = [trial for trial in trials if trial.is_fold]
    agreeing = sum(applied.key in trial.chosen.accepted_keys for trial in folds)
    return HeldOut(
        agreeing / len(folds) if folds else None,
        gone / max(1.0 - before, _LEAST_REST),
        gone if _acts_where_others_do(examination, number) else 1.0,
        sizes[-1].shrink,
        share_left,
    )


def _acts_where_others_do(examination: Examination, number: int) -> bool:
    """Tell whether a cause acts where those before it do: in the same joints, say.

    Only there can it be what is left of their form. False of the first one.
    """
    before = [other for other in examination.cause_numbers if other < number]
    rows = examination.rows_changed(number)
    if not before or not rows.any():
        return False
    others = np.any([examination.rows_changed(other) for other in before], axis=0)
    return float(np.mean(others[rows])) > _LIMITS.together_share
