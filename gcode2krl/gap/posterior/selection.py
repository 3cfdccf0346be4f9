"""Forward selection: the effects of one link, accepted one at a time, each by a refit and a test; rivals.

Candidates are refitted that are surprising, plausible, and close to the best by their linear gain.

**Twins** of an effect are candidates that do the same while it is small, whatever they do at its size. A
signature is that of a small effect. Of one that is not proportional to its size the linear gain falls as the
effect grows: of a force that is 45 ms late to a quarter, and then it compares nothing. So twins are looked
for where signatures hold, with the effect at a tenth of its size, and refitted whatever their gain.

**Errors of the set-up.** Every arm has some wrong zeros, and a base and a tool that are a little off, so that
none of them is a rarer cause than another, and several together do what one of another kind does: a frame has
the form of two wrong zeros. They are chosen as a set, the one of all sets with the most evidence; a cause is
told from them where no set without it has nearly as much.

**Effects that plan anew.** Their signals are late by seconds, and least squares on them have a minimum at
each stop. Where little more than noise is left they have one minimum, and a few steps tell what the effect
can bring.

**Numbers that the data do not give** are held, and not stated as found. A minor number (a clock's skew) stays
nominal unless the data show it: all of them together, and runs that it was not fitted to. A shape whose
interval spans its range, or that stands at an end of it for no gain, stays at its typical value: any other
would do as well.
"""

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Effect, Inputs
from gcode2krl.gap.compare.trace import Link, Trace
from gcode2krl.gap.components import Block, Signatures
from gcode2krl.gap.noise.nuisance import Candidates, Column, Question, nuisance_for
from gcode2krl.gap.noise.short import Noise
from gcode2krl.gap.noise.source import noise_of, noise_of_poses
from gcode2krl.gap.posterior.examination import Examination, LinkData, acts, fitted_mismatch, moments_off
from gcode2krl.gap.posterior.gram import Gram, solve
from gcode2krl.gap.posterior.least_squares import Fitted
from gcode2krl.gap.posterior.likelihood import Key, Sensitivity, refit, searched, sensitivity_of
from gcode2krl.gap.thresholds import THRESHOLDS, declared_nats

_LIMITS = THRESHOLDS.posterior
_ASYMPTOTIC = 100.0
"""From this chi2/2 on the first term of the asymptotic series is taken: off by (width - 2)/gain at most."""


@dataclass(frozen=True, eq=False)
class Score:
    """One candidate's statistic."""

    column: Column
    gain: float
    """Fall of chi2: the likelihood ratio."""
    coefficients: Floats
    surprise: float
    """-log of the probability of that gain without the effect."""
    within: bool
    """The coefficients are plausible: a negative backlash is not."""


def surprise(gain: float, width: int) -> float:
    """Return -log P(chi2 with ``width`` degrees > gain); large values by the asymptotic series."""
    x, half = max(gain, 0.0) / 2.0, width / 2.0
    if x < _ASYMPTOTIC:
        return float(-np.log(max(special.gammaincc(half, x), 1e-300)))
    return float(x - (half - 1.0) * np.log(x) + special.gammaln(half))


def scores(gram: Gram, columns: Sequence[Column]) -> list[Score]:
    """Return the statistic of every candidate beside the accepted effects."""
    return [_score(gram, column) for column in columns if column.width]


def _score(gram: Gram, column: Column) -> Score:
    gain, coefficients = gram.gain(column.index)
    plausible = np.clip(coefficients, column.low, column.high)
    if column.bent and column.width > 1:  # those of several that say nothing begin at nominal
        within = True
        plausible = np.where(plausible == coefficients, coefficients, 0.0)
    else:
        within = _within(column, coefficients)
    return Score(column, gain, plausible, surprise(gain, column.width), within)


def _within(column: Column, coefficients: Floats) -> bool:
    """Tell whether coefficients (c,) are in their range, or little beyond: they are a first order."""
    if column.width == 1 and column.low[0] == 0.0 and coefficients[0] < 0.0:
        return False
    share = _LIMITS.bent_reach if column.bent else _LIMITS.reach
    reach = 1e-9 + share * np.abs(column.high - column.low)
    return bool(np.all((coefficients >= column.low - reach) & (coefficients <= column.high + reach)))


def tried(columns: Sequence[Column]) -> float:
    """Return how many candidates were looked at to get these."""
    return sum(column.block.tried for column in columns)


def threshold(candidates: float) -> float:
    """Return the surprise that the largest of so many stays below, but for one effect-free data set in a
    thousand (Bonferroni; conservative, as candidates are alike)."""
    return float(np.log(max(candidates, 1.0) / _LIMITS.false_alarms))


