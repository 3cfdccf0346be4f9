"""The tests that stand between a form and a name: constancy of a cause's size, intervals, and its family.

**Constancy.** With a cause in the model, what is left of a part of the data is fitted by s times what the
cause does there. s is then by which share of it the cause is larger in that part. A cause that is what it is
called has the same size everywhere, in all runs, in both halves of each and, of a clock, in all joints; a
wrong clock is one number in all joints, and that is its proof.

**Intervals** of 90 %: the covariance of a fit by clusters, and what the model itself is off by.

**Families.** A cause is named only if (a) its family is the best when the cause is taken out of the model, or
one to the data with the best; (b) its form takes nearly all that its family takes; (c) beside it no other
family takes a share of the gap worth naming. All of it is on every run, those that explained included.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import stats

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied, Parameter, Role
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import JOINTS
from gcode2krl.effects.mismatch import sigma
from gcode2krl.gap.compare.clocks import residual_by_place
from gcode2krl.gap.compare.trace import Trace
from gcode2krl.gap.components import TIMING, Grid
from gcode2krl.gap.noise.nuisance import nuisance_for
from gcode2krl.gap.posterior.examination import Examination
from gcode2krl.gap.posterior.families import Evidence, Rows, View
from gcode2krl.gap.posterior.gram import SplitColumns, clustered_covariance
from gcode2krl.gap.posterior.least_squares import Fitted, Numbers
from gcode2krl.gap.posterior.likelihood import Likelihood, sensitivity_of
from gcode2krl.gap.posterior.study import Study, studies
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.posterior


@dataclass(frozen=True, kw_only=True)
class Constancy:
    """Whether a cause's numbers are the same in all runs, halves of them and joints."""

    inconstancy: float
    """Spread of the size over parts of the data beyond what noise lets it vary, over the size."""
    p: float
    """Probability of at least that spread where the size is one number."""

    @property
    def is_one_number(self) -> bool:
        """Tell whether the size may be one number: it varies little, or no more than chance lets it."""
        return self.inconstancy < _LIMITS.most_inconstant or self.p > _LIMITS.inconstant_p


class Part(NamedTuple):
    """A part of the data: by which share of it a cause is larger there, and the variance of that."""

    share: float
    variance: float


def constancy_of(examination: Examination, number: int) -> Constancy | None:
    """Return the constancy of an accepted effect over the division of the data in which it is least.

    p is that of the spread's chi2 (Cochran 1954), times the number of divisions (Bonferroni). None where the
    effect acts in one part of the data only.
    """
    divisions = [each for each in _divisions(examination, number) if any(len(group) > 1 for group in each)]
    if not divisions:
        return None
    spreads = [_spread(groups) for groups in divisions]
    worst = min(spreads, key=lambda each: each.p)
    return replace(worst, p=min(1.0, len(spreads) * worst.p))


def spread_between_runs(examination: Examination, number: int) -> tuple[float, int]:
    """Return the spread of an effect's size between runs beyond noise, as a share, and the count of runs."""
    parts = _by_run(_Residual.of(examination, number))
    return (_spread([parts]).inconstancy, len(parts)) if len(parts) > 1 else (0.0, len(parts))


def _divisions(examination: Examination, number: int) -> Iterator[list[list[Part]]]:
    """Yield groups of parts whose sizes should be one number within each group."""
    residual = _Residual.of(examination, number)
    usual = _usual_share(examination, number)
    yield [[Part(part.share, part.variance + usual**2) for part in _by_run(residual)]]
    yield [_halves(residual, run) for run in range(len(examination.traces))]
    if examination.link.of_joints and examination.applied[number].effect.is_clock:
        joints = range(examination.traces[0].shape[1])
        yield [_kept([residual.part(residual.component == joint) for joint in joints])]


