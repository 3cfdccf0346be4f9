"""One link: noise, candidates, forward selection with refits, and what is left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied, Effect
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.beside.links.base import Link
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.scoring import (
    LEAST_RATIO,
    Column,
    Score,
    scores,
    surprise,
    threshold,
)  # fmt: skip
from gcode2krl.gap.fit.gram import Ledger, rows_of
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.noise import Noise
from gcode2krl.gap.fit.noise_source import noise_of
from gcode2krl.gap.fit.nuisance import Nuisance, nuisance_of
from gcode2krl.gap.fit.numbers import Fitted, free_of
from gcode2krl.gap.fit.place_times import PlaceTimes
from gcode2krl.gap.fit.refitting import refit, searched
from gcode2krl.gap.fit.sensitivity import slope_of
from gcode2krl.gap.fit.signatures import Block, Signatures

MOST_EFFECTS = 4
_SHORTLIST = 5
_MOST_TRIED = 12
_GROUPS = 4
_HOPELESS = 3.0
"""An effect that plans anew and leaves so many times more than another one is no match for it."""
_CLOSE_SHARE, _CLOSE_GAIN = 0.15, 12.0
"""Rivals within this of the best linear gain are refitted too: signatures hold for small effects only."""
PRUNE = 0.05
_ACTS = 1e-6
_MARGIN = 1.0
_SLACK = 1.15
"""Bounds of normal mismatch are round numbers."""
_STARTS = (1.0, -0.7, 3.0)
_FIRST_STEPS, _BEHIND = 3, 0.2
"""After so many steps of a refit one that is behind the best by this share of its gain is given up."""
_QUIETER = 0.7
"""Noise that has less than this of its power beside the causes is taken anew."""
_BENT_SHARE = 0.4
"""An effect that is not proportional to its size may look so much worse before its refit."""


@dataclass(frozen=True)
class Question:
    """What a link is examined for."""

    library: Mapping[str, Effect]
    blocks: Sequence[Block]
    mismatch: Mismatch
    upstream: frozenset[str]
    clocks: int = 1
    """How many clocks of their own the compared signals have."""
    clock_share: float = 1.0
    """Of the clocks' normal mismatch, what is left after they were set."""
    seed: int = 0


@dataclass(eq=False)
class Examination:
    """What one link's data say."""

    link: Link
    traces: list[Trace]
    noise: list[Noise]
    nuisance: list[list[Nuisance]]
    blocks: list[Block]
    columns: list[Column]
    signatures: Signatures
    ledger: Ledger
    target: Likelihood
    fitted: Fitted
    level: float
    question: Question
    surprises: list[float] = field(default_factory=list)
    seen: list[tuple[float, float]] = field(default_factory=list)
    """Of each block the share of its power that nuisance leaves, and that power over the noise's."""
    first_level: float = 0.0
    usual: list[bool] = field(default_factory=list)
    """Which of the fitted effects are within normal mismatch: in the model, but no finding."""

    @property
    def applied(self) -> tuple[Applied, ...]:
        """Return the accepted effects, those within normal mismatch included."""
        return self.fitted.applied

    @property
    def causes(self) -> tuple[Applied, ...]:
        """Return the accepted effects that are more than normal mismatch."""
        return tuple(a for a, usual in zip(self.fitted.applied, self.usual, strict=True) if not usual)

    @cached_property
    def place_times(self) -> PlaceTimes:
        """The times at which the runs are at each place."""
        return PlaceTimes(self.traces)

    @property
    def values(self) -> int:
        """Return the number of values."""
        return sum(trace.measured.size for trace in self.traces)

    @property
    def times(self) -> int:
        """Return the number of times at which there are values."""
        return sum(len(trace.time_s) for trace in self.traces)


def examine(
    link: Link, traces: Sequence[Trace], question: Question, signatures: Signatures | None = None,
    noise: list[Noise] | None = None,
) -> Examination:  # fmt: skip
    """Choose and fit effects for a link, from these parts alone."""
    traces = list(traces)
    known = signatures or Signatures()
    nuisance = nuisance_for(traces, question, known)
    blocks, columns, stacked = columns_of(question.blocks, traces, known)
    given = noise
    noise = given or noise_of(traces, stacked, nuisance)
    ledger = Ledger([
        rows_of(trace, s, own, noise) for trace, s, own in zip(traces, stacked, nuisance, strict=True)
    ])  # fmt: skip
    target = Likelihood(traces, nuisance, noise)
    start = refit(target, ())
    found = Examination(
        link,
        traces,
        noise,
        nuisance,
        blocks,
        columns,
        known,
        ledger,
        target,
        start,
        0.0,
        question,
    )
    _select(found)
    if given is None and found.causes:
        # what rings or hums looks like noise until its cause is known
        less = noise_of(traces, stacked, nuisance, found.applied)
        if sum(each.sigma**2 for each in less) < _QUIETER * sum(each.sigma**2 for each in noise):
            return examine(link, traces, question, known, less)
    return found