def ranked(examination: Examination, gram: Gram, allowed: Sequence[Column]) -> list[Score]:
    """Return the plausible and surprising scores, the best first."""
    plain = [score for score in scores(gram, allowed) if _is_finding(examination, score)]
    plain.sort(key=lambda score: -_worth(score, gram.values))
    return [
        score
        for score in plain[: _LIMITS.most_tried]
        if surprise(score.gain / _inflation(examination, gram, score), score.column.width) > examination.level
    ]


def _is_finding(examination: Examination, score: Score) -> bool:
    plausible = score.within or score.column.block.effect.plans_anew
    large = score.gain > _LIMITS.least_ratio**2 * examination.data.times
    return plausible and large and score.surprise > examination.level


def _inflation(examination: Examination, gram: Gram, score: Score) -> float:
    # a signature holds for small effects only, and one at a frequency or moment that is searched is as far
    # off as the search is coarse, where the effect is strongest: such gains are judged after the refit
    effect = score.column.block.effect
    is_exact = effect.is_linear and effect.frequency is None and effect.moment is None
    small = score.gain < examination.data.times and is_exact
    return gram.inflation(score.column.index) if small else 1.0


def _worth(score: Score, values: int) -> float:
    """Return the gain minus the BIC penalty, width·log(values) (Schwarz 1978)."""
    return score.gain - score.column.width * float(np.log(values))


def shortlist(examination: Examination, scores: Sequence[Score], values: int) -> list[Score]:
    """Return the best score of each of the best few effects that come close to the best one.

    Signatures hold for small effects only, so the best linear gain does not decide alone; and that of an
    effect that plans anew tells little, so all of those follow.
    """
    best = _worth(scores[0], values)
    least = best - max(_LIMITS.close_share * abs(best), _LIMITS.close_gain)
    linear: dict[Key, Score] = {}
    planned: dict[Key, Score] = {}
    for score in scores:
        block = score.column.block
        if block.effect.plans_anew:
            planned.setdefault(block.key, score)
        elif _worth(score, values) >= least or (
            not block.effect.is_linear and score.gain > _LIMITS.bent_share * scores[0].gain
        ):
            linear.setdefault(block.key, score)
    return [*list(linear.values())[: _LIMITS.shortlist], *planned.values()]


def within_mismatch(examination: Examination, number: int) -> bool:
    """Tell whether every number of an accepted effect may be what normal mismatch allows, to 1 sigma."""
    applied, question = examination.applied[number], examination.question
    trace = examination.traces[0]
    duration_s = float(trace.time_s[-1] - trace.time_s[0])
    limits = applied.effect.usual(question.mismatch, duration_s, question.clocks)
    if not limits:
        return False
    if applied.effect.plans_anew:
        return _time_off_s(examination, applied) <= question.mismatch.clock_s
    nominal = applied.effect.nominal(trace.inputs, applied.target)
    deviation = examination.fitted.deviations(number)
    limits = _with_others(examination, applied, limits)
    return all(
        abs(applied.values[name] - nominal[name])
        <= _LIMITS.mismatch_slack * limits.get(name, 0.0)
        + _LIMITS.mismatch_deviations * deviation.get(name, 0.0)
        for name in applied.effect.names
        if not applied.effect.parameter(name).is_shape
    )


def _with_others(examination: Examination, applied: Applied, limits: dict[str, float]) -> dict[str, float]:
    """Return the bounds; usual sizes of others that together have its form add to that of the first size."""
    size, inputs = applied.effect.sizes[0].name, examination.traces[0].inputs
    typical = applied.effect.start(inputs, applied.target)[size]
    typical -= applied.effect.nominal(inputs, applied.target)[size]
    more = abs(typical) * examination.likelihood.once.allowed_sizes(applied)
    return {**limits, size: limits.get(size, 0.0) + more}


def _time_off_s(examination: Examination, applied: Applied) -> float:
    """Return the clock error that would change the signals by as much power as an effect does, in s."""
    change = sum(
        float(np.sum((trace.sample([applied]) - trace.nominal) ** 2)) for trace in examination.traces
    )
    rate = sum(float(np.sum(trace.rate**2)) for trace in examination.traces)
    return float(np.sqrt(change / rate)) if rate > 0.0 else 0.0


_SMALL = 0.1
"""Of its size: there effects are nearly proportional to it."""


@dataclass(frozen=True, eq=False)
class Twin:
    """A candidate that does what an effect does while that is small."""

    column: Column
    start: Applied
    """At the size at which it would do the same."""
    share: float
    """Of the power of the small effect, what its signature takes."""


def twins_of(
    examination: Examination, applied: Applied, others: Sequence[Applied], tried: Collection[Key]
) -> list[Twin]:
    """Return the nearest twins of an effect beside others, one of each effect and target that was not tried.

    None of two effects that are proportional to their sizes: those their gain compares.
    """
    best: dict[Key, Twin] = {}
    for twin in _alike(examination, applied, others, tried):
        if twin.share > best.setdefault(twin.start.key, twin).share:
            best[twin.start.key] = twin
    return sorted(best.values(), key=lambda twin: -twin.share)[: _LIMITS.most_twins]