def _usual_share(examination: Examination, number: int) -> float:
    """Return how much normal mismatch of its form lets an effect vary from run to run, as a share of it."""
    applied, trace = examination.applied[number], examination.traces[0]
    if not examination.likelihood.own_alike(applied):
        return 0.0
    duration_s = float(trace.time_s[-1] - trace.time_s[0])
    bounds = applied.effect.usual(examination.question.mismatch, duration_s, examination.question.clocks)
    nominal = applied.effect.nominal(trace.inputs, applied.target)
    largest = max(
        (abs(applied[name] - nominal[name]) / bound for name, bound in bounds.items() if bound > 0.0),
        default=0.0,
    )
    return sigma(1.0 / largest) if largest > 0.0 else 0.0


# Parts


@dataclass(frozen=True, eq=False)
class _Residual:
    """Whitened values (v,): what is left with all effects, what one of them does, and nuisance beside it."""

    left: Floats
    change: Floats
    nuisance: SplitColumns
    """(v, m) each run's own, that of the effect's form left out."""
    run: Floats
    time_s: Floats
    component: Floats
    inflation: float
    set_share: Floats
    """(runs,) of a clock what was taken off the stamps of each run already, as a share of it."""

    @classmethod
    def of(cls, examination: Examination, number: int) -> "_Residual":
        """Return the residual beside an accepted effect."""
        likelihood, applied, traces = examination.likelihood, examination.applied, examination.traces
        change = likelihood.whiten(
            [trace.sample(applied) - trace.sample(examination.without(number)) for trace in traces]
        )
        residual = likelihood.residual(applied)[: len(change)]
        shapes = [trace.shape for trace in traces]
        return cls(
            residual,
            change,
            likelihood.own_nuisance(applied[number]),
            np.concatenate([np.full(n * k, run) for run, (n, k) in enumerate(shapes)]),
            np.concatenate([np.tile(trace.time_s, trace.shape[1]) for trace in traces]),
            np.concatenate([np.repeat(np.arange(k), n) for n, k in shapes]),
            sensitivity_of(likelihood, examination.fitted, number).inflation(),
            _set_shares(examination, number),
        )

    def part(self, rows: Bools) -> Part | None:
        """Return the effect's share in some rows; None where it does next to nothing there."""
        change, residual = self.change[rows], self.left[rows]
        whole = float(self.change @ self.change)
        if not rows.any() or float(change @ change) < _LIMITS.least_part * whole:
            return None
        inner = self.nuisance.gram_in(rows) + np.eye(self.nuisance.width)
        on_change, on_left = (np.stack([self.change, self.left]) * rows) @ self.nuisance
        explained = np.linalg.solve(inner, np.column_stack([on_change, on_left]))
        information = float(change @ change - on_change @ explained[:, 0])
        if information < _LIMITS.least_part * float(change @ change):  # the run's own mismatch does the same
            return None
        share = float(change @ residual - on_change @ explained[:, 1]) / information
        return Part(share, self.inflation / information)


def _set_shares(examination: Examination, number: int) -> Floats:
    """Return by which share of a clock each run's stamps (runs,) were moved before it was fitted."""
    applied = examination.applied[number]
    offset_s = applied[applied.effect.sizes[0].name] if applied.effect.is_clock else 0.0
    moved_s = np.array([trace.clock_set_s for trace in examination.traces])
    return moved_s / offset_s if offset_s != 0.0 else np.zeros(len(moved_s))


def _kept(parts: Sequence[Part | None]) -> list[Part]:
    return [part for part in parts if part is not None]


def _by_run(residual: _Residual) -> list[Part]:
    parts = [residual.part(residual.run == run) for run in range(len(residual.set_share))]
    moved = zip(parts, residual.set_share.tolist(), strict=True)
    return [Part(part.share + share, part.variance) for part, share in moved if part is not None]


def _halves(residual: _Residual, run: int) -> list[Part]:
    """Return both halves of a run, in which an effect does as much."""
    of_run = residual.run == run
    order = np.argsort(residual.time_s[of_run], kind="stable")
    power = np.cumsum(residual.change[of_run][order] ** 2)
    middle_s = residual.time_s[of_run][order][int(np.searchsorted(power, power[-1] / 2.0))]
    early = residual.time_s <= middle_s
    return _kept([residual.part(of_run & early), residual.part(of_run & ~early)])


