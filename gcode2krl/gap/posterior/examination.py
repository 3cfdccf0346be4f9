"""A link's data with the candidates for it, what was accepted of them, and how large the gap is.

**Size.** In the instrument's units, before and after effects. Clocks, frames and zeros of one run are fitted
within their bounds and taken out. With b the mismatch of machine and tool that fits the rest best within its
bounds and sigma the noise, the floor is sqrt(sigma² + |N·b|²).

**How sure the excess is.** Under the model of the noise alone the mean of x² over n rows has the variance
(2/n)·Σ_k C(k)², C the autocovariance (Bartlett 1946): a slow part makes it large, few rows too. The spread of
the means over stretches of time says the same without the model, but of few stretches roughly. Both are
joined as scaled inverse chi2, and the excess is compared with a t distribution of their freedom (Smyth 2004).

**What is loud for moments** is no part of that mean, since instruments have bursts and heavy tails. Where it
is in step with the command it is none of theirs: of k events so many fall by chance into the share of the
time in which the command changes (binomial test), and their power must be a share of the noise's. Loud
moments near each other are one event, which is where it is loudest: a burst is loud a dozen times, and falls
once.

**Times of places.** Least squares on a signal that is late by a second have a minimum at each stop. The time
at which a place is reached is nearly proportional to the numbers of a time law instead.

**The input of the links behind** is what a link's model says, mismatch included. Encoders' noise would go
into the tip otherwise, magnified by the arm's length, and smoothing would smear the steps that effects make.
What a load encoder shows but the joint does not do, its zero and its clock, stays out.
"""

import functools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import Any

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied, Effect
from gcode2krl.effects.dependence import Dependence
from gcode2krl.effects.effect import JOINTS
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.compare.clocks import gone
from gcode2krl.gap.compare.events import command_changes, strongest_moments
from gcode2krl.gap.compare.interpolation import nearest_rows, rms, usual_step_s, values_of
from gcode2krl.gap.compare.links import SIGNALS
from gcode2krl.gap.compare.trace import Context, Link, Trace, stretches_of, stretches_of_all
from gcode2krl.gap.components import Block, Signatures, blocks_at, blocks_of, strongest_hz
from gcode2krl.gap.noise.nuisance import Candidates, Nuisance, NuisanceDesign, Question, nuisance_for
from gcode2krl.gap.noise.short import Noise
from gcode2krl.gap.posterior.gram import Gram, SignatureGram
from gcode2krl.gap.posterior.least_squares import Fitted, Numbers, Shortened, gauss_newton
from gcode2krl.gap.posterior.likelihood import Key, Likelihood, once_among
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.posterior
_NORMAL_MAD = 1.4826
"""The standard deviation of a normal over its median absolute deviation."""
_MAD_EFFICIENCY = 0.37
"""Of the median absolute deviation for normal values (Rousseeuw & Croux 1993)."""
_MOST_LAGS = 2000
"""Over which the autocovariance is summed; a slow part has forgotten by then."""
_MOMENT_ROWS, _LOUD = 12, 4.0
"""Rows of a moment, and so many times the median moment's power is loud: of white noise one in 10^6."""
_LEAST_STRETCHES = 8
"""Of each of two kinds that are compared."""
_THIRDS = (1 / 3, 2 / 3)
"""Of the stretches, the slow and the fast ones."""
_EVENT_S = 0.3
"""Loud moments no farther apart are one event."""