def nuisance_for(traces: Sequence[Trace], question: Question, known: Signatures) -> list[list[Nuisance]]:
    """Return the nuisance of each trace, the shared ones of all traces in one order."""
    return _aligned([
        nuisance_of(
            trace, question.library, question.mismatch, known, question.upstream,
            question.clocks**0.5 * question.clock_share,
        )
        for trace in traces
    ])  # fmt: skip


def _select(found: Examination) -> None:
    rejected: set[tuple[str, str | None]] = set()
    while len(found.causes) < MOST_EFFECTS and len(found.applied) < 2 * MOST_EFFECTS:
        if _is_sound(found):
            break
        _update(found)
        evidence = found.ledger.evidence()
        columns = [column.moved(found.ledger.given) for column in found.columns]
        if not found.seen:
            found.seen = [found.ledger.seen(evidence, column.index) for column in columns]
            found.first_level = threshold(len(columns))
        taken = {(each.effect.name, each.target) for each in found.applied} | rejected
        allowed = [column for column in columns if found.blocks[column.block].key not in taken]
        found.level = threshold(len(allowed))
        ranked = _candidates(found, evidence.rows, allowed)
        if not _accept(found, ranked, evidence.rows, rejected):
            break
    _prune(found)


def _is_sound(found: Examination) -> bool:
    """Tell whether the path is met to the accuracy of the model, which is no noise that averages out."""
    return found.link.model_rms > 0.0 and found.fitted.chi2 < found.values


def _candidates(found: Examination, rows: int, allowed: Sequence[Column]) -> list[Score]:
    """Return the plausible and surprising scores, the best first."""
    plain = [
        score
        for score in scores(found.ledger, allowed)
        if (score.within or found.blocks[score.column.block].effect.plans_anew)
        and score.surprise > found.level
        and score.gain > LEAST_RATIO**2 * found.times
    ]
    plain.sort(key=lambda score: -_worth(score, rows))
    sure = []
    for score in plain[:_MOST_TRIED]:
        # a signature holds for small effects only: that of a large one is judged after its refit
        effect = found.blocks[score.column.block].effect
        small = score.gain < found.times and effect.is_linear
        inflation = found.ledger.inflation(score.column.index) if small else 1.0
        if surprise(score.gain / inflation, score.column.width) > found.level:
            sure.append(score)
    return sure


def _accept(
    found: Examination, ranked: list[Score], rows: int, rejected: set[tuple[str, str | None]]
) -> bool:
    """Refit the best few and accept the one that explains most; False where none holds."""
    while ranked:
        short = _shortlist(found, ranked, rows)
        tried: list[tuple[float, Score, Fitted]] = []
        best = np.inf
        for score in short:
            block = found.blocks[score.column.block]
            start = block.applied(score.coefficients, found.traces[0])
            if block.effect.plans_anew:
                fitted = _replanned(found, block, start, _HOPELESS * best)
                best = min(best, fitted.chi2)
            else:
                alone = len(start.effect.parameters) == 1
                start = _best_of(found, start)
                fitted = refit(found.target, (*found.applied, start), steps=_FIRST_STEPS, scan=alone)
                best = min(best, fitted.chi2)
                if fitted.chi2 <= best + _BEHIND * (found.fitted.chi2 - best):
                    fitted = refit(found.target, fitted.applied)
                    best = min(best, fitted.chi2)
            tried.append((fitted.chi2 + fitted.occam, score, fitted))
        tried.sort(key=lambda each: each[0])
        for _, score, fitted in tried:
            certain = _certain(found, score, fitted)
            if certain is None:
                rejected.add(found.blocks[score.column.block].key)
                continue
            found.fitted = fitted
            found.surprises.append(certain)
            found.usual.append(False)
            found.usual = [within_mismatch(found, number) for number in range(len(found.usual))]
            return True
        ranked = [score for score in ranked if found.blocks[score.column.block].key not in rejected]
    return False


