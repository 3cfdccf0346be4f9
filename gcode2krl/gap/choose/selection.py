"""Forward selection: the effects of one link, accepted one at a time, each by a refit and a test."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.gap.beside.links.base import Link
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.examination import Examination, LinkData
from gcode2krl.gap.choose.gap_size import fitted_mismatch, moments_off
from gcode2krl.gap.choose.mismatch import within_mismatch
from gcode2krl.gap.choose.ranking import ranked, shortlist
from gcode2krl.gap.choose.replanning import replanned
from gcode2krl.gap.choose.scoring import Score, surprise, threshold, tried
from gcode2krl.gap.choose.shown_numbers import with_shown_numbers
from gcode2krl.gap.choose.twins import twins_of
from gcode2krl.gap.fit.design import Candidates, Question, nuisance_for
from gcode2krl.gap.fit.fitted import Fitted
from gcode2krl.gap.fit.noise import Noise
from gcode2krl.gap.fit.noise_source import noise_of
from gcode2krl.gap.fit.pose_noise import noise_of_poses
from gcode2krl.gap.fit.refitting import refit
from gcode2krl.gap.fit.sensitivity import sensitivity_of
from gcode2krl.gap.fit.signatures import Block, Signatures
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
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
    found = _pruned(_selected(LinkData.of(link, traces, question, known, candidates, nuisance, assumed)))
    if noise is None and found.causes and not still:
        # what rings or hums looks like noise until its cause is known
        quieter = noise_of(traces, candidates.signatures, nuisance, found.applied)
        if _power(quieter) < _LIMITS.quieter_noise * _power(assumed):
            return examine(link, traces, question, known, quieter)
    return found


def with_rival(found: Examination, number: int, rival: Applied) -> Examination | None:
    """Return the examination with a rival in place of an accepted effect; None where it fails a test."""
    others = refit(found.likelihood, found.without(number), steps=_PRUNING_STEPS)
    before = found.dropping(number, others)
    key, candidates = (rival.effect.name, rival.target), found.data.candidates
    column = next((each for each in candidates.columns if candidates.block(each).key == key), None)
    if column is None:
        return None
    fitted = refit(found.likelihood, (*others.applied, rival))
    surprising = _tested(before, _Trial(column.width, candidates.block(column), fitted))
    return None if surprising is None else _with(before, fitted, surprising)


def _power(noise: Sequence[Noise]) -> float:
    return sum(each.sigma**2 for each in noise)


def _selected(data: LinkData) -> Examination:
    """Return the examination with effects accepted until no candidate passes the tests."""
    found = Examination(data, refit(data.likelihood, ()))
    while _may_grow(found):
        found, grew = _grown(found)
        if not grew:
            break
    return found


def _may_grow(found: Examination) -> bool:
    room = len(found.causes) < _LIMITS.most_causes and len(found.applied) < _LIMITS.most_effects
    return room and not _is_met(found)


def _is_met(found: Examination) -> bool:
    """Tell whether a link is met to the accuracy of its model: what is left is no noise that averages out.

    In the mean, and at all moments: corners are a hundredth of a run.
    """
    if found.link.model_rms == 0.0 or found.fitted.chi2 >= found.data.values:
        return False
    left = [trace.measured - trace.sample(found.applied) for trace in found.traces]
    own, shared = fitted_mismatch(found.likelihood, left)
    rest = [r - a - b for r, a, b in zip(left, own, shared, strict=True)]
    return moments_off(found.traces, rest, found.applied) < _LIMITS.model_off_rows


def _grown(found: Examination) -> tuple[Examination, bool]:
    """Return the examination after one more round, and whether that accepted an effect."""
    candidates = found.data.candidates
    gram = found.data.gram(found.fitted)
    if not found.observable:
        found = replace(
            found,
            observable=tuple(gram.observable(column.index) for column in candidates.columns),
            first_level=threshold(tried(candidates.columns)),
        )
    taken = found.accepted_keys | found.rejected
    allowed = [column for column in candidates.columns if candidates.block(column).key not in taken]
    found = replace(found, level=threshold(tried(allowed)))
    return _accepted(found, ranked(found, gram, allowed), gram.values)


def _accepted(found: Examination, scores: Sequence[Score], values: int) -> tuple[Examination, bool]:
    """Return the examination with the best refit that passes the tests, and whether one does."""
    while scores:
        trials = list(_trials(found, shortlist(found, scores, values)))
        trials += _of_twins(found, trials)
        for trial in sorted(trials, key=lambda trial: trial.cost):
            surprising = _tested(found, trial)
            if surprising is not None:
                return _with(found, trial.fitted, surprising), True
            found = found.rejecting(trial.block.key)
        scores = [
            each for each in scores if found.data.candidates.block(each.column).key not in found.rejected
        ]
    return found, False


def _with(found: Examination, fitted: Fitted, surprising: float) -> Examination:
    """Return the examination with one more effect; the others' numbers have moved with it."""
    grown = replace(
        found,
        fitted=fitted,
        surprises=(*found.surprises, surprising),
        usual=(*found.usual, False),
    )
    usual = tuple(within_mismatch(grown, number) for number in range(len(grown.usual)))
    return replace(grown, usual=usual)