@dataclass(frozen=True)
class Size:
    """Mean squares over some rows, in the inner unit."""

    rows: int
    before: float
    after: float
    floor: float
    """Noise and normal mismatch."""
    noise: float
    excess: float
    """What is left beyond noise and mismatch, after the effects."""
    excess_before: float
    deviation: float
    """Standard deviation of the excess."""
    largest_before: float
    largest_after: float
    freedom: float = np.inf
    """Degrees of freedom of the deviation."""
    calm_excess: float = 0.0
    """The excess of rows that are no louder than usual: events and heavy tails are not of its test.

    Nor is what is as quick as noise and more than the stated: a finding of the instrument.
    """
    moments_off: int = 0
    """Rows in which a model without noise is off by more than its accuracy, after the effects."""
    loud_in_step: float = 0.0
    """The power of what is loud in step with the command, in one joint or at work, over the noise's.

    0 where that may be chance.
    """

    @property
    def power(self) -> float:
        """Return the power of the gap before the effects over that of the noise."""
        return self.excess_before / max(self.noise, 1e-30)

    @property
    def significant(self) -> bool:
        """Tell whether what is left is more than noise and mismatch."""
        loud = self.calm_excess > _as_many_deviations(self.freedom) * self.deviation
        in_step = self.loud_in_step > _LIMITS.loud_share
        return loud or in_step or self.moments_off >= _LIMITS.model_off_rows

    @property
    def is_loud(self) -> bool:
        """Tell whether what is left is more than noise with its loud rows, which may be the instrument's."""
        return self.excess > _as_many_deviations(self.freedom) * self.deviation

    @property
    def share_left(self) -> float:
        """Return what is left of the structured gap, 0 to 1."""
        return float(np.clip(self.excess / max(self.excess_before, 1e-30), 0.0, 1.0))

    @property
    def shrink(self) -> float:
        """Return the share of the explainable gap that is gone, 0 to 1 (docs/diagnose.md)."""
        gap, gap_after = self.before - self.floor, self.after - self.floor
        return float(np.clip(1.0 - gap_after / gap, 0.0, 1.0)) if gap > 0.0 else 0.0


def pooled(sizes: Sequence[Size]) -> Size:
    """Return the mean over splits, each by its rows."""
    rows = sum(size.rows for size in sizes)

    def mean(values: Sequence[float]) -> float:
        return sum(value * size.rows for value, size in zip(values, sizes, strict=True)) / rows

    names = ("before", "after", "floor", "noise", "excess", "excess_before", "calm_excess")
    return Size(
        rows=rows,
        **{name: mean([getattr(size, name) for size in sizes]) for name in names},
        deviation=mean([size.deviation for size in sizes]) / len(sizes) ** 0.5,
        largest_before=max(size.largest_before for size in sizes),
        largest_after=max(size.largest_after for size in sizes),
        freedom=sum(size.freedom for size in sizes),
        moments_off=sum(size.moments_off for size in sizes),
        loud_in_step=max(size.loud_in_step for size in sizes),
    )


def size_of_gap(
    traces: Sequence[Trace],
    nuisance: Sequence[Sequence[Nuisance]],
    noise: Sequence[Noise],
    applied: Sequence[Applied],
    usual: Sequence[Applied] = (),
) -> Size:
    """Return the size of the gap of some traces with and without effects; ``usual`` are normal mismatch."""
    residuals = [trace.measured - trace.sample([*usual, *applied]) for trace in traces]
    gap = [trace.measured - trace.sample(usual) for trace in traces]
    likelihood = Likelihood(traces, nuisance, noise)
    by_run, shared = fitted_mismatch(likelihood, residuals)
    # clocks, frames and zeros within normal mismatch are taken out of the data, before and after alike
    after, before = _less(residuals, by_run), _less(gap, by_run)
    sigma2 = sum(each.sigma**2 for each in noise)
    structured = _less(after, shared)
    deviation, freedom = _deviation(traces, [_squares(each) for each in structured], noise)
    return Size(
        rows=sum(len(each) for each in after),
        before=_mean_square(before),
        after=_mean_square(after),
        floor=sigma2 + _mean_square(shared),
        noise=sigma2,
        excess=_mean_square(structured) - sigma2,
        excess_before=_mean_square(_less(before, shared)) - sigma2,
        deviation=deviation,
        largest_before=_largest(before),
        largest_after=_largest(after),
        calm_excess=_calm_mean_square(traces, structured, noise) - sigma2 - sum(e.beyond**2 for e in noise),
        freedom=freedom,
        moments_off=moments_off(traces, structured, [*usual, *applied]),
        loud_in_step=max(ask(likelihood, structured) for ask in (_loud_in_step, _rough_joint, _loud_at_work)),
    )


def moments_off(traces: Sequence[Trace], residuals: Sequence[Floats], applied: Sequence[Applied]) -> int:
    """Return in how many rows a rest (n, k) is beyond the accuracy of a model; 0 where noise is the limit.

    A mean over the run does not see what is off at its corners alone.
    """
    if traces[0].link.model_rms == 0.0:
        return 0
    beyond = (
        np.abs(residual) > _LIMITS.model_off * trace.model_error(applied)
        for trace, residual in zip(traces, residuals, strict=True)
    )
    return sum(int(np.count_nonzero(rows.any(axis=1))) for rows in beyond)