def _alike(
    examination: Examination, applied: Applied, others: Sequence[Applied], tried: Collection[Key]
) -> Iterator[Twin]:
    """Yield the columns of candidates that take nearly all of what a small effect does."""
    candidates, signatures = examination.data.candidates, examination.data.signatures
    allowed = [
        column
        for column in candidates.columns
        if column.block.key not in {*tried, applied.key}
        and not column.block.effect.plans_anew
        and (column.bent or not applied.effect.is_linear)
    ]
    if not allowed:
        return
    less = _smaller(applied, examination.traces[0].inputs)
    changes = [trace.sample((*others, less)) - trace.sample(others) for trace in examination.traces]
    ends = np.cumsum([change.size for change in changes])[:-1]
    small = np.split(examination.likelihood.whiten(changes)[:, None], ends)
    gram = signatures.beside(small).total
    for column in allowed:
        at = 1 + column.index
        weights = solve(gram[np.ix_(at, at)], gram[at, :1])[:, 0]
        share = float(weights @ gram[at, 0]) / max(float(gram[0, 0]), 1e-300)
        if share >= _LIMITS.twin_share:
            within = np.clip(weights / _SMALL, column.low, column.high)
            yield Twin(column, column.block.applied(within, examination.traces[0]), share)


def _smaller(applied: Applied, inputs: Inputs) -> Applied:
    """Return an effect at a tenth of its size."""
    nominal = applied.effect.nominal(inputs, applied.target)
    names = [p.name for p in applied.effect.sizes]
    less = {name: nominal[name] + _SMALL * (applied[name] - nominal[name]) for name in names}
    return replace(applied, values={**applied.values, **less})


_STARTS = (1.0, -0.7, 3.0)
"""In typical sizes from nominal: both ways, and far."""
_NEAR_STEPS = 3
_PLACED = 2
"""So many of the starts, those nearest to the measured times, are fitted."""


def replanned(examination: Examination, block: Block, linear: Applied, best_chi2: float) -> Fitted:
    """Return the best refit from the numbers that meet the times at which the runs are at each place.

    Where these leave many times ``best_chi2``, that of the best other effect, no better ones are searched
    for. Where little more than noise is left of the runs, the first order has to bring a share of its gain.
    """
    hopeless = _LIMITS.hopeless * best_chi2
    if np.isfinite(best_chi2) and examination.fitted.chi2 <= _LIMITS.hopeless * examination.data.values:
        near = refit(examination.likelihood, (*examination.applied, linear), steps=_NEAR_STEPS)
        if examination.fitted.chi2 - near.chi2 < _LIMITS.bent_share * (examination.fitted.chi2 - best_chi2):
            return near
    times, likelihood, others = examination.data.place_times, examination.likelihood, examination.applied
    starts = sorted(
        [linear, *_starts(examination, block, linear)], key=lambda each: times.size((*others, each))
    )
    placed = [times.fitted(others, start) for start in starts[:_PLACED]]
    rough = [refit(likelihood, (*others, start), steps=2) for start in placed]
    best = min(rough, key=lambda each: each.chi2)
    if best.chi2 > hopeless:
        return best
    better = [searched(likelihood, others, start) for start in placed]
    return min([best, *(refit(likelihood, (*others, each)) for each in better)], key=lambda each: each.chi2)


def _starts(examination: Examination, block: Block, linear: Applied) -> Iterator[Applied]:
    """Yield the effect with all sizes away from nominal by as many typical sizes."""
    effect, inputs = block.effect, examination.traces[0].inputs
    nominal, typical = effect.nominal(inputs, block.target), effect.start(inputs, block.target)
    for factor in _STARTS:
        sizes = {
            p.name: float(
                np.clip(nominal[p.name] + factor * (typical[p.name] - nominal[p.name]), p.low, p.high)
            )
            for p in effect.parameters
            if not p.is_shape and np.isfinite(nominal[p.name])
        }
        yield Applied(effect, block.target, dict(linear.values) | sizes | dict(block.shape))


def with_shown_numbers(examination: Examination, fitted: Fitted) -> Fitted:
    """Return the refit with those numbers of its last effect held that lower chi2 by too little."""
    *others, last = fitted.applied
    if fitted.at_bound[-1] or last.effect.plans_anew:
        return fitted
    doubtful = _doubtful(fitted) - last.held
    if not doubtful:
        return fitted
    sensitivity = sensitivity_of(examination.likelihood, fitted, len(others))
    plain = refit(examination.likelihood, (*others, _held(examination, last, doubtful)))
    if plain.chi2 - fitted.chi2 < _LIMITS.minor_chi2 * sensitivity.inflation():
        return plain
    return fitted if _carries_over(examination, sensitivity, plain) else plain