@dataclass(frozen=True, eq=False)
class _Trial:
    """A candidate and its refit beside the accepted effects."""

    width: int
    """Number of its columns."""
    block: Block
    fitted: Fitted

    @property
    def cost(self) -> float:
        """Return chi2 and the cost of the numbers."""
        return self.fitted.chi2 + self.fitted.occam


def _trials(found: Examination, scores: Sequence[Score]) -> Iterator[_Trial]:
    """Yield the refits; one that is far behind those before it is not carried to its end."""
    best = np.inf
    for score in scores:
        block = found.data.candidates.block(score.column)
        start = block.applied(score.coefficients, found.traces[0])
        if block.effect.plans_anew:
            fitted = replanned(found, block, start, best)
        else:
            fitted = with_shown_numbers(found, _refitted(found, start, best))
        best = min(best, fitted.chi2)
        yield _Trial(score.column.width, block, fitted)


def _of_twins(found: Examination, trials: Sequence[_Trial]) -> Iterator[_Trial]:
    """Yield the refits of candidates that do what the best trial does while it is small."""
    best = min(trials, key=lambda trial: trial.cost)
    if best.block.effect.plans_anew or not np.isfinite(best.cost):
        return
    tried = {*(trial.block.key for trial in trials), *found.accepted_keys, *found.rejected}
    for twin in twins_of(found, best.fitted.applied[-1], found.applied, tried):
        fitted = with_shown_numbers(found, _refitted(found, twin.start, best.fitted.chi2))
        yield _Trial(twin.column.width, found.data.candidates.block(twin.column), fitted)


def _refitted(found: Examination, start: Applied, best: float) -> Fitted:
    """Return the refit of a candidate, ended early where it is behind the best by a share of the gain."""
    alone = len(start.effect.parameters) == 1
    start = _best_alternative(found, start)
    fitted = refit(found.likelihood, (*found.applied, start), steps=_FIRST_STEPS, scan=alone)
    best = min(best, fitted.chi2)
    if fitted.chi2 <= best + _LIMITS.behind_share * (found.fitted.chi2 - best):
        return refit(found.likelihood, fitted.applied)
    return fitted


def _best_alternative(found: Examination, start: Applied) -> Applied:
    """Return the best of what looks like an effect to first order."""
    alternatives = [replace(start, values=values) for values in start.effect.alternatives(start.values)]
    if len(alternatives) == 1:
        return start
    return min(alternatives, key=lambda each: found.likelihood.chi2((*found.applied, each)))


def _tested(found: Examination, trial: _Trial) -> float | None:
    """Return how surprising a trial's gain is; None where it fails a test.

    It must be no bound hit, large enough, surprising beside the scatter over stretches of time, and lower
    chi2 on stretches that its numbers were not fitted to.
    """
    fitted = trial.fitted
    gain = found.fitted.chi2 - fitted.chi2
    last = fitted.numbers.free[-1]
    pushed = last.shapes_at_end(fitted.x[fitted.numbers.slices[-1]])  # the data want a form beyond its range
    if fitted.at_bound[-1] or pushed or gain < _LIMITS.least_ratio**2 * found.data.times:
        return None
    sensitivity = sensitivity_of(found.likelihood, fitted, len(fitted.applied) - 1)
    # shapes are searched too, so that chi2 has a degree for each of them
    surprising = surprise(gain / sensitivity.inflation(), max(trial.width, len(last.names)))
    if surprising < found.level:
        return None
    if trial.block.effect.plans_anew:
        return surprising
    before = found.likelihood.residual(found.applied)
    return surprising if sensitivity.left_out_gain(before, _LIMITS.left_out_groups) > 0.0 else None


def _pruned(found: Examination) -> Examination:
    """Return the examination without effects that bring little of the whole gain where they act.

    An effect of one joint is compared with the gain in that joint.
    """
    before = found.likelihood.residual(()) if len(found.applied) > 1 else np.zeros(0)
    while len(found.applied) > 1:
        after = found.likelihood.residual(found.applied)
        refits = [
            refit(found.likelihood, found.without(number), steps=_PRUNING_STEPS)
            for number in range(len(found.applied))
        ]
        shares = []
        for number, refitted in enumerate(refits):
            rows = np.flatnonzero(found.rows_changed(number))
            whole = float(np.sum(before[rows] ** 2) - np.sum(after[rows] ** 2))
            shares.append((refitted.chi2 - found.fitted.chi2) / max(whole, 1e-30))
        least = int(np.argmin(shares))
        if shares[least] >= _LIMITS.prune_share:
            return found
        found = found.dropping(least, refits[least])
    return found