def _rough_joint(likelihood: Likelihood, residuals: Sequence[Floats]) -> float:
    """Return by how much more power over its noise's one joint has than most, in two runs; 0 where little.

    Six encoders are alike: what is loud in few of them, for moments too, is no noise.
    """
    if not likelihood.traces[0].of_six_encoders:
        return 0.0
    power = np.array(
        [
            [float(np.mean(likelihood.white(number, j, residual[:, [j]]) ** 2)) for j in range(len(JOINTS))]
            for number, residual in enumerate(residuals)
        ]
    )
    beyond = np.sort(power - np.median(power, axis=1, keepdims=True), axis=0)
    share = float(np.max(beyond[-min(2, len(beyond))]))
    return share if share > _LIMITS.rough_joint else 0.0


def _loud_at_work(likelihood: Likelihood, residuals: Sequence[Floats]) -> float:
    """Return by how much louder a signal is while something is at work, over that; 0 where it may be chance.

    Residuals (n, k) of each trace. A tracker knows nothing of the cut, an encoder nothing of how fast its
    joint turns: what is louder then is the machine's (a rank test, Mann & Whitney 1947, over stretches as
    long as an event).
    """
    from scipy.stats import mannwhitneyu

    traces, components = likelihood.traces, len(likelihood.noise)
    if traces[0].still or not (traces[0].link.of_tip or traces[0].of_six_encoders):
        return 0.0
    loudest = 0.0
    for j in range(components):
        power, work = [], []
        for number, (trace, residual) in enumerate(zip(traces, residuals, strict=True)):
            stretch = ((trace.time_s - trace.time_s[0]) / _EVENT_S).astype(np.int64)
            count = np.bincount(stretch)
            squares = likelihood.white(number, j, residual[:, [j]])[:, 0] ** 2
            of_rows = (squares, _work(trace, j))
            means = [np.bincount(stretch, each)[count > 0] / count[count > 0] for each in of_rows]
            power.append(means[0])
            work.append(means[1])
        powers, works = np.concatenate(power), np.concatenate(work)
        # of the cut what is partly in it tells of neither
        least, most = (0.0, 1.0) if traces[0].link.of_tip else np.quantile(works, _THIRDS)
        idle, busy = powers[works <= least], powers[works >= most]
        if min(len(idle), len(busy)) < _LEAST_STRETCHES or least == most:
            continue
        louder = float(np.median(busy)) / max(float(np.median(idle)), 1e-30) - 1.0
        if mannwhitneyu(busy, idle, alternative="greater").pvalue < _LIMITS.loud_p / components:
            loudest = max(loudest, louder)
    return loudest if loudest > _LIMITS.loud_share else 0.0


def _work(trace: Trace, component: int) -> Floats:
    """Return of each row (n,) whether a tip's tool cuts, or how fast an encoder's joint turns."""
    inputs, rows = trace.inputs, nearest_rows(trace.inputs.time_s, trace.time_s)
    if trace.link.of_tip:
        cuts: Floats = np.any(inputs.force_base_N[rows], axis=1).astype(np.float64)
        return cuts
    joint = JOINTS.index(trace.components[component])
    speed: Floats = np.abs(inputs.rate_rad_s[rows, joint])
    return speed


def _loud_in_step(likelihood: Likelihood, residuals: Sequence[Floats]) -> float:
    """Return the largest power of a component's loud moments in step with the command over its noise's."""
    traces, noise = likelihood.traces, likelihood.noise
    if traces[0].link.model_rms or traces[0].still:
        return 0.0
    changes = [_by_moments(command_changes(each).astype(np.float64), each) for each in traces]
    is_changing = np.asarray(np.concatenate(changes).any(axis=1), dtype=np.bool_)
    moment_s = _MOMENT_ROWS * max(usual_step_s(trace.time_s) for trace in traces)
    shares = [0.0]
    for j in range(len(noise)):
        rows = [
            _by_moments(likelihood.white(number, j, residual[:, [j]])[:, 0], traces[number])
            for number, residual in enumerate(residuals)
        ]
        power = np.mean(np.concatenate(rows) ** 2, axis=1)
        shares.append(_share_in_step(power, is_changing, len(noise), _EVENT_S / moment_s))
    return max(shares)