def _carries_over(examination: Examination, sensitivity: Sensitivity, plain: Fitted) -> bool:
    """Tell whether the numbers lower chi2 of runs that they were not fitted to; true of a single run.

    What a model is off by for seconds in one run is one draw there, however many rows it has.
    """
    values = [trace.measured.size for trace in examination.traces]
    if len(values) < 2:
        return True
    before = examination.likelihood.residual(plain.applied)
    return sensitivity.gain_of_left_out(before, np.repeat(np.arange(len(values)), values)) > 0.0


def _doubtful(fitted: Fitted) -> frozenset[str]:
    """Return the numbers of the last effect that the data may not give."""
    last = len(fitted.applied) - 1
    free, x = fitted.numbers.free[last], fitted.x[fitted.numbers.slices[last]]
    minor = frozenset(p.name for p in free.effect.sizes if p.minor)
    spanned = free.shapes_spanned(fitted.deviations(last))
    return minor | spanned | free.shapes_at_end(x)


def _held(examination: Examination, applied: Applied, names: frozenset[str]) -> Applied:
    """Return an effect with some numbers held: sizes nominal, shapes typical."""
    effect, inputs = applied.effect, examination.traces[0].inputs
    nominal, typical = effect.nominal(inputs, applied.target), effect.start(inputs, applied.target)
    fixed = {name: typical[name] if effect.parameter(name).is_shape else nominal[name] for name in names}
    return replace(applied, values={**applied.values, **fixed}, held=applied.held | names)


_FIRST_STEPS, _PRUNING_STEPS = 3, 4
"""Of refits that only tell whether a whole one is worth its time."""


def examine(
    link: Link,
    traces: Sequence[Trace],
    question: Question,
    known: Signatures | None = None,
    noise: Sequence[Noise] | None = None,
) -> Examination:
    """Return the effects that explain a link's traces, from these alone; ``noise``: by default as learnt."""
    known = known or Signatures()
    candidates = Candidates.of(question.blocks, traces, known)
    nuisance = nuisance_for(traces, question, known)
    still = traces[0].still
    assumed = noise or (noise_of_poses if still else noise_of)(traces, candidates.signatures, nuisance)
    examination = _pruned(
        _with_best_errors(
            _selected(LinkData.of(link, traces, question, known, candidates, nuisance, assumed))
        )
    )
    if noise is None and examination.causes and not still:
        # what rings or hums looks like noise until its cause is known
        quieter = noise_of(traces, candidates.signatures, nuisance, examination.applied)
        if _power(quieter) < _LIMITS.quieter_noise * _power(assumed):
            return examine(link, traces, question, known, quieter)
    return examination


def with_rival(
    examination: Examination, number: int, rival: Applied, *, is_of_set: bool = False
) -> Examination | None:
    """Return the examination with a rival in place of an accepted effect; None where it fails a test.

    ``is_of_set``: what it brings beside others of a set may be small.
    """
    others = refit(examination.likelihood, examination.without(number), steps=_PRUNING_STEPS)
    before = examination.dropping(number, others)
    key, candidates = rival.key, examination.data.candidates
    column = next((each for each in candidates.columns if each.block.key == key), None)
    if column is None:
        return None
    fitted = refit(examination.likelihood, (*others.applied, rival))
    surprising = _tested(before, _Trial(column, fitted), is_of_set=is_of_set)
    return None if surprising is None else _with(before, fitted, surprising)


def _power(noise: Sequence[Noise]) -> float:
    return sum(each.sigma**2 for each in noise)


def _selected(data: LinkData) -> Examination:
    """Return the examination with effects accepted until no candidate passes the tests."""
    examination = Examination(data, refit(data.likelihood, ()))
    while _may_grow(examination):
        examination, grew = _grown(examination)
        if not grew:
            break
    return examination


def _may_grow(examination: Examination) -> bool:
    room = len(examination.causes) < _LIMITS.most_causes and len(examination.applied) < _LIMITS.most_effects
    return room and not _is_met(examination)


def _is_met(examination: Examination) -> bool:
    """Tell whether a link is met to the accuracy of its model: what is left is no noise that averages out.

    In the mean, and at all moments: corners are a hundredth of a run.
    """
    if examination.link.model_rms == 0.0 or examination.fitted.chi2 >= examination.data.values:
        return False
    residuals = [trace.measured - trace.sample(examination.applied) for trace in examination.traces]
    by_run, shared = fitted_mismatch(examination.likelihood, residuals)
    unexplained = [r - a - b for r, a, b in zip(residuals, by_run, shared, strict=True)]
    return moments_off(examination.traces, unexplained, examination.applied) < _LIMITS.model_off_rows