# Spread


def _spread(groups: Sequence[Sequence[Part]]) -> Constancy:
    """Return the spread within groups beyond the variances (DerSimonian & Laird 1986), and its p."""
    chi2 = freedom = weight = 0.0
    for group in groups:
        if len(group) < 2:
            continue
        shares, weights = np.array([p.share for p in group]), np.array([1.0 / p.variance for p in group])
        mean = float(weights @ shares / weights.sum())
        chi2 += float(weights @ (shares - mean) ** 2)
        freedom += len(group) - 1
        weight += float(weights.sum() - weights @ weights / weights.sum())
    variance = max(0.0, chi2 - freedom) / weight if weight > 0.0 else 0.0
    p = float(stats.chi2.sf(chi2, freedom)) if freedom else 1.0
    return Constancy(inconstancy=variance**0.5, p=p)


_DRAWS = 400
"""Quantiles at 5 and 95 % are then known to a tenth of a deviation."""
_ENDS = (0.05, 0.95)


class Interval(NamedTuple):
    """A value and its 90 % interval."""

    value: float
    low: float
    high: float


def intervals_of(examination: Examination) -> list[dict[str, Interval]]:
    """Return the interval of every parameter of every accepted effect.

    Quantiles of draws from the fit's covariance, added in quadrature to the errors of models and to what the
    effect's size differs by from run to run. A size that was held has the interval that it would have if it
    were free; a shape that was held was not found, and has none.
    """
    if not examination.applied:
        return []
    draws = _draws(examination.fitted, covariance_of(examination.likelihood, examination.fitted))
    intervals = [_effect_intervals(examination, number, draws) for number in range(len(examination.applied))]
    if not any(each.held for each in examination.applied):
        return intervals
    free = replace(examination, fitted=_freed(examination.fitted, examination.traces[0]))
    wide = intervals_of(free)
    return [
        {
            name: wide[number][name] if name in applied.held else interval
            for name, interval in intervals[number].items()
            if name not in applied.held or not applied.effect.parameter(name).is_shape
        }
        for number, applied in enumerate(examination.applied)
    ]


def _freed(fitted: Fitted, trace: Trace) -> Fitted:
    """Return a fit at the same numbers with those free that were held."""
    applied = tuple(replace(each, held=frozenset()) for each in fitted.applied)
    numbers = Numbers.of(applied, trace)
    x = numbers.start(applied)
    return Fitted(applied, fitted.chi2, numbers, x, np.zeros((len(x), len(x))))


