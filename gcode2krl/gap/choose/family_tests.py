"""What families say of a named cause and of the rest: the tests that stand between a form and a name.

A cause is named only if (a) its family is the best when the cause is taken out of the model, or one to the
data with the best; (b) its form takes nearly all that its family takes; (c) beside it no other family takes a
share of the gap worth naming. All of it is on every run, those that explained included.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import JOINTS
from gcode2krl.gap.beside.timing import residual_by_place
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.families.evidence import Evidence
from gcode2krl.gap.families.grid import TIMING, Grid
from gcode2krl.gap.families.rows import Rows
from gcode2krl.gap.families.study import Study, studies
from gcode2krl.gap.families.view import View
from gcode2krl.gap.fit.design import nuisance_for
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.families
_PRIOR = THRESHOLDS.fit.prior_sizes
_MOVED = 1e-3
"""Of the power in the component that a cause moves most: one with less is not moved."""


@dataclass(frozen=True, eq=False)
class FamilyTests:
    """What families say of one cause; the numbers are features of its probability."""

    margin: float
    """Evidence of its own family over that of the best other one with the cause taken out, in nats, over the
    inflation; the refitted form counts as a member of its family."""
    form_ratio: float
    """Of what its own family takes, the share that its form takes."""
    other_share: float
    """Of the gap's power, what the best other family takes beside the refitted effect.

    0 where none does, or where its own family takes more of the same: then its form is another."""
    other_power: float
    """That family's share of the power of both in the signal.

    Slow noise hides the power of slow effects from chi2, so that a rest of a hundredth of the gap may take
    most of what can be told of it."""
    other_p: float
    """Of an evidence as large as that, if nothing admissible explains the rest."""
    family: Evidence | None
    """The best member of its own family."""
    better: Evidence | None
    """The best other family with the cause taken out."""
    components: frozenset[int]
    """Of the signal, which the cause moves."""
    family_behind: float | None = None
    """By how much the best function of what it depends on is worse than its form, in nats over the inflation;
    None where its family says nothing."""

    def is_near(self, evidence: Evidence) -> bool:
        """Tell whether a family is where the cause acts; one in another joint does not speak against it."""
        return _is_in(self.components, evidence)

    @property
    def is_best(self) -> bool:
        """Tell whether no other family is better beyond what the data can tell."""
        return self.margin > -_LIMITS.alike_nats

    @property
    def form_fits(self) -> bool:
        """Tell whether its form takes nearly all that its family takes."""
        return self.form_ratio >= _LIMITS.form_ratio

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

        And less those of one stretch of time: a function shows in others too, and only a step need not.
        """
        own_time = (
            max(each.nats, 0.0)
            for each in self.study.evidences
            if each.on is Dependence.RUN_TIME and each.place.component == evidence.place.component
        )
        one_share = 0.0 if evidence.on is Dependence.RUN_TIME_STEP else evidence.in_one
        others_nats = evidence.nats - 0.5 * evidence.gain * one_share
        return (others_nats - max(own_time, default=0.0)) / evidence.inflation

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

    def __init__(self, found: Examination, traces: Sequence[Trace]) -> None:
        """Take the traces that explain and those that are held out."""
        nuisance = nuisance_for(traces, found.question, found.data.known)
        likelihood = Likelihood(traces, nuisance, found.noise)
        self._found, self._rows = found, Rows(likelihood)
        tangents = likelihood.tangents(found.fitted.numbers, found.fitted.x)
        self._whole = View.of(self._rows, self._left(found.applied), tangents)
        self._grid = Grid(traces, [noise.sigma for noise in found.noise])
        numbers = found.cause_numbers
        outs = [self._without((number,)) for number in numbers]
        everything, *self._outs = studies(self._rows, [self._whole, *outs], self._grid, found.question.seed)
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
        left = [each.T[:, :, None] for each in self._left([self._found.applied[number] for number in kept])]
        slices = self._found.fitted.numbers.slices
        columns = [np.arange(slices[number].start, slices[number].stop) for number in kept]
        at = np.concatenate([np.zeros(0, dtype=int), *columns])
        return self._whole.beside(self._rows.of(left)[:, 0], self._whole.tangents[:, at])

    def _gap_gain(self, beside: Sequence[Evidence], component: int | None) -> float:
        """Return the fall of chi2 by all causes and the best family beside them, in one component or all."""
        explained = self._bare.at(component).chi2 - self._whole.at(component).chi2
        return explained + max((net_gain(each) for each in beside), default=0.0)

    def _tests(self, number: int, out: View, study: Study) -> FamilyTests:
        applied = self._found.applied[number]
        own = [each for each in study.evidences if _is_of(applied, each)]
        better = next((each for each in study.evidences if not _is_of(applied, each)), None)
        form = out.chi2 - self._whole.chi2
        form_nats = 0.5 * form - 0.5 * self._cost(out, number)
        margin = np.inf
        if better is not None:
            best = max([form_nats, *(each.nats for each in own)])
            margin = (best - better.nats) / (better.inflation if better.nats > best else 1.0)
        rest = self.rest.study
        own_rest = max((net_gain(each) for each in rest.evidences if _is_of(applied, each)), default=0.0)
        components = self._components(number)
        near = [each for each in rest.evidences if _is_in(components, each)]
        other = max((each for each in near if not _is_of(applied, each)), key=net_gain, default=None)
        if other is not None and net_gain(other) <= own_rest:
            other = None  # its own family takes more of the same: it is of another form, not beside another
        gap_gain = 0.0 if other is None else self._gap_gain(near, other.place.component)
        return FamilyTests(
            margin=float(margin),
            form_ratio=form / max(form + own_rest, 1e-30),
            other_share=0.0 if other is None else min(net_gain(other) / max(gap_gain, 1e-30), 1.0),
            other_power=0.0 if other is None else self._power_share(other, number),
            other_p=1.0 if other is None else rest.p_of(other),
            family=own[0] if own else None,
            family_behind=(form_nats - own[0].nats) / own[0].inflation if own else None,
            better=better,
            components=components,
        )

    def _components(self, number: int) -> frozenset[int]:
        """Return the components of the signal that an accepted effect moves."""
        applied, rest = self._found.applied, self._found.without(number)
        power = sum(
            np.sum((trace.sample(applied) - trace.sample(rest)) ** 2, axis=0) for trace in self._rows.traces
        )
        return frozenset(np.flatnonzero(power > _MOVED * np.max(power)).tolist())

    def _power_share(self, other: Evidence, number: int) -> float:
        """Return a family's share of the power that it and an accepted effect have in the signal."""
        applied, rest = self._found.applied, self._found.without(number)
        component = other.place.component
        columns = slice(None) if component is None else [component]
        own = sum(
            float(np.sum((trace.sample(applied) - trace.sample(rest))[:, columns] ** 2))
            for trace in self._rows.traces
        )
        power = sum(float(np.sum(signal**2)) for signal in other.signal)
        return power / max(power + own, 1e-300)

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
    states = evidence.on in effect.depends_on
    # what depends on the place is constant where the tool hardly moves or turns
    if evidence.on is Dependence.CONSTANT and Dependence.PLACE in effect.depends_on:
        states = True
    if not states or place.where not in effect.where:
        return False
    at_a_joint = place.where is Where.JOINT and applied.target in JOINTS
    return not at_a_joint or place.name in (applied.target, TIMING)