def _grown(examination: Examination) -> tuple[Examination, bool]:
    """Return the examination after one more round, and whether that accepted an effect."""
    candidates = examination.data.candidates
    gram = examination.data.gram(examination.fitted)
    if not examination.observable:
        examination = replace(
            examination,
            observable=tuple(gram.observable(column.index) for column in candidates.columns),
            first_level=threshold(tried(candidates.columns)),
        )
    taken = examination.accepted_keys | examination.rejected
    allowed = [column for column in candidates.columns if column.block.key not in taken]
    examination = replace(examination, level=threshold(tried(allowed)))
    return _accepted(examination, ranked(examination, gram, allowed), gram.values)


def _accepted(examination: Examination, scores: Sequence[Score], values: int) -> tuple[Examination, bool]:
    """Return the examination with the best refit that passes the tests, and whether one does."""
    while scores:
        trials = list(_trials(examination, shortlist(examination, scores, values)))
        trials += _twin_trials(examination, trials)
        for trial in sorted(trials, key=lambda trial: trial.cost):
            surprising = _tested(examination, trial)
            if surprising is not None:
                return _with(examination, trial.fitted, surprising), True
            examination = examination.rejecting(trial.column.block.key)
        scores = [score for score in scores if score.column.block.key not in examination.rejected]
    return examination, False


def _with(examination: Examination, fitted: Fitted, surprising: float) -> Examination:
    """Return the examination with one more effect; the others' numbers have moved with it."""
    grown = replace(
        examination,
        fitted=fitted,
        surprises=(*examination.surprises, surprising),
        usual=(*examination.usual, False),
    )
    usual = tuple(within_mismatch(grown, number) for number in range(len(grown.usual)))
    return replace(grown, usual=usual)


@dataclass(frozen=True, eq=False)
class _Trial:
    """A candidate and its refit beside the accepted effects."""

    column: Column
    fitted: Fitted

    @property
    def cost(self) -> float:
        """Return chi2 and the cost of the numbers."""
        return self.fitted.chi2 + self.fitted.occam


def _trials(examination: Examination, scores: Sequence[Score]) -> Iterator[_Trial]:
    """Yield the refits; one that is far behind those before it is not carried to its end."""
    best = np.inf
    for score in scores:
        block = score.column.block
        start = block.applied(score.coefficients, examination.traces[0])
        if block.effect.plans_anew:
            fitted = replanned(examination, block, start, best)
        else:
            fitted = with_shown_numbers(examination, _refitted(examination, start, best))
        best = min(best, fitted.chi2)
        yield _Trial(score.column, fitted)


def _twin_trials(examination: Examination, trials: Sequence[_Trial]) -> Iterator[_Trial]:
    """Yield the refits of candidates that do what the best trial does while it is small."""
    best = min(trials, key=lambda trial: trial.cost)
    if best.column.block.effect.plans_anew or not np.isfinite(best.cost):
        return
    tried = {*(trial.column.block.key for trial in trials), *examination.accepted_keys, *examination.rejected}
    for twin in twins_of(examination, best.fitted.applied[-1], examination.applied, tried):
        fitted = with_shown_numbers(examination, _refitted(examination, twin.start, best.fitted.chi2))
        yield _Trial(twin.column, fitted)


def _refitted(examination: Examination, start: Applied, best: float) -> Fitted:
    """Return the refit of a candidate, ended early where it is behind the best by a share of the gain."""
    alone = len(start.effect.parameters) == 1
    start = _best_alternative(examination, start)
    fitted = refit(examination.likelihood, (*examination.applied, start), steps=_FIRST_STEPS, scan=alone)
    best = min(best, fitted.chi2)
    if fitted.chi2 <= best + _LIMITS.behind_share * (examination.fitted.chi2 - best):
        return refit(examination.likelihood, fitted.applied)
    return fitted


def _best_alternative(examination: Examination, start: Applied) -> Applied:
    """Return the best of what looks like an effect to first order."""
    alternatives = [replace(start, values=values) for values in start.effect.alternatives(start.values)]
    if len(alternatives) == 1:
        return start
    return min(alternatives, key=lambda each: examination.likelihood.chi2((*examination.applied, each)))


def _tested(examination: Examination, trial: _Trial, *, is_of_set: bool = False) -> float | None:
    """Return how surprising a trial's gain is; None where it fails a test.

    It must be no bound hit, large enough, surprising beside the scatter over stretches of time, and lower
    chi2 on stretches that its numbers were not fitted to.
    """
    fitted = trial.fitted
    gain = examination.fitted.chi2 - fitted.chi2
    last = fitted.numbers.free[-1]
    pushed = last.shapes_at_end(fitted.x[fitted.numbers.slices[-1]])  # the data want a form beyond its range
    least = 0.0 if is_of_set else _LIMITS.least_ratio**2 * examination.data.times
    if fitted.at_bound[-1] or pushed or gain < least:
        return None
    sensitivity = sensitivity_of(examination.likelihood, fitted, len(fitted.applied) - 1)
    # shapes are searched too, so that chi2 has a degree for each of them
    surprising = surprise(gain / sensitivity.inflation(), max(trial.column.width, len(last.names)))
    if surprising < examination.level:
        return None
    if trial.column.block.effect.plans_anew:
        return surprising
    before = examination.likelihood.residual(examination.applied)
    return surprising if sensitivity.left_out_gain(before, _LIMITS.left_out_groups) > 0.0 else None


