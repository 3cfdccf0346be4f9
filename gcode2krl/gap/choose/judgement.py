"""One link, from its traces to a judgement: causes, their probability, and what held-out data say of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.gap.beside.holdout import folds_of
from gcode2krl.gap.beside.links.base import Link
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.calibrated import MOST_UNNAMED, probabilities_table
from gcode2krl.gap.choose.constancy import constancy_of
from gcode2krl.gap.choose.examination import Examination, Key
from gcode2krl.gap.choose.family_tests import NOTHING_LEFT, LinkFamilies, Rest
from gcode2krl.gap.choose.features import HeldOut, features_of
from gcode2krl.gap.choose.gap_size import Size, pooled, size_of_gap
from gcode2krl.gap.choose.intervals import intervals_of
from gcode2krl.gap.choose.judged import NAMED, Cause, Judgement
from gcode2krl.gap.choose.rivals import Rival, rival_probabilities, rivals_of
from gcode2krl.gap.choose.selection import examine, with_rival
from gcode2krl.gap.choose.set_clocks import with_set_clocks
from gcode2krl.gap.choose.wander import is_wander
from gcode2krl.gap.fit.design import Question, nuisance_for
from gcode2krl.gap.fit.signatures import Signatures
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
_SURE_DEVIATIONS = 2.0
"""Of the excess on data not used, beyond which it is no chance."""
_LEAST_REST = 1e-6
"""Of the gap: nobody takes a share of less."""


def judge(link: Link, traces: Sequence[Trace], held: Sequence[Trace], question: Question) -> Judgement:
    """Examine a link on some traces and report on the held-out ones; without any, each held out in turn."""
    judged = _judged(link, traces, held, question)
    found = judged.examination
    return replace(judged, examination=replace(found, data=found.data.settled()))


def _judged(link: Link, traces: Sequence[Trace], held: Sequence[Trace], question: Question) -> Judgement:
    known = Signatures()
    moved = with_set_clocks([*traces, *held], question, known)
    traces, held = moved[: len(traces)], moved[len(traces) :]
    found, rivals, swaps = _settled(examine(link, traces, question, known))
    every = (*traces, *held)
    if not found.causes:
        return _with_impulses(_without_causes(found, every))
    families = LinkFamilies(found, every)
    trials = list(_trials(found, held, swaps))
    counts = range(len(found.causes) + 1)
    if trials:
        sizes = [pooled([trial.size(count) for trial in trials]) for count in counts]
    else:
        sizes = [_size(found, traces, found.causes[:count]) for count in counts]
    whole = _size(found, traces, found.causes)
    judged = _judgement(found, sizes, whole, families, trials, rivals)
    with_named = _size_with_named(judged, sizes, trials)
    judged = replace(judged, every=every, size_with_named=with_named)
    return _with_impulses(judged if judged.verdict != "explained" else _beside_its_rest(judged, whole))


def _settled(found: Examination) -> tuple[Examination, dict[int, list[Rival]], dict[Key, Applied]]:
    """Return the examination in which no rival of a cause is better than it, with the rivals and the swaps.

    The rivals of each cause by its number; what was put in place of the effects that were accepted first.
    """
    swaps: dict[Key, Applied] = {}
    while True:
        rivals = {number: rivals_of(found, number) for number in found.cause_numbers}
        better = [(each[0], number) for number, each in rivals.items() if each and each[0].is_better]
        if not better or len(swaps) >= len(found.causes):
            return found, rivals, swaps
        best, number = min(better, key=lambda pair: pair[0].cost_difference)
        swapped = with_rival(found, number, best.applied)
        if swapped is None or swapped.cost >= found.cost:
            return found, rivals, swaps
        swaps[_key(found.applied[number])] = best.applied
        found = swapped


def _key(applied: Applied) -> Key:
    return applied.effect.name, applied.target


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


def _size(found: Examination, traces: Sequence[Trace], causes: Sequence[Applied]) -> Size:
    """Return the size of the gap of some traces, with and without causes."""
    nuisance = nuisance_for(traces, found.question, found.data.known)
    return size_of_gap(traces, nuisance, found.noise, causes, found.mismatch)


def _without_causes(found: Examination, every: tuple[Trace, ...]) -> Judgement:
    size = _size(found, every, ())
    # families say nothing of a model that is met to its own accuracy: what it leaves is no noise
    is_asked = size.significant or found.link.model_rms == 0.0
    rest = LinkFamilies(found, every).rest if is_asked else NOTHING_LEFT
    rest = replace(rest, is_sized=size.significant)
    is_gap = _is_gap(found, size, rest) and not is_wander(found, every, rest)
    verdict = "unexplained" if is_gap else "no_gap"
    return replace(_of(found, verdict, (), size, rest, held_out=True), every=every)


def _of(
    found: Examination,
    verdict: str,
    causes: tuple[Cause, ...],
    size: Size,
    rest: Rest,
    *,
    held_out: bool,
) -> Judgement:
    return Judgement(
        link=found.link,
        verdict=verdict,
        causes=causes,
        size=size,
        held_out=held_out,
        factor=found.traces[0].factor,
        traces=found.traces,
        examination=found,
        usual=found.mismatch,
        rest=rest,
    )


# Held-out data


@dataclass(frozen=True, eq=False)
class _Trial:
    """Held-out traces and what the other traces say is at work."""

    chosen: Examination
    held: Sequence[Trace]
    main: Examination

    def size(self, count: int) -> Size:
        """Return the size of the held-out gap with those of its effects that are among the first causes."""
        causes = self.chosen.causes
        if count < len(self.main.causes):
            names = [(each.effect.name, each.target) for each in self.main.causes[:count]]
            causes = tuple(each for each in causes if (each.effect.name, each.target) in names)
        return _size(self.chosen, self.held, causes)

    def size_with(self, named: Sequence[Applied]) -> Size:
        """Return the size of the held-out gap with those of its effects that bear these names."""
        names = [(each.effect.name, each.target) for each in named]
        causes = [each for each in self.chosen.causes if (each.effect.name, each.target) in names]
        return _size(self.chosen, self.held, causes)


def _trials(found: Examination, held: Sequence[Trace], swaps: Mapping[Key, Applied]) -> Iterator[_Trial]:
    """Yield one trial a split: what was chosen without the held-out data, and these.

    ``swaps``: better rivals of what is accepted first, which take their place in each split too.
    """
    if held:
        yield _Trial(found, held, found)
        return
    power = [
        np.sum((trace.sample(found.causes) - trace.nominal) ** 2, axis=1) for trace in found.traces
    ]  # of what the causes do in each row
    for train, test in folds_of(found.traces, power):
        chosen = examine(found.link, train, found.question, found.data.known, found.noise)
        for key, rival in swaps.items():
            number = next((i for i, each in enumerate(chosen.applied) if _key(each) == key), None)
            chosen = (None if number is None else with_rival(chosen, number, rival)) or chosen
        yield _Trial(chosen, test, found)


# Causes and verdict


def _judgement(
    found: Examination,
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
    left = last.significant and whole.significant
    every = replace(families.rest, is_sized=left)
    told = list(_causes(found, sizes, families, every, trials, rivals))
    if found.question.behind_unknown or _leave_much(found, told, sizes, trials):
        told = [_unnamed(cause) for cause in told]
    causes = sorted(told, key=lambda cause: -cause.probability)
    named = [found.applied.index(cause.applied) for cause in causes if cause.probability >= NAMED]
    is_sized = left if named else sizes[0].significant
    rest = replace(families.beside(named), is_sized=is_sized)
    is_left = left and last.share_left >= THRESHOLDS.families.other_share
    is_gap = _is_gap(found, sizes[0], rest)
    if not named and is_gap:
        is_gap = not is_wander(found, families.traces, rest)
    verdict = _verdict(bool(named), is_left or bool(rest.worth_naming), is_gap)
    return _of(found, verdict, tuple(causes), last, rest, held_out=bool(trials))


def _leave_much(
    found: Examination, told: Sequence[Cause], sizes: Sequence[Size], trials: Sequence["_Trial"]
) -> bool:
    """Tell whether the named causes leave a large share of the gap on data not used: then they are not it."""
    named = [cause.applied for cause in told if cause.probability >= NAMED]
    if not named or not trials or found.link.model_rms:
        return False
    size = sizes[-1] if len(named) == len(told) else pooled([trial.size_with(named) for trial in trials])
    return size.share_left > _LIMITS.named_left and size.excess > _SURE_DEVIATIONS * size.deviation


def _unnamed(cause: Cause) -> Cause:
    """Return a cause without a name, but for one that plans the motion anew: all links show that one."""
    if cause.applied.effect.plans_anew:
        return cause
    return replace(cause, probability=min(cause.probability, MOST_UNNAMED))


def _is_gap(found: Examination, size: Size, rest: Rest) -> bool:
    """Tell whether there is a gap: by its size, or by what it depends on.

    A model that is met to its own accuracy leaves what no noise explains, and is met all the same.
    """
    return size.significant or (rest.is_gap and found.link.model_rms == 0.0)


def _verdict(named: bool, rest: bool, gap: bool) -> str:
    if named:
        return "partly_explained" if rest else "explained"
    return "unexplained" if gap else "no_gap"


def _causes(
    found: Examination,
    sizes: Sequence[Size],
    families: LinkFamilies,
    every: Rest,
    trials: Sequence[_Trial],
    compared: Mapping[int, Sequence[Rival]],
) -> Iterator[Cause]:
    """Yield the causes in the order in which they were accepted; ``every`` is what all of them leave."""
    intervals = intervals_of(found)
    for order, number in enumerate(found.cause_numbers):
        tests, constant, rivals = families.tests[order], constancy_of(found, number), compared[number]
        features = features_of(
            found,
            number,
            tests=tests,
            rest=every,
            gap_p=families.gap_p[order],
            constant=constant,
            parameters=intervals[number],
            rivals=rivals,
            held_out=_held_out(found, order, sizes, every, trials),
        )
        table = probabilities_table()
        probability = table.name(features)
        yield Cause(
            applied=found.applied[number],
            link=found.link.name,
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
    found: Examination, order: int, sizes: Sequence[Size], every: Rest, trials: Sequence[_Trial]
) -> HeldOut:
    """Return what held-out data say of a cause, by its place in the order of acceptance."""
    number = found.cause_numbers[order]
    share_left = sizes[-1].share_left if every.is_sized else 0.0
    if not trials:
        return HeldOut(None, None, None, None, share_left)
    before, after = sizes[order].shrink, sizes[order + 1].shrink
    gone = max(0.0, after - before)
    applied = found.applied[number]
    folds = [trial for trial in trials if trial.chosen is not found]
    agreeing = sum((applied.effect.name, applied.target) in trial.chosen.accepted_keys for trial in folds)
    return HeldOut(
        agreeing / len(folds) if folds else None,
        gone / max(1.0 - before, _LEAST_REST),
        gone if _acts_where_others_do(found, number) else 1.0,
        sizes[-1].shrink,
        share_left,
    )


def _acts_where_others_do(found: Examination, number: int) -> bool:
    """Tell whether a cause acts where those before it do: in the same joints, say.

    Only there can it be what is left of their form. False of the first one.
    """
    before = [other for other in found.cause_numbers if other < number]
    rows = found.rows_changed(number)
    if not before or not rows.any():
        return False
    others = np.any([found.rows_changed(other) for other in before], axis=0)
    return float(np.mean(others[rows])) > _LIMITS.together_share