def _by_moments(values: Floats, trace: Trace) -> Floats:
    """Return values (n,) of a trace by moments (w, rows), those of each segment by themselves."""
    whole = [(first, last - (last - first) % _MOMENT_ROWS) for first, last in trace.segments]
    return np.concatenate([values[first:last] for first, last in whole]).reshape(-1, _MOMENT_ROWS)


def _share_in_step(power: Floats, changes: Bools, components: int, apart: float) -> float:
    """Return the power of loud moments where the command changes (w,) over that of all; 0 if by chance.

    ``apart``: moments between two events at least.
    """
    from scipy.special import bdtrc

    usual = float(np.median(power)) if len(power) else 0.0
    loud = np.flatnonzero(power > _LOUD * usual)
    if usual == 0.0 or len(loud) == 0:
        return 0.0
    first = np.flatnonzero(np.diff(loud, prepend=-np.inf) > max(apart, 1.0))
    loudest = np.repeat(np.maximum.reduceat(power[loud], first), np.diff(first, append=len(loud)))
    in_step = np.logical_or.reduceat((power[loud] == loudest) & changes[loud], first)
    count = int(np.count_nonzero(in_step))
    if count < THRESHOLDS.compare.in_step_least:
        return 0.0
    chance = components * bdtrc(count - 1, len(first), float(np.mean(changes)))
    here = loud[changes[loud]]
    return float(np.sum(power[here] - usual)) / (usual * len(power)) if chance < _LIMITS.loud_p else 0.0


def _less(values: Sequence[Floats], others: Sequence[Floats]) -> list[Floats]:
    return [value - other for value, other in zip(values, others, strict=True)]


def _squares(values: Floats) -> Floats:
    """Return the squared lengths (n,) of rows."""
    squares: Floats = np.sum(values**2, axis=1)
    return squares


def _mean_square(values: Sequence[Floats]) -> float:
    return float(np.mean(np.concatenate([_squares(each) for each in values])))


def _calm_mean_square(traces: Sequence[Trace], values: Sequence[Floats], noise: Sequence[Noise]) -> float:
    """Return the mean square of values (n, k), of each component over its calm rows.

    Over all where the tip shows the same: those that are loud are no heavy tails.
    """
    if traces[0].is_shown_at_tip:
        return _mean_square(values)
    power = 0.0
    for j, model in enumerate(noise):
        columns = [each[:, j] for each in values]
        calm = [model.calm_rows(x, trace.segments) for x, trace in zip(columns, traces, strict=True)]
        power += float(np.mean(np.concatenate([x[rows] for x, rows in zip(columns, calm, strict=True)]) ** 2))
    return power


def _largest(values: Sequence[Floats]) -> float:
    return max(float(np.sqrt(_squares(each)).max()) for each in values)


def fitted_mismatch(likelihood: Likelihood, residuals: Sequence[Floats]) -> tuple[list[Floats], list[Floats]]:
    """Return what nuisance adds to each trace (n, k): that of its own run, and that of all runs.

    No coefficient leaves its bounds: what is beyond them is a gap.
    """
    design = likelihood.design
    b = likelihood.nuisance_of(likelihood.whiten(residuals))
    is_shared = np.arange(design.width) < design.shared
    by_run, shared = (
        [
            design.effect(number, trace, np.where(chosen, b, 0.0))
            for number, trace in enumerate(likelihood.traces)
        ]
        for chosen in (~is_shared, is_shared)
    )
    return by_run, shared


def unexplained_by_mismatch(likelihood: Likelihood, residuals: Sequence[Floats]) -> list[Floats]:
    """Return residuals (n, k) less what normal mismatch adds to each."""
    by_run, shared = fitted_mismatch(likelihood, residuals)
    return _less(_less(residuals, by_run), shared)