def _best_of(found: Examination, start: Applied) -> Applied:
    """Return the best of what looks like an effect to first order."""
    tried = [replace(start, values=values) for values in start.effect.alternatives(start.values)]
    if len(tried) == 1:
        return start
    return min(tried, key=lambda one: float(np.sum(found.target.residual((*found.applied, one)) ** 2)))


def _certain(found: Examination, score: Score, fitted: Fitted) -> float | None:
    """Return how surprising the last effect of a refit is without it; None where it is not to be accepted."""
    gain = found.fitted.chi2 - fitted.chi2
    if fitted.bound[-1] or gain < LEAST_RATIO**2 * found.times:
        return None
    slope = slope_of(found.target, fitted, len(fitted.applied) - 1)
    certain = surprise(gain / slope.inflation(), score.column.width)
    if certain < found.level:
        return None
    if score_effect(found, score).plans_anew:
        return certain
    before = found.target.residual(found.applied)
    return certain if slope.left_out_gain(before, _GROUPS) > 0.0 else None


def within_mismatch(found: Examination, number: int) -> bool:
    """Tell whether every number of an accepted effect may be what normal mismatch allows, to 1 sigma."""
    applied, question = found.fitted.applied[number], found.question
    trace = found.traces[0]
    duration = float(trace.time_s[-1] - trace.time_s[0])
    limits = question.mismatch.limits(applied, duration, question.clocks)
    if not limits:
        return False
    if applied.effect.plans_anew:
        return _time_off_s(found, applied) <= question.mismatch.clock_s
    nominal = applied.effect.nominal(trace.inputs, applied.target)
    deviation = found.fitted.deviations(number)
    return all(
        abs(applied.values[name] - nominal[name])
        <= _SLACK * limits.get(name, 0.0) + _MARGIN * deviation.get(name, 0.0)
        for name in applied.effect.names
        if not applied.effect.parameter(name).is_shape
    )


def _time_off_s(found: Examination, applied: Applied) -> float:
    """Return by how much an effect moves the signals in time, as the time by which they would do as much."""
    change = sum(float(np.sum((trace.sample([applied]) - trace.nominal) ** 2)) for trace in found.traces)
    rate = sum(float(np.sum(trace.rate**2)) for trace in found.traces)
    return float(np.sqrt(change / rate)) if rate > 0.0 else 0.0


def score_effect(found: Examination, score: Score) -> Effect:
    """Return the effect of a score."""
    return found.blocks[score.column.block].effect


def _shortlist(found: Examination, ranked: list[Score], rows: int) -> list[Score]:
    """Return the best block of each of the best few effects that come close to the best one."""
    best = _worth(ranked[0], rows)
    least = best - max(_CLOSE_SHARE * abs(best), _CLOSE_GAIN)
    short: dict[tuple[str, str | None], Score] = {}
    for score in ranked:
        block = found.blocks[score.column.block]
        key = block.key
        if block.effect.plans_anew:
            short.setdefault(key, score)
            continue
        bent = not block.effect.is_linear and score.gain > _BENT_SHARE * ranked[0].gain
        if (_worth(score, rows) >= least or bent) and key not in short:
            short[key] = score
    near = [score for score in short.values() if not found.blocks[score.column.block].effect.plans_anew]
    return [*near[:_SHORTLIST], *(score for score in short.values() if score not in near)]


def _replanned(found: Examination, block: Block, linear: Applied, hopeless: float) -> Fitted:
    """Return the best refit from the numbers that meet the times at which the runs are at each place.

    Where these leave more than ``hopeless`` as chi2 no better ones are searched for.
    """
    nominal = block.effect.nominal(found.traces[0].inputs, block.target)
    typical = block.effect.start(found.traces[0].inputs, block.target)
    starts = [linear]
    for factor in _STARTS:
        values = dict(linear.values) | {
            p.name: float(
                np.clip(nominal[p.name] + factor * (typical[p.name] - nominal[p.name]), p.low, p.high)
            )
            for p in block.effect.parameters
            if not p.is_shape and np.isfinite(nominal[p.name])
        }
        starts.append(Applied(block.effect, block.target, values | dict(block.shape)))
    times = found.place_times
    free = free_of(starts[-1], found.traces[0])
    ranked = sorted(starts, key=lambda start: times.size((*found.applied, start)))
    placed = [times.fitted(found.applied, free, start) for start in ranked[:2]]
    rough = [refit(found.target, (*found.applied, start), steps=2) for start in placed]
    best = min(rough, key=lambda each: each.chi2)
    if best.chi2 > hopeless:
        return best
    tried = [searched(found.target, found.applied, start) for start in placed]
    fits = [best, *(refit(found.target, (*found.applied, each)) for each in tried)]
    return min(fits, key=lambda each: each.chi2)