@dataclass(frozen=True)
class _Errors:
    """Some errors of a set-up beside accepted effects, to first order."""

    keys: tuple[Key, ...]
    sizes: float
    """The standard deviation of their prior, one of `set_up_sizes`."""
    spread: float
    """The inflation of a gain."""
    chi2: float
    cost: float
    """What all numbers cost, as chi2."""
    coefficients: Floats
    """Of their columns, in this order."""

    @property
    def worth(self) -> float:
        """Return twice their evidence."""
        return -self.chi2 / self.spread - self.cost

    def applied(self, columns: Mapping[Key, Column], trace: Trace) -> list[Applied]:
        """Return the errors at their values."""
        ends = np.cumsum([columns[key].width for key in self.keys])[:-1]
        values = np.split(self.coefficients, ends)
        return [columns[key].block.applied(x, trace) for key, x in zip(self.keys, values, strict=False)]


class _Sets:
    """The sets of a set-up's errors beside some accepted effects."""

    def __init__(self, gram: Gram, columns: Mapping[Key, Column], spread: float | None = None) -> None:
        """Take the fast view beside the effects; ``spread``: by default that of all errors."""
        self._gram, self._columns = gram, columns
        every = np.concatenate([column.index for column in columns.values()])
        self._spread = gram.inflation(every) if spread is None else spread

    def of(self, keys: Collection[Key], sizes: float) -> _Errors:
        """Return some errors at their best values, the accepted effects refitted beside them."""
        chosen = [key for key in self._columns if key in keys]
        at = np.concatenate([np.zeros(0, dtype=int), *(self._columns[key].index for key in chosen)])
        return _Errors(tuple(chosen), sizes, self._spread, *self._gram.fitted(at, sizes))

    def sized(self, keys: Collection[Key]) -> _Errors:
        """Return some errors with the prior of most evidence."""
        return max((self.of(keys, sizes) for sizes in _LIMITS.set_up_sizes), key=lambda each: each.worth)

    def best(self, needed: frozenset[Key] = frozenset()) -> _Errors:
        """Return the set with the most evidence, reached from all errors or from those that it needs.

        From few of them a frame comes first, which has the form of two wrong zeros, and then none is missing.
        """
        ends = [self._climbed(start, needed) for start in (frozenset(self._columns), needed)]
        return max(ends, key=lambda each: each.worth)

    def _climbed(self, start: frozenset[Key], needed: frozenset[Key]) -> _Errors:
        """Return where one error more or less, or other sizes, bring no evidence."""
        best = self.sized(start)
        while True:
            others = [{other} ^ {*best.keys} for other in self._columns if other not in needed]
            trials = [*(self.of(keys, best.sizes) for keys in others), self.sized(best.keys)]
            better = max(trials, key=lambda each: each.worth)
            if better.worth <= best.worth:
                return best
            best = better


def _errors_of_set_up(examination: Examination) -> dict[Key, Column]:
    columns = examination.data.candidates.columns
    return {column.block.key: column for column in columns if column.block.effect.of_set_up}


def _with_best_errors(examination: Examination) -> Examination:
    """Return the examination with another set of the set-up's errors, where that is clearly the better one.

    In place of all causes: errors together may have the form of one that was accepted before them.
    """
    columns = _errors_of_set_up(examination)
    if not columns or not examination.applied:
        return examination
    accepted, data = examination.errors_of_set_up, examination.data
    sets = _Sets(data.gram(examination.fitted, without=accepted), columns)
    now = sets.sized(examination.accepted_keys)
    taken_out, best = accepted, sets.best()
    for number in range(len(examination.applied)):
        if number not in accepted:
            others = _Sets(data.gram(examination.fitted, {*accepted, number}), columns, now.spread)
            trial = others.best()
            if trial.worth > best.worth:
                taken_out, best, sets = accepted | {number}, trial, others
    least = now.worth + 2.0 * declared_nats()
    replaced = {each.key for number, each in enumerate(examination.applied) if number in taken_out}
    if best.worth < least or replaced <= {*best.keys}:  # what only comes beside was tried by itself
        return examination
    if not taken_out >= {*examination.cause_numbers}:  # a set also takes the form of what the library lacks
        return examination
    changed = _with_errors(examination, taken_out, best.applied(columns, examination.traces[0]))
    return changed if sets.sized(changed.accepted_keys).worth >= least else examination