def _deviation(
    traces: Sequence[Trace], squares: Sequence[Floats], noise: Sequence[Noise]
) -> tuple[float, float]:
    """Return the standard deviation of the mean square, and its degrees of freedom."""
    stretches = [_stretch_means(trace, values) for trace, values in zip(traces, squares, strict=True)]
    means, counts = (np.concatenate(each) for each in zip(*stretches, strict=True))
    # robust, since a gap in a few stretches must not hide itself
    spread = _NORMAL_MAD * float(np.median(np.abs(means - np.median(means))))
    least = _LIMITS.least_spread * abs(float(np.average(means, weights=counts))) / np.sqrt(len(means))
    scattered = max(spread, least) ** 2 / len(means)
    modelled = sum(_variance_of_power(each, float(counts.sum())) for each in noise)
    freedom, of_model = _MAD_EFFICIENCY * (len(means) - 1), _LIMITS.modelled_freedom
    joined = (freedom * scattered + of_model * modelled) / (freedom + of_model)
    return float(np.sqrt(max(joined, modelled))), freedom + of_model


def _variance_of_power(noise: Noise, rows: float) -> float:
    """Return the variance of the mean of x² over rows of noise.

    That of a slow part counts twice: its rms is learnt from as few independent values as it is compared with.
    """

    def summed(model: Noise) -> float:
        c = model.autocovariance(min(int(rows), _MOST_LAGS))
        return float(2.0 * (c[0] ** 2 + 2.0 * np.sum(c[1:] ** 2)) / rows)

    short = summed(replace(noise, slow=()))
    return short if not noise.slow else 2.0 * summed(noise) - short


@functools.lru_cache
def _as_many_deviations(freedom: float) -> float:
    """Return how many deviations are as rare as `significant_sigma` of a normal distribution."""
    from scipy.special import ndtr, stdtrit

    if not np.isfinite(freedom):
        return _LIMITS.significant_sigma
    return float(-stdtrit(freedom, ndtr(-_LIMITS.significant_sigma)))


def _stretch_means(trace: Trace, values: Floats) -> tuple[Floats, Floats]:
    """Return the means (g,) of values (n,) over the stretches of a trace, and their counts."""
    number = stretches_of(trace)
    number = number - number.min()
    count = np.bincount(number)
    sums = np.bincount(number, weights=values)
    return sums[count > 0] / count[count > 0], count[count > 0].astype(np.float64)


_PLACES = 400
"""Of a run, at equal ways."""
_STEPS = 8
_STEP_SHARE = 0.1
"""Of a typical size: a controller's times are whole cycles, and smaller differences are none."""
_SETTLED_SHARE = 0.98
"""A step that leaves more of the rms ends the fit: a refit on the signals follows."""


class PlaceTimes:
    """The measured times at which runs reach places, to be compared with those of plans."""

    def __init__(self, traces: Sequence[Trace]) -> None:
        self.traces = list(traces)
        self.measured = [gone(trace.time_s, trace.measured, trace.link.least_step) for trace in traces]

    def late(self, applied: Sequence[Applied]) -> Floats:
        """Return how late (runs · places,) the runs are beside a plan with these effects, in s.

        Of each run its mean, which is its clock's, is taken off.
        """
        late = []
        for trace, (measured_s, measured_way) in zip(self.traces, self.measured, strict=True):
            signals = trace.signals(applied)
            values = values_of(signals, trace.plus)
            time_s, way = gone(signals.time_s, values[:, list(trace.columns)], 0.0)
            at = measured_way[-1] * (np.arange(_PLACES) + 0.5) / _PLACES
            behind = np.interp(at, measured_way, measured_s) - np.interp(at, way, time_s)
            late.append(behind - behind.mean())
        return np.concatenate(late)

    def size(self, applied: Sequence[Applied]) -> float:
        """Return the rms by which runs are late beside a plan, in s; infinite where there is none."""
        try:
            return rms(self.late(applied))
        except Gcode2KrlError:
            return np.inf

    def fitted(self, others: Sequence[Applied], start: Applied) -> Applied:
        """Return the effect whose numbers meet the measured times best, from a start."""
        numbers = Numbers.of([start], self.traces[0])

        def late(x: Floats) -> Floats:
            return self.late((*others, *numbers.applied(x)))

        try:
            control = Shortened(numbers.box)
            x = numbers.start([start])
            least = gauss_newton(
                late, x, numbers.box, control, _settled, most_steps=_STEPS, step_share=_STEP_SHARE
            )
        except Gcode2KrlError:
            return start
        return numbers.applied(least.x)[0]