def _worth(score: Score, rows: int) -> float:
    """Return the gain less what so many numbers gain by themselves (Schwarz 1978)."""
    return score.gain - score.column.width * float(np.log(rows))


def _update(found: Examination) -> None:
    """Set the ledger's data to what the accepted effects leave, with their tangents as given."""
    residuals = [trace.measured - trace.sample(found.applied) for trace in found.traces]
    tangents = [tangents_of(trace, found.fitted) for trace in found.traces]
    found.ledger.set_data(residuals, tangents)


def tangents_of(trace: Trace, fitted: Fitted, without: int = -1) -> Floats:
    """Return (k, n, t) how the model changes with each number of the accepted effects, but one of them."""
    n, k = trace.shape
    base = trace.sample(fitted.applied)
    columns = []
    edges = np.cumsum([0, *(len(free.names) for free in fitted.free)])
    for number, free in enumerate(fitted.free):
        if number == without:
            continue
        x = fitted.x[edges[number] : edges[number + 1]]
        for i in range(len(x)):
            step = 0.02 * free.scale[i]
            step = -step if x[i] + step > free.high[i] else step
            moved = x.copy()
            moved[i] += step
            effects = list(fitted.applied)
            effects[number] = free.applied(moved)
            columns.append((trace.sample(effects) - base).T / step * free.scale[i])
    return np.stack(columns, axis=2) if columns else np.zeros((k, n, 0))


def _prune(found: Examination) -> None:
    """Drop what brings less than 5 % of the whole gain where it acts: a joint's effect in that joint."""
    before = found.target.residual(())
    while len(found.applied) > 1:
        after = found.target.residual(found.applied)
        costs = []
        for number in range(len(found.applied)):
            rest = tuple(each for i, each in enumerate(found.applied) if i != number)
            without = refit(found.target, rest, steps=4)
            here = acts(found, number)
            whole = float(np.sum(before[: len(here)][here] ** 2) - np.sum(after[: len(here)][here] ** 2))
            costs.append(((without.chi2 - found.fitted.chi2) / max(whole, 1e-30), number, without))
        share, number, without = min(costs, key=lambda each: each[0])
        if share >= PRUNE:
            return
        found.fitted = without
        del found.surprises[number], found.usual[number]


def acts(found: Examination, number: int) -> Bools:
    """Return which of the whitened data an accepted effect changes at all."""
    rest = [each for i, each in enumerate(found.applied) if i != number]
    change = found.target.whiten([trace.sample(found.applied) - trace.sample(rest) for trace in found.traces])
    changes: Bools = np.abs(change) > _ACTS * np.abs(change).max(initial=0.0)
    return changes


def columns_of(
    blocks: Sequence[Block], traces: Sequence[Trace], known: Signatures
) -> tuple[list[Block], list[Column], list[Floats]]:
    """Return the blocks that are possible, where their columns stand, and the columns of each trace."""
    kept: list[Block] = []
    columns: list[Column] = []
    at = 0
    stacks: list[list[Floats]] = [[] for _ in traces]
    for block in blocks:
        found = [known.columns(block, trace) for trace in traces]
        width = found[0].shape[2]
        if width == 0 or any(each.shape[2] != width for each in found):
            continue
        if not any(np.any(each) for each in found):
            continue
        low, high = block.bounds(traces[0])
        columns.append(Column(len(kept), at, width, low, high, not block.effect.is_linear))
        kept.append(block)
        at += width
        for stack, each in zip(stacks, found, strict=True):
            stack.append(each)
    stacked = [
        np.concatenate(stack, axis=2) if stack else np.zeros((*trace.shape[::-1], 0))
        for stack, trace in zip(stacks, traces, strict=True)
    ]
    return kept, columns, stacked


def _aligned(nuisance: list[list[Nuisance]]) -> list[list[Nuisance]]:
    """Return the nuisance of all traces with the shared ones in one order, zero where a trace has none."""
    names = dict.fromkeys(each.name for own in nuisance for each in own if each.shared)
    widths = {each.name: each.columns.shape[2] for own in nuisance for each in own if each.shared}
    found = []
    for own in nuisance:
        mine = {each.name: each for each in own if each.shared}
        k, n = own[0].columns.shape[:2] if own else (0, 0)
        shared = [mine.get(name) or Nuisance(name, True, np.zeros((k, n, widths[name]))) for name in names]
        found.append([*shared, *(each for each in own if not each.shared)])
    return found