def _with_errors(
    examination: Examination, taken_out: Collection[int], errors: Sequence[Applied]
) -> Examination:
    """Return the examination with those errors that pass the tests in place of some accepted effects."""
    kept = [number for number in range(len(examination.applied)) if number not in taken_out]
    applied = (*(examination.applied[number] for number in kept), *errors)
    changed = replace(
        examination,
        fitted=refit(examination.likelihood, applied),
        surprises=(*(examination.surprises[number] for number in kept), *(np.inf for _ in errors)),
        usual=(*(examination.usual[number] for number in kept), *(False for _ in errors)),
    )
    for error in errors:
        number = next(i for i, each in enumerate(changed.applied) if each.key == error.key)
        tested = with_rival(changed, number, changed.applied[number], is_of_set=True)
        if tested is None:
            others = refit(changed.likelihood, changed.without(number), steps=_PRUNING_STEPS)
            tested = changed.dropping(number, others)
        changed = tested
    return changed


def _pruned(examination: Examination) -> Examination:
    """Return the examination without effects that the others may be off by, or that they have made needless.

    However large another effect is, a small one stays where it is surprising beside all others, and brings
    more than the models of these are off by where it acts.
    """
    while len(examination.applied) > 1:
        changes = [examination.changed(number) for number in range(len(examination.applied))]
        errors = [_model_error(each.effect) for each in examination.applied]
        refits, worth = [], []
        for number, change in enumerate(changes):
            refitted = refit(examination.likelihood, examination.without(number), steps=_PRUNING_STEPS)
            rows = np.flatnonzero(acts(change))
            others = sum(
                (error * float(np.linalg.norm(other[rows]))) ** 2
                for i, (error, other) in enumerate(zip(errors, changes, strict=True))
                if i != number
            )
            refits.append(refitted)
            worth.append((refitted.chi2 - examination.fitted.chi2) / max(others, 1e-30))
        least = int(np.argmin(worth))
        if worth[least] >= 1.0 and _is_needed(examination, least, refits[least]):
            return examination
        examination = examination.dropping(least, refits[least])
    return examination


def _model_error(effect: Effect) -> float:
    """Return the share of its size that the model of an effect is off by: clocks and frames are exact."""
    if effect.plans_anew:
        return _LIMITS.law_error
    return _LIMITS.form_error if effect.is_clock or effect.of_set_up else _LIMITS.model_error


def _is_needed(examination: Examination, number: int, others: Fitted) -> bool:
    """Tell whether the gain of an effect is surprising beside all others, which are refitted without it."""
    sensitivity = sensitivity_of(examination.likelihood, examination.fitted, number)
    gain = (others.chi2 - examination.fitted.chi2) / sensitivity.inflation()
    return surprise(gain, len(examination.fitted.numbers.free[number].names)) >= examination.level


_SETTLED = 0.1
"""Of chi2: fits end where less is to be had."""
_STEPS = 6
"""Half of a whole refit: a rival begins at its best linear fit."""


@dataclass(frozen=True)
class Rival:
    """An effect in place of a cause; differences of chi2 are over their inflation."""

    applied: Applied
    cost_difference: float
    """By how much chi2 and the cost of the numbers are higher than with the cause."""
    chi2_difference: float
    distance2: float = np.inf
    """Square of the distance between both refitted signals, over the power of what the cause does."""
    companions: tuple[Applied, ...] = ()
    """Others without which it does not do what the cause does."""

    @property
    def together(self) -> tuple[Applied, ...]:
        """Return all effects that stand in place of the cause."""
        return self.applied, *self.companions

    @property
    def is_better(self) -> bool:
        """Tell whether the rival has more evidence than the cause."""
        return self.cost_difference < -_SETTLED

    @property
    def is_rarer(self) -> bool:
        """Tell whether it is no error of a set-up, which are usual, and the data do not clearly tell it."""
        is_clear = self.cost_difference < -2.0 * declared_nats()
        return not (self.applied.effect.of_set_up or is_clear)

    @property
    def behind_nats(self) -> float:
        """Return by how much the rival is worse, in nats; the smaller of both differences."""
        return 0.5 * min(self.cost_difference, self.chi2_difference)

    @property
    def alike(self) -> bool:
        """Tell whether the data cannot tell the rival from the cause: it belongs to the declared set.

        Nor can they where the signals of both differ by less than models are exact to.
        """
        return self.behind_nats < declared_nats() or self.distance2 < _LIMITS.model_error**2