def _settled(before: float, after: float) -> bool:
    return after > _SETTLED_SHARE**2 * before


_MOTION = frozenset({Dependence.VELOCITY, Dependence.ACCELERATION, Dependence.JERK, Dependence.TONE})
"""What poses do not have."""


def question_of(link: Link, traces: Sequence[Trace], context: Context) -> Question:
    """Return what a link is examined for."""
    cell = traces[0].inputs.cell
    moments_s = cache(partial(strongest_moments, traces))
    blocks = [
        block
        for effect in context.candidates()
        if not (traces[0].still and effect.depends_on & _MOTION)
        for target in effect.targets(cell)
        if effect.searched(link.name, target, context.examined_at(effect, target))
        for block in _blocks(effect.at(target), target, traces, moments_s)
    ]
    upstream = frozenset(each.name for each in SIGNALS if not context.has_data(each.name))
    return Question(
        context.known,
        blocks,
        context.mismatch,
        upstream,
        link.clocks(context),
        link.clock_share(context),
        context.seed,
        context.joints,
        tuple(
            judged
            for judged in context.judgements
            if judged.verdict == "unexplained" and not judged.link.tells_time
        ),
    )


def _blocks(
    effect: Effect,
    target: str | None,
    traces: Sequence[Trace],
    moments_s: Callable[[float, float], Sequence[float]],
) -> Iterator[Block]:
    """Yield the blocks of an effect.

    One with a frequency is tried at the strongest of the residuals, one that begins at a moment where they
    jump.
    """
    if effect.moment is not None:
        stretches = len(np.unique(stretches_of_all(traces)))
        yield from blocks_at(effect, target, moments_s(effect.moment.low, effect.moment.high), stretches)
        return
    p = effect.frequency
    if p is None:
        yield from blocks_of(effect, target)
        return
    residuals = [trace.residual for trace in traces]
    step_s = usual_step_s(traces[0].time_s)
    peaks = strongest_hz(residuals, step_s, p.low, p.high, THRESHOLDS.posterior.frequency_peaks)
    duration_s = float(traces[0].time_s[-1] - traces[0].time_s[0])
    yield from blocks_at(effect, target, peaks, (p.high - p.low) * duration_s)


_ACTS = 1e-6
"""Smaller shares of the largest change are rounding errors of a simulation."""


@dataclass(frozen=True, eq=False)
class LinkData:
    """What a selection starts from: a link's traces, the candidates, and the likelihood of both."""

    link: Link
    traces: tuple[Trace, ...]
    question: Question
    known: Signatures
    candidates: Candidates
    likelihood: Likelihood
    signatures: SignatureGram

    @classmethod
    def of(
        cls,
        link: Link,
        traces: Sequence[Trace],
        question: Question,
        known: Signatures,
        candidates: Candidates,
        nuisance: Sequence[Sequence[Nuisance]],
        noise: Sequence[Noise],
    ) -> "LinkData":
        """Return the data with their likelihood under a model of the noise."""
        likelihood = Likelihood(traces, nuisance, noise)
        signatures = likelihood.gram(candidates.signatures)
        blocks = [column.block for column in candidates.columns]
        bounded = {block.key for block in blocks if block.effect.usual(question.mismatch, 1.0)}
        once = once_among(likelihood.design, candidates, signatures, bounded)
        likelihood = likelihood.counting(once)
        return cls(link, tuple(traces), question, known, candidates, likelihood, signatures)

    def chosen(self) -> "LinkData":
        """Return the data without large columns, most of which a selection alone needs."""
        candidates, likelihood = replace(self.candidates, signatures=()), self.likelihood.put_away()
        return replace(self, candidates=candidates, signatures=SignatureGram.none(), likelihood=likelihood)

    @property
    def values(self) -> int:
        """Return the number of values."""
        return sum(trace.measured.size for trace in self.traces)

    @property
    def times(self) -> int:
        """Return the number of times at which there are values."""
        return sum(len(trace.time_s) for trace in self.traces)

    @cached_property
    def place_times(self) -> PlaceTimes:
        """The times at which the runs are at each place."""
        return PlaceTimes(self.traces)

    def gram(self, fitted: Fitted, without: Collection[int] = ()) -> Gram:
        """Return the fast view beside the accepted effects, or all but some of them."""
        others = tuple(each for number, each in enumerate(fitted.applied) if number not in without)
        tangents = self.likelihood.tangents(fitted.numbers, fitted.x, without)
        return self.signatures.beside(self.likelihood.data(others, tangents))