def _draws(fitted: Fitted, covariance: Floats) -> Floats:
    """Return draws (d, p) of the numbers."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2.0)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    normal = np.random.default_rng(0).standard_normal((_DRAWS, len(fitted.x)))
    draws: Floats = fitted.x + normal @ root.T
    return draws


def _effect_intervals(examination: Examination, number: int, draws: Floats) -> dict[str, Interval]:
    """Return the interval of each parameter of an accepted effect."""
    numbers, values = examination.fitted.numbers, examination.applied[number].values
    free, of_effect = numbers.free[number], draws[:, numbers.slices[number]]
    drawn = [free.applied(x).values for x in np.clip(of_effect, free.low, free.high)]
    share = _LIMITS.law_error if free.effect.plans_anew else _LIMITS.model_error
    mismatch, between = _mismatch(examination, number), _between_runs(examination, number)
    return {
        name: _interval(
            free.effect.parameter(name),
            value,
            np.array([each[name] for each in drawn]),
            float(np.linalg.norm([share * value, mismatch.get(name, 0.0), between * value])),
        )
        for name, value in values.items()
    }


def _between_runs(examination: Examination, number: int) -> float:
    """Return the half-width, as a share, that the spread between runs adds to a clock.

    Student's quantile of the mean over the runs.
    """
    applied = examination.applied[number]
    if not applied.effect.is_clock or not examination.likelihood.own_alike(applied):
        return 0.0
    spread, runs = spread_between_runs(examination, number)
    return float(stats.t.ppf(_ENDS[1], runs - 1) * spread / runs**0.5) if runs > 1 else 0.0


def _mismatch(examination: Examination, number: int) -> dict[str, float]:
    """Return the half-widths that normal mismatch of the same form adds to an effect in a joint.

    It is nuisance of the covariance at its own small size, which at that of the effect has another shape.
    """
    effect = examination.applied[number].effect
    if not examination.link.of_joints or examination.link.tells_time or not effect.is_nuisance:
        return {}
    bounds = effect.usual(examination.question.mismatch, 1.0)
    return {name: _LIMITS.inside_bound * bound for name, bound in bounds.items()}


def _interval(parameter: Parameter, value: float, drawn: Floats, model: float) -> Interval:
    """Return the interval of draws (d,), an angle's about its value, and of what the model is off by."""
    away = drawn - value
    model = 0.0 if parameter.role in (Role.COUNT, Role.MOMENT) else model
    if parameter.role is Role.PHASE:
        away = (away + np.pi) % (2.0 * np.pi) - np.pi
    low, high = np.quantile(away, _ENDS).tolist()
    return Interval(value, value - float(np.hypot(low, model)), value + float(np.hypot(high, model)))


def covariance_of(likelihood: Likelihood, fitted: Fitted) -> Floats:
    """Return the covariance (p, p) of a fit's numbers by stretches of time.

    The information holds the prior of `prior_sizes`: what the data do not see stays as uncertain as it was.
    Fewer stretches than `least_stretches` cannot tell how scores scatter.
    """
    scale = fitted.numbers.box.scale
    jacobian = likelihood.jacobian(fitted.numbers, fitted.x, bounded=False)
    information = jacobian.T @ jacobian + THRESHOLDS.posterior.prior_sizes**-2 * np.eye(len(scale))
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    scores = likelihood.scores(jacobian, likelihood.residual(fitted.applied))
    if len(scores) >= _LIMITS.least_stretches:
        covariance = clustered_covariance(covariance, scores, small_sample=True)
    return covariance * np.outer(scale, scale)


_PRIOR = THRESHOLDS.posterior.prior_sizes
_MOVED = 1e-3
"""Of the power in the component that a cause moves most: one with less is not moved."""


@dataclass(frozen=True, eq=False)
class FamilyTests:
    """What families say of one cause; the numbers are features of its probability."""

    margin: float
    """Evidence of its own family over that of the best other one with the cause taken out, in nats, over the
    inflation; the refitted form counts as a member of its family. One of far less power is none."""
    form_ratio: float
    """Of what its own family takes, the share that its form takes."""
    other_share: float
    """Of the gap's power, what the best other family takes beside the refitted effect.

    0 where none does, or where its own family takes more of the same: then its form is another."""
    other_power: float
    """That family's share of the power of both in the signal.

    Slow noise hides the power of slow effects from chi2, so that a rest of a hundredth of the gap may take
    most of what can be told of it."""
    family: Evidence | None
    """The best member of its own family."""
    better: Evidence | None
    """The best other family with the cause taken out."""
    family_behind: float | None = None
    """By how much the best function of what it depends on is worse than its form, in nats over the inflation;
    None where its family says nothing."""
    least_form: float = _LIMITS.form_ratio
    """The share that its form has to take. Geometry is exact: that is off by no more than its numbers are."""

    @property
    def is_best(self) -> bool:
        """Tell whether no other family is better beyond what the data can tell."""
        return self.margin > -_LIMITS.alike_nats

    @property
    def form_fits(self) -> bool:
        """Tell whether its form takes nearly all that its family takes."""
        return self.form_ratio >= self.least_form

    @property
    def is_alone(self) -> bool:
        """Tell whether no other family takes a share worth naming beside it."""
        return self.other_share < _LIMITS.other_share or self.other_power < _LIMITS.other_power