def rivals_of(examination: Examination, number: int) -> list[Rival]:
    """Return the best other effects in place of an accepted one, each refitted along with the rest."""
    others = examination.without(number)
    spread = sensitivity_of(examination.likelihood, examination.fitted, number).inflation()
    power = examination.likelihood.chi2(others) - examination.fitted.chi2
    residual = examination.likelihood.residual(examination.applied)
    rivals: dict[Key, Rival] = {}
    for start in itertools.chain(_rival_twins(examination, number), _of_gain(examination, number, spread)):
        if start.key in rivals or len(rivals) >= _LIMITS.most_rivals:
            continue
        bent = not start.effect.is_linear
        fitted = refit(examination.likelihood, (*others, start), steps=_STEPS, scan=bent)
        if fitted.at_bound[-1] or not np.isfinite(fitted.chi2):
            continue
        fitted = with_shown_numbers(examination, fitted)  # as the cause that it is compared with
        difference = (fitted.chi2 - examination.fitted.chi2) / spread
        cost = difference + fitted.occam - examination.fitted.occam
        apart = examination.likelihood.residual(fitted.applied) - residual
        distance2 = float(apart @ apart) / max(power, 1e-300)
        rivals[start.key] = Rival(fitted.applied[-1], float(cost), float(difference), distance2)
    return sorted(rivals.values(), key=lambda rival: rival.cost_difference)


def with_set_rival(examination: Examination, number: int, rivals: Sequence[Rival]) -> list[Rival]:
    """Return the rivals of a cause with the errors of the set-up that do the same together.

    Every arm has some of all of them, so that one more is no less probable than the cause. The best set with
    the cause is compared with the best one without it: the cause is known by what no set takes from it.
    Nothing is added where the data tell the cause from them, or where one of them does the same alone.
    """
    columns = _errors_of_set_up(examination)
    if len(columns) < 2:
        return [*rivals]
    spread = sensitivity_of(examination.likelihood, examination.fitted, number).inflation()
    key, taken_out = examination.applied[number].key, examination.errors_of_set_up
    view = examination.data.gram(examination.fitted, taken_out)
    with_it = _Sets(view, columns, spread).best(frozenset({key} & columns.keys()))
    if number not in taken_out:
        view = examination.data.gram(examination.fitted, {*taken_out, number})
    others = {each: column for each, column in columns.items() if each != key}
    instead = _Sets(view, others, spread).best()
    applied = [
        each for each in instead.applied(columns, examination.traces[0]) if each.key not in with_it.keys
    ]
    alike = {rival.applied.key for rival in rivals if rival.alike}
    if not applied or not alike.isdisjoint(each.key for each in applied):
        return [*rivals]
    chi2 = (instead.chi2 - with_it.chi2) / spread
    together = Rival(applied[0], chi2 + instead.cost - with_it.cost, chi2, companions=tuple(applied[1:]))
    return sorted([*rivals, together] if together.alike else rivals, key=lambda each: each.cost_difference)


def _of_gain(examination: Examination, number: int, spread: float) -> Iterator[Applied]:
    """Yield other effects whose linear gain comes near that of a cause, the best first.

    The gain of both is beside the others refitted: one that does much the same as another gains little.
    """
    gram = examination.data.gram(examination.fitted, without=(number,))
    gain = gram.chi2 - examination.fitted.chi2
    candidates = examination.data.candidates
    columns = [column for column in candidates.columns if column.block.key not in examination.accepted_keys]
    plausible = (score for score in scores(gram, columns) if score.within)
    for score in sorted(plausible, key=lambda score: -score.gain):
        block = score.column.block
        share = _LIMITS.rival_share if block.effect.is_linear else _LIMITS.bent_rival_share
        if score.gain >= gain - max(share * gain, _LIMITS.rival_gain * spread):
            yield block.applied(score.coefficients, examination.traces[0])


def _rival_twins(examination: Examination, number: int) -> Iterator[Applied]:
    """Yield other effects that do what a cause does while it is small."""
    cause = examination.applied[number]
    if not cause.effect.plans_anew:
        twins = twins_of(examination, cause, examination.without(number), examination.accepted_keys)
        yield from (twin.start for twin in twins)


def rival_probabilities(rivals: Sequence[Rival], of_cause: float) -> list[float]:
    """Return the probability of each rival of a cause that has the probability ``of_cause``.

    Rivals that the data cannot tell from the cause share its probability: theirs is the same one. Of what it
    leaves the others have their shares by evidence, over the temperature as no model is exact.
    """
    costs = np.maximum([rival.cost_difference for rival in rivals], 0.0)
    apart = np.array([not rival.alike for rival in rivals], dtype=bool)
    weights = np.where(apart, np.exp(-costs / (2.0 * _LIMITS.temperature)), 0.0)
    shares = (1.0 - of_cause) * weights / (1.0 + weights.sum())
    return [of_cause if rival.alike else float(share) for rival, share in zip(rivals, shares, strict=True)]