@dataclass(frozen=True, eq=False)
class Examination:
    """What is accepted of a link's candidates."""

    data: LinkData
    fitted: Fitted
    surprises: tuple[float, ...] = ()
    """Of each accepted effect: -log of the probability of its gain without it."""
    usual: tuple[bool, ...] = ()
    """Of each accepted effect: it is within normal mismatch, in the model but not reported."""
    rejected: frozenset[Key] = frozenset()
    level: float = 0.0
    """The surprise that the last candidates had to pass."""
    first_level: float = 0.0
    """That of all candidates, before any was accepted."""
    observable: tuple[tuple[float, float], ...] = ()
    """Of each candidate's columns: the share of their power that nuisance leaves, and that power."""

    def chosen(self) -> "Examination":
        """Return it without large columns, when nothing more is chosen."""
        return replace(self, data=self.data.chosen())

    def settled(self) -> "Examination":
        """Return the same when no other traces are examined either."""
        self.data.known.forget()
        return self.chosen()

    @property
    def link(self) -> Link:
        """Return the link."""
        return self.data.link

    @property
    def traces(self) -> tuple[Trace, ...]:
        """Return the traces that explain."""
        return self.data.traces

    @property
    def question(self) -> Question:
        """Return what the link is examined for."""
        return self.data.question

    @property
    def likelihood(self) -> Likelihood:
        """Return the likelihood of the link's data."""
        return self.data.likelihood

    @property
    def noise(self) -> list[Noise]:
        """Return the noise of each component."""
        return list(self.likelihood.noise)

    @property
    def applied(self) -> tuple[Applied, ...]:
        """Return the accepted effects, those within normal mismatch included."""
        return self.fitted.applied

    @property
    def causes(self) -> tuple[Applied, ...]:
        """Return the accepted effects that are more than normal mismatch."""
        return tuple(self.applied[number] for number in self.cause_numbers)

    @property
    def cost(self) -> float:
        """Return chi2 and the cost of the numbers."""
        return self.fitted.chi2 + self.fitted.occam

    @property
    def mismatch(self) -> tuple[Applied, ...]:
        """Return the accepted effects that are within normal mismatch."""
        return tuple(each for each, usual in zip(self.applied, self.usual, strict=True) if usual)

    @property
    def cause_numbers(self) -> tuple[int, ...]:
        """Return which of the accepted effects are more than normal mismatch."""
        return tuple(number for number, usual in enumerate(self.usual) if not usual)

    @property
    def errors_of_set_up(self) -> frozenset[int]:
        """Return which of the accepted effects are errors of the set-up."""
        applied = enumerate(self.applied)
        return frozenset(number for number, each in applied if each.effect.of_set_up)

    def is_of_set(self, number: int) -> bool:
        """Tell whether an accepted effect is one of several errors of the set-up."""
        return number in self.errors_of_set_up and len(self.errors_of_set_up) > 1

    @property
    def accepted_keys(self) -> frozenset[Key]:
        """Return names and targets of the accepted effects."""
        return frozenset(applied.key for applied in self.applied)

    def without(self, number: int) -> tuple[Applied, ...]:
        """Return the accepted effects but one."""
        return tuple(each for i, each in enumerate(self.applied) if i != number)

    def dropping(self, number: int, refitted: Fitted) -> "Examination":
        """Return the examination without one of the accepted effects, the others refitted."""
        return replace(
            self,
            fitted=refitted,
            surprises=(*self.surprises[:number], *self.surprises[number + 1 :]),
            usual=(*self.usual[:number], *self.usual[number + 1 :]),
        )

    def rejecting(self, key: Key) -> "Examination":
        """Return the examination with a candidate that is not tried again."""
        return replace(self, rejected=self.rejected | {key})

    @cached_property
    def gains(self) -> Floats:
        """(c,) by how much chi2 is larger without each accepted effect, the others as they are."""
        without = [self.likelihood.chi2(self.without(number)) for number in range(len(self.applied))]
        return np.array(without) - self.fitted.chi2

    def changed(self, number: int) -> Floats:
        """Return what an accepted effect does to the data (v,), whitened."""
        others = self.without(number)
        change: Floats = self.likelihood.whiten(
            [trace.sample(self.applied) - trace.sample(others) for trace in self.traces]
        )
        return change

    def rows_changed(self, number: int) -> Bools:
        """Return which of the data (v,) an accepted effect changes at all."""
        return acts(self.changed(number))