def net_gain(evidence: Evidence) -> float:
    """Return twice the evidence: the gain minus what its numbers cost; 0 where it is not significant."""
    significant = evidence.nats / evidence.inflation > _LIMITS.least_evidence
    return 2.0 * evidence.nats if significant else 0.0


@dataclass(frozen=True, eq=False)
class Rest:
    """On what depends what is left of a link beside some effects."""

    study: Study
    gap_gain: float
    """Fall of chi2 by all that is known to explain the gap: the power of the gap beyond noise."""
    is_sized: bool = False
    """Its size alone is significant: then families need not prove that there is a rest."""
    upstream_gain: float = 0.0
    """Power beyond noise of what earlier links have shown of the joints, and the model has of them."""

    def share(self, evidence: Evidence) -> float:
        """Return the share of the gap's power that a family takes; 0 where it is not significant."""
        return min(net_gain(evidence) / max(self.gap_gain, 1e-30), 1.0)

    @property
    def is_gap(self) -> bool:
        """Tell whether a family is so significant that there is a gap, whatever the size of the rest."""
        return self._is_large or self.study.command_p <= _LIMITS.gap_p

    @property
    def _is_large(self) -> bool:
        """Tell whether one is so by its size and by the signs of stretches."""
        best = max(self.study.evidences, key=self._nats_beyond_time, default=None)
        # of all that is known the form is known to a hundredth of its size, however long one looks at it
        if best is None or net_gain(best) < _LIMITS.form_error**2 * (self.gap_gain + self.upstream_gain):
            return False
        # few strong stretches have few signs to flip; beyond all that models are off by, none are needed
        is_rare = self.study.tail_p <= _LIMITS.gap_p
        least = _LIMITS.gap_evidence if is_rare else _LIMITS.certain_evidence
        return self._nats_beyond_time(best) >= least

    def _nats_beyond_time(self, evidence: Evidence) -> float:
        """Return its nats over the inflation, less those of time in the run, which slow noise follows.

        Or less those of one stretch of time, where that is more: a function shows in others too, and only a
        step need not.
        """
        own_time = (
            max(other.nats, 0.0)
            for other in self.study.evidences
            if other.on is Dependence.RUN_TIME and other.place.component == evidence.place.component
        )
        one_share = 0.0 if evidence.on is Dependence.RUN_TIME_STEP else evidence.in_one
        # each for itself: what one stretch has time follows too, and is not taken off twice
        less = max([0.5 * evidence.gain * one_share, *own_time])
        return (evidence.nats - less) / evidence.inflation

    @property
    def worth_naming(self) -> tuple[Evidence, ...]:
        """Return the families that take a share of the gap worth naming, the most probable first."""
        least = _LIMITS.significant_p
        if not self.is_sized and self.study.p > least and self.study.command_p > least:
            return ()
        return tuple(each for each in self.study.evidences if self.share(each) >= _LIMITS.other_share)


NOTHING_LEFT = Rest(Study(0.0, (), 1.0), 0.0)
"""The rest of a link that families are not asked about."""


class LinkFamilies:
    """The families of a link: what each says beside all accepted effects, and with each cause taken out."""

    def __init__(self, examination: Examination, traces: Sequence[Trace]) -> None:
        """Take the traces that explain and those that are held out."""
        nuisance = nuisance_for(traces, examination.question, examination.data.known)
        likelihood = Likelihood(traces, nuisance, examination.noise)
        self._found, self._rows = examination, Rows(likelihood)
        tangents = likelihood.tangents(examination.fitted.numbers, examination.fitted.x)
        self._whole = View.of(self._rows, self._left(examination.applied), tangents)
        self._grid = Grid(traces, [noise.sigma for noise in examination.noise])
        numbers = examination.cause_numbers
        outs = [self._without((number,)) for number in numbers]
        everything, *self._outs = studies(
            self._rows, [self._whole, *outs], self._grid, examination.question.seed
        )
        self._bare = self._without(numbers)
        self.rest = Rest(
            everything,
            self._gap_gain(everything.evidences, None),
            upstream_gain=_upstream_gain(likelihood),
        )
        """Beside all accepted effects."""
        self.tests = tuple(
            self._tests(number, out, study)
            for number, out, study in zip(numbers, outs, self._outs, strict=True)
        )
        """Of each cause, in the order of `Examination.cause_numbers`."""
        self.gap_p = tuple(study.p for study in self._outs)
        """Of each cause: p of the best family's evidence with the cause taken out."""

    @property
    def traces(self) -> Sequence[Trace]:
        """Return the traces that it is of."""
        return self._rows.traces

    @property
    def effects_nats(self) -> float:
        """Return the evidence of all causes together."""
        return 0.5 * (self._bare.chi2 - self._whole.chi2 - self._found.fitted.occam)

    def beside(self, named: Collection[int]) -> Rest:
        """Return on what depends what is left beside the named causes alone, by their numbers."""
        unnamed = tuple(number for number in self._found.cause_numbers if number not in named)
        if not unnamed:
            return self.rest
        if len(unnamed) == 1:
            study = self._outs[self._found.cause_numbers.index(unnamed[0])]
        else:
            view = self._without(unnamed)
            (study,) = studies(self._rows, [view], self._grid, self._found.question.seed)
        return replace(self.rest, study=study)

    def _left(self, applied: Sequence[Applied]) -> list[Floats]:
        return [residual_by_place(trace, applied) for trace in self._rows.traces]

    def _without(self, numbers: Sequence[int]) -> View:
        """Return the view with some accepted effects taken out of the model, the others where they are."""
        kept = [number for number in range(len(self._found.applied)) if number not in numbers]
        residuals = [
            each.T[:, :, None] for each in self._left([self._found.applied[number] for number in kept])
        ]
        slices = self._found.fitted.numbers.slices
        columns = [np.arange(slices[number].start, slices[number].stop) for number in kept]
        at = np.concatenate([np.zeros(0, dtype=int), *columns])
        return self._whole.beside(self._rows.of(residuals)[:, 0], self._whole.tangents[:, at])

    def _gap_gain(self, evidences: Sequence[Evidence], component: int | None) -> float:
        """Return the fall of chi2 by all causes and the best family beside them, in one component or all."""
        explained = self._bare.at(component).chi2 - self._whole.at(component).chi2
        return explained + max((net_gain(each) for each in evidences), default=0.0)

    def _tests(self, number: int, out: View, study: Study) -> FamilyTests:
        applied = self._found.applied[number]
        of_cause = [each for each in study.evidences if _is_of(applied, each)]
        # quick and small a family may have more nats than a slow cause, and is still not in its place
        better = next(
            (
                each
                for each in study.evidences
                if not _is_of(applied, each) and self._power_share(each, number) >= _LIMITS.other_power
            ),
            None,
        )
        form = out.chi2 - self._whole.chi2
        form_nats = 0.5 * form - 0.5 * self._cost(out, number)
        margin = np.inf
        if better is not None:
            best = max([form_nats, *(each.nats for each in of_cause)])
            margin = (best - better.nats) / (better.inflation if better.nats > best else 1.0)
        study_of_rest = self.rest.study
        own_rest = max(
            (net_gain(each) for each in study_of_rest.evidences if _is_of(applied, each)), default=0.0
        )
        components = self._components(number)
        near = [each for each in study_of_rest.evidences if _is_in(components, each)]
        other = max((each for each in near if not _is_of(applied, each)), key=net_gain, default=None)
        if other is not None and net_gain(other) <= own_rest:
            other = None  # its own family takes more of the same: it is of another form, not beside another
        gap_gain = 0.0 if other is None else self._gap_gain(near, other.place.component)
        least_form = _LIMITS.form_ratio
        if applied.effect.family == "geometry":
            least_form = 1.0 - _LIMITS.model_error**2
            is_nearly = form >= (1.0 - _LIMITS.small_errors) * (form + own_rest)
            if applied.effect.of_set_up == "frame" and is_nearly:  # seldom the only small error of a set-up
                evidences = self._beside_small_errors.evidences
                own_rest = max((net_gain(each) for each in evidences if _is_of(applied, each)), default=0.0)
        return FamilyTests(
            margin=float(margin),
            form_ratio=form / max(form + own_rest, 1e-30),
            other_share=0.0 if other is None else min(net_gain(other) / max(gap_gain, 1e-30), 1.0),
            other_power=0.0 if other is None else self._power_share(other, number),
            family=of_cause[0] if of_cause else None,
            family_behind=(form_nats - of_cause[0].nats) / of_cause[0].inflation if of_cause else None,
            least_form=least_form,
            better=better,
        )

    @cached_property
    def _beside_small_errors(self) -> Study:
        """What families say beside the accepted effects and small errors of the set-up."""
        applied, traces = self._found.applied, self._rows.traces
        taken = {each.key for each in applied}
        small = [
            setting
            for block in self._found.question.blocks
            if block.effect.of_set_up == "small" and block.key not in taken
            for setting in block.settings(traces[0])
        ]
        columns = []
        for trace in traces:
            model = trace.sample(applied)
            moved = [(trace.sample((*applied, each)) - model).T for each in small]
            columns.append(np.stack(moved, axis=2) if moved else np.zeros((*model.T.shape, 0)))
        tangents = np.concatenate([self._whole.tangents, self._rows.of(columns)], axis=1)
        view = self._whole.beside(self._whole.residual, tangents)
        (study,) = studies(self._rows, [view], self._grid, self._found.question.seed)
        return study

    def _components(self, number: int) -> frozenset[int]:
        """Return the components of the signal that an accepted effect moves."""
        applied, others = self._found.applied, self._found.without(number)
        power = sum(
            np.sum((trace.sample(applied) - trace.sample(others)) ** 2, axis=0) for trace in self._rows.traces
        )
        return frozenset(np.flatnonzero(power > _MOVED * np.max(power)).tolist())

    def _power_share(self, other: Evidence, number: int) -> float:
        """Return a family's share of the power that it and an accepted effect have in the signal."""
        applied, others = self._found.applied, self._found.without(number)
        component = other.place.component
        columns = slice(None) if component is None else [component]
        of_cause = sum(
            float(np.sum((trace.sample(applied) - trace.sample(others))[:, columns] ** 2))
            for trace in self._rows.traces
        )
        power = sum(float(np.sum(signal**2)) for signal in other.signal)
        return power / max(power + of_cause, 1e-300)

    def _cost(self, out: View, number: int) -> float:
        """Return what the numbers of an effect cost as chi2, as in `Fitted.occam`."""
        tangents = self._whole.tangents[:, self._found.fitted.numbers.slices[number]]
        information = tangents.T @ out.without_fixed(tangents)
        return float(np.linalg.slogdet(np.eye(len(information)) + _PRIOR**2 * information)[1])


def _upstream_gain(likelihood: Likelihood) -> float:
    """Return the power beyond noise of what the measured joints move the model by."""
    moved = []
    for trace in likelihood.traces:
        inputs = replace(trace.inputs, q_act_rad=None, q_load_rad=None)
        moved.append(trace.nominal - replace(trace, inputs=inputs).nominal)
    return float(np.sum(likelihood.whiten(moved) ** 2))


def _is_in(components: frozenset[int], evidence: Evidence) -> bool:
    return evidence.place.component is None or evidence.place.component in components


def _is_of(applied: Applied, evidence: Evidence) -> bool:
    """Tell whether a family is that of an effect at its target."""
    effect, place = applied.effect, evidence.place
    if evidence.on not in effect.depends_on or place.where not in effect.where:
        return False
    at_a_joint = place.where is Where.JOINT and applied.target in JOINTS
    return not at_a_joint or place.name in (applied.target, TIMING)