def acts(change: Floats) -> Bools:
    """Return which of the data (v,) a change is more than rounding of."""
    changed: Bools = np.abs(change) > _ACTS * np.abs(change).max(initial=0.0)
    return changed


def fitted_signal(trace: Trace, examination: Examination, stamps_s: Floats | None = None) -> Floats:
    """Return what the link does to the joints (n, k): its effects and the mismatch that fits best.

    At the trace's own stamps, or at others (n,): rows that were left out of the trace, of a burst or where
    the joints turn about, have a model too.
    """
    applied = examination.applied
    nuisance = nuisance_for([trace], examination.question, examination.data.known)
    likelihood = Likelihood([trace], nuisance, examination.noise)
    b = likelihood.nuisance_of(likelihood.whiten([trace.measured - trace.sample(applied)]))
    if trace.link.instrument:
        applied = tuple(each for each in applied if not each.effect.is_clock)
        b[np.isin(likelihood.design.names(0), trace.link.instrument)] = 0.0
    shown, design = trace, likelihood.design
    if stamps_s is not None and not np.array_equal(stamps_s, trace.time_s):
        shown = at_stamps(trace, stamps_s)
        design = NuisanceDesign.of(nuisance_for([shown], examination.question, Signatures()))
        b = _renamed(b, likelihood.design.names(0), design.names(0))
    if trace.link.instrument:
        shown = replace(shown, plus_late_s=0.0)
    return shown.sample(applied) + design.effect(0, shown, b)


def _renamed(b: Floats, names: Sequence[str], wanted: Sequence[str]) -> Floats:
    """Return coefficients (m,) in the order of other names; 0 for mismatch that was not there."""
    of_name: dict[str, list[float]] = {}
    for name, value in zip(names, b.tolist(), strict=True):
        of_name.setdefault(name, []).append(value)
    remaining = {name: iter(values) for name, values in of_name.items()}
    return np.array([next(remaining.get(name, iter(())), 0.0) for name in wanted])


def at_stamps(trace: Trace, stamps_s: Floats) -> Trace:
    """Return a trace of the same run at other stamps (n,), in one segment and with nothing measured."""
    nothing = np.zeros((len(stamps_s), trace.shape[1]))
    return replace(trace, time_s=stamps_s, measured=nothing, segments=np.array([[0, len(stamps_s)]]))


def observable(examination: Examination) -> list[dict[str, Any]]:
    """Return for each effect with one size the smallest that would have been reported in this link.

    From the first order of its signature; nothing of a path that is sound. ``seen`` is false where mismatch
    could do nearly all that it does.
    """
    smallest: dict[Key, dict[str, Any]] = {}
    needed = max(2.0 * examination.first_level, _LIMITS.least_ratio**2 * examination.data.times)
    columns = examination.data.candidates.columns
    for column, (share, power) in zip(columns, examination.observable, strict=False):
        block = column.block
        name = _only_size(block)
        if column.width != 1 or name is None or power <= 0.0:
            continue
        entry = {
            "link": examination.link.name,
            "effect": block.effect.name,
            "target": block.target,
            "parameter": name,
            "smallest": _typical(examination, block, name) * float(np.sqrt(needed / power)),
            "seen": share >= _LIMITS.observable_share,
        }
        if block.key not in smallest or entry["smallest"] < smallest[block.key]["smallest"]:
            smallest[block.key] = entry
    return list(smallest.values())


def _only_size(block: Block) -> str | None:
    """Return the name of an effect's size, where it has one."""
    sizes = [p.name for p in block.effect.parameters if not p.is_shape]
    return sizes[0] if len(sizes) == 1 else None


def _typical(examination: Examination, block: Block, name: str) -> float:
    """Return by how much a typical effect is away from nominal."""
    inputs = examination.traces[0].inputs
    start, nominal = (f(inputs, block.target)[name] for f in (block.effect.start, block.effect.nominal))
    return abs(start - nominal)
