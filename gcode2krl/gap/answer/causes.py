"""What an answer says beside sizes and places: causes, dependences, instruments and the next run."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.canned.draft import REFERENCE_DWELL_S
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Issue
from gcode2krl.gap.answer.evidence import inputs_of
from gcode2krl.gap.answer.result import (
    OF_POSES,
    AtPart,
    CauseResult,
    Course,
    DependsOnResult,
    EffectAt,
    Expectation,
    Gap,
    GapSize,
    LinkResult,
    MomentResult,
    NextRun,
    NoiseResult,
    RivalResult,
    RunSize,
    Separates,
    Unexplained,
    UnknownAt,
)
from gcode2krl.gap.answer.words import FORCE_AXES, listed, number
from gcode2krl.gap.compare.events import jump_within, line_at
from gcode2krl.gap.compare.inputs import Admissible
from gcode2krl.gap.compare.interpolation import rms, step_of
from gcode2krl.gap.compare.links import MECHANICS, TIMING
from gcode2krl.gap.compare.pair import Pair, in_base
from gcode2krl.gap.compare.slips import Slip
from gcode2krl.gap.compare.trace import Context, Span, Trace, Whose
from gcode2krl.gap.noise.source import are_repeats, is_revisited
from gcode2krl.gap.posterior.calibrated import FamilyProbability, family_probabilities
from gcode2krl.gap.posterior.cause_tests import Interval
from gcode2krl.gap.posterior.families import Evidence
from gcode2krl.gap.posterior.geometry import ArmGeometry
from gcode2krl.gap.posterior.judgement import Cause, Judged, Judgement
from gcode2krl.gap.posterior.next_run import (
    ALWAYS,
    BACK,
    CUT,
    MOTION,
    ONCE,
    Answer,
    Apart,
    Bare,
    Choice,
    OpenPair,
    Parting,
    choose_next_run,
)
from gcode2krl.gap.thresholds import THRESHOLDS, declared_nats
from gcode2krl.units import S_PER_H, S_PER_MIN


def cause_of(cause: Cause, judgement: Judged, link: str, pairs: Sequence[Pair] = ()) -> CauseResult:
    """Return a cause of a judged link; ``link`` is the name of that which it is reported in.

    ``pairs`` are the runs, in which a moment is told.
    """
    compared = cause.rivals or ()
    alike = [rival for rival, _ in compared if rival.alike]
    others = [each for each in compared if not each[0].alike]
    return CauseResult(
        effect=cause.applied.effect.name,
        target=cause.applied.target,
        link=link,
        probability=cause.probability,
        parameters=cause.parameters,
        shrink=cause.shrink,
        rms_after=None if cause.rms_after is None else judgement.factor * cause.rms_after,
        constant=cause.constant,
        indistinguishable_from=(
            *[
                EffectAt(*each.key, rival.behind_nats, together=bool(rival.companions) or None)
                for rival in sorted(alike, key=lambda each: not each.companions)
                for each in rival.together
            ][: THRESHOLDS.answer.most_alike],
            *_unknown(cause),
        ),
        rivals=None
        if cause.rivals is None
        else tuple(
            RivalResult(
                rival.applied.effect.name, rival.applied.target, probability, behind_nats=rival.behind_nats
            )
            for rival, probability in others
        ),
        family=_family(cause),
        form_fits=None if cause.tests is None else cause.tests.form_ratio,
        family_probability=cause.family_probability,
        tests=None if cause.features is None else cause.features.as_dict(),
        moment=_moment(cause, judgement, pairs),
    )


def _moment(cause: Cause, judgement: Judged, pairs: Sequence[Pair]) -> MomentResult | None:
    """Return the moment at which a cause begins or, of what acts for moments, at which it does most."""
    moment = cause.applied.effect.moment
    if moment is None:
        if not isinstance(judgement, Judgement) or cause.applied.effect.plans_anew:
            return None
        traces = judgement.traces
        return moment_of(traces, [trace.sample((cause.applied,)) - trace.nominal for trace in traces])
    at_s = cause.applied[moment.name]
    for pair in pairs:
        times_s = pair.inputs.run_hours * S_PER_H
        if times_s[0] <= at_s <= times_s[-1]:
            t_s = float(np.interp(at_s, times_s, pair.inputs.time_s))
            return MomentResult(run=pair.name, t_s=t_s, line=line_at(pair.inputs, t_s))
    return None


def moment_of(
    traces: Sequence[Trace], signals: Sequence[Floats], *, is_smooth: bool = False
) -> MomentResult | None:
    """Return where a deviation (n, k) of each trace is largest; None where it is not one of moments.

    Half of its power then lies in a small share of the time. Of a smooth function it is where the residual
    has an event near there, or jumps, if it does.
    """
    powers = [np.sum(signal**2, axis=1) for signal in signals]
    ranked = np.cumsum(np.sort(np.concatenate(powers))[::-1])
    if traces[0].still or np.searchsorted(ranked, 0.5 * ranked[-1]) > _LIMITS.moments_share * len(ranked):
        return None
    number = int(np.argmax([power.max() for power in powers]))
    trace, power = traces[number], powers[number]
    row = int(np.argmax(power))
    near = np.abs(trace.time_s - trace.time_s[row]) <= _LIMITS.swing_s
    at_s = float(power[near] @ trace.time_s[near] / power[near].sum())
    if is_smooth:
        low = np.flatnonzero(power < power[row] / 4.0)
        first, last = (low[low < row].max(initial=0), low[low > row].min(initial=len(power) - 1))
        first_s, last_s = (float(each) for each in trace.time_s[[first, last]])
        wide_s = (last_s - first_s) / 2.0
        span_s = first_s - wide_s, last_s + wide_s
        at_s = _event_within(trace, span_s) or jump_within(trace, span_s) or at_s
    return MomentResult(run=trace.run, t_s=at_s, line=line_at(trace.inputs, at_s))


def _event_within(trace: Trace, span_s: Span) -> float | None:
    """Return the moment of a trace's largest event in a span, whose rows are gone; bursts are none."""
    machines = (each for each in trace.events if each.whose is not Whose.INSTRUMENT)
    within = [each for each in machines if span_s[0] <= each.span_s[1] and each.span_s[0] <= span_s[1]]
    return max(within, key=lambda each: each.power).at_s if within else None


def _unknown(cause: Cause) -> Iterator[UnknownAt]:
    """Yield an unknown of a cause's kind, where the data do not tell it from the cause's form."""
    tests = cause.tests
    if tests is None or tests.family is None or tests.family_behind is None:
        return
    if tests.family_behind < declared_nats():
        yield UnknownAt(tests.family.place.name, tests.family.on.value)


def _family(cause: Cause) -> str | None:
    """Return where and on what a cause depends: the best member of its family, ``A2, reversals``."""
    if cause.tests is None or cause.tests.family is None:
        return None
    return f"{cause.tests.family.place.name}, {cause.tests.family.on.value}"


def slip_cause(slip: Slip) -> CauseResult:
    """Return a set-up slip as a cause; one that ends the comparison has no parameters."""
    return CauseResult(
        effect=slip.applied.effect.name,
        target=slip.applied.target,
        link=slip.link.name,
        probability=THRESHOLDS.answer.slip_probability,
        parameters={} if slip.final else _slip_intervals(slip),
        shrink=None,
        rms_after=slip.rms_after,
        words=slip.words,
        indistinguishable_from=tuple(EffectAt(name, target) for name, target in slip.alike),
    )


def _slip_intervals(slip: Slip) -> dict[str, Interval]:
    """Return the values of a slip; what it leaves of the gap says how well they are met."""
    share = (slip.rms_after or 0.0) / slip.rms_before if slip.rms_before > 0.0 else 0.0
    intervals = {}
    for name, value in slip.applied.values.items():
        width = share * abs(value) + (Mismatch.clock_s if name.endswith("_s") else 0.0)
        intervals[name] = Interval(value, value - width, value + width)
    return intervals


_LIMITS = THRESHOLDS.answer
_IN_EACH_RUN = frozenset({Dependence.RUN_TIME})
"""Each run has a course of its own."""


def course_of(
    traces: Sequence[Trace], values: Sequence[Floats], on: Dependence, joint: int | None, unit: str
) -> Course | None:
    """Return how a deviation (n,) of each trace goes over an input; None of what is no function of one.

    An input with several components is told by that which shows most of the deviation.
    """
    inputs = [inputs_of(Admissible(trace), on, joint) for trace in traces]
    run = None
    if on in _IN_EACH_RUN:
        number = int(np.argmax([np.ptp(each) for each in values]))
        inputs, values, run = [inputs[number]], [values[number]], traces[number].run
    deviation = np.concatenate(values)
    best: tuple[float, Course] | None = None
    for components in zip(*inputs, strict=True):
        name, over_unit, _ = components[0]
        x = np.concatenate([each[2] for each in components])
        bins = _bins(x)
        means = np.array([deviation[rows].mean() for rows in bins])
        shown = float(
            sum(len(rows) * (y - deviation.mean()) ** 2 for rows, y in zip(bins, means, strict=True))
        )
        if len(bins) > 1 and (best is None or shown > best[0]):
            points = tuple((float(x[rows].mean()), float(y)) for rows, y in zip(bins, means, strict=True))
            best = shown, Course(over=name, over_unit=over_unit, unit=unit, points=points, run=run)
    return None if best is None else best[1]


def _bins(x: Floats) -> list[Ints]:
    """Return the rows in each of a few equal stretches of an input's range, empty ones left out."""
    low, high = float(x.min()), float(x.max())
    if not high > low:
        return [np.arange(len(x), dtype=np.int64)]
    number = np.minimum(
        (_LIMITS.course_points * (x - low) / (high - low)).astype(int), _LIMITS.course_points - 1
    )
    return [np.flatnonzero(number == each).astype(np.int64) for each in np.unique(number)]


_FORMS = {
    Dependence.RUN_TIME_STEP: "step",
    Dependence.RUN_TIME: "drift",
    Dependence.RUN_START: "drift",
    Dependence.RUN_TO_RUN: "drift",
    Dependence.WALL_CLOCK: "drift",
    Dependence.TEMPERATURE: "drift",
    Dependence.MOTOR_ANGLE: "periodic",
    Dependence.TONE: "periodic",
    Dependence.REVERSALS: "loop",
}
"""What a function of these looks like; of all others it is smooth."""
_TIP = "tip"


def depends_on(judgement: Judgement, larger_links: int = 0) -> Iterator[tuple[DependsOnResult, Evidence]]:
    """Yield on what the gap of a link without a name, or beside named causes, may depend; best first.

    With each what the family says. ``larger_links`` have a larger gap without a name.
    """
    study = judgement.rest
    if study is None or judgement.verdict in ("no_gap", "explained"):
        return
    if not (study.worth_naming or study.is_gap):
        return
    for family in family_probabilities(study, larger_links):
        if max(family.probability, family.set_probability) >= _LIMITS.least_probability:
            yield _result(judgement, family), family.evidence


def _result(judgement: Judgement, family: FamilyProbability) -> DependsOnResult:
    evidence, traces = family.evidence, judgement.every
    is_step = evidence.on is Dependence.RUN_TIME_STEP
    is_vector = judgement.traces[0].shape[1] == 3 and not judgement.link.of_joints
    signals = evidence.signal
    if is_vector:
        signals = tuple(
            in_base(signal, trace.frame, trace.inputs, trace.time_s)
            for trace, signal in zip(traces, signals, strict=True)
        )
    largest = _largest(signals)
    along = largest if is_step else _main_axis(signals)
    moment = moment_of(traces, evidence.signal, is_smooth=True)
    if is_step and evidence.at is not None:
        stepped, at_s = traces[evidence.at[0]], evidence.at[1]
        moment = MomentResult(run=stepped.run, t_s=at_s, line=line_at(stepped.inputs, at_s))
    length = float(np.linalg.norm(along))
    is_scalar = signals[0].shape[1] == 1
    course = None
    if (is_scalar or is_vector) and length > 0.0:
        turned = judgement.factor * (np.ones(1) if is_scalar else along / length)
        values = [own @ turned for own in signals]
        course = course_of(traces, values, evidence.on, evidence.place.joint, judgement.link.unit)
    return DependsOnResult(
        link=judgement.link.name,
        at=_at(evidence, evidence.signal),
        on=evidence.told[1].value,
        form=_FORMS.get(evidence.on, "smooth"),
        probability=family.probability,
        place_probability=family.place_probability,
        indistinguishable_from=tuple(
            UnknownAt(at=_at(each, each.signal), on=each.told[1].value) for each in family.alike
        ),
        set_probability=family.set_probability or None,
        share=family.features.share,
        tests=family.features.as_dict(),
        at_time_s=None if moment is None else moment.t_s,
        run=None if moment is None else moment.run,
        in_later_runs=evidence.stays if is_step else None,
        line=None if moment is None else moment.line,
        size=judgement.factor * float(np.linalg.norm(largest)),
        unit=judgement.link.unit,
        direction=tuple((along / length).tolist()) if is_vector and length > 0.0 else None,
        frequency_hz=evidence.at[1] if evidence.on is Dependence.TONE and evidence.at else None,
        course=course,
    )


def _at(evidence: Evidence, signals: tuple[Floats, ...]) -> str:
    """Return the place as the answer names it: of a force the axis that has most of it."""
    if evidence.place.where is Where.FORCE_AXIS:
        return FORCE_AXES[int(np.argmax(np.sum(np.concatenate(signals) ** 2, axis=0)))]
    if evidence.place.where is Where.JOINT and evidence.place.joint is None:
        return _TIP  # it is late along the path
    return evidence.place.name


def _largest(signals: tuple[Floats, ...]) -> Floats:
    """Return the row (k,) of signals (n, k) with the largest length."""
    rows = np.concatenate(signals)
    row: Floats = rows[int(np.argmax(np.sum(rows**2, axis=1)))]
    return row


def _main_axis(signals: tuple[Floats, ...]) -> Floats:
    """Return the unit vector (k,) along which signals have most of their power, as the largest points."""
    rows = np.concatenate(signals)
    axis: Floats = np.linalg.eigh(rows.T @ rows)[1][:, -1]
    return axis * (np.sign(axis @ _largest(signals)) or 1.0)


@dataclass(frozen=True)
class Late:
    """By how much a run is early or late beside its prediction, its clock's offset taken off."""

    run: str
    rms_s: float
    largest_s: float
    stamp_s: float
    """Error of the log's own stamps: half a step, and by how much steps differ."""

    @property
    def is_gap(self) -> bool:
        """Tell whether it is more than the log's stamps may be off by."""
        return self.largest_s > 2.0 * self.stamp_s


def late_by(planned: Pair, on_time: Pair) -> Late:
    """Return the lateness of a run of which two pairs are given: on the planned times, and on its own."""
    moved_s = on_time.inputs.time_s - planned.inputs.time_s
    table = planned.run.controller
    steps = np.diff(table.time_s) if table is not None else np.zeros(1)
    middle = float(np.median(steps))
    stamp_s = 0.5 * middle + float(np.quantile(np.abs(steps - middle), 0.95))
    return Late(planned.name, float(np.std(moved_s)), float(np.ptp(moved_s)), stamp_s)


def with_lateness(gap: Gap, late: Sequence[Late]) -> Gap:
    """Return an answer of no gap as one of timing, where runs are late by more than their stamps' error."""
    if gap.verdict != "no_gap" or not any(each.is_gap for each in late):
        return gap
    rms_s = float(np.sqrt(np.mean([each.rms_s**2 for each in late])))
    stamp_s = max(each.stamp_s for each in late)
    runs = tuple(
        RunSize(run=run.run, rms_before=run.rms_s, rms_after=run.rms_s, held_out=False) for run in late
    )
    link = LinkResult(
        link=TIMING.name,
        rms_before=rms_s,
        rms_after=rms_s,
        floor=stamp_s,
        unit=TIMING.unit,
        verdict="unexplained",
    )
    return replace(
        gap,
        verdict="unexplained",
        gap=GapSize(
            signal=TIMING.signal,
            unit=TIMING.unit,
            rms_before=rms_s,
            rms_after=rms_s,
            noise_floor=stamp_s,
            max_before=max(each.largest_s for each in late),
            per_run=runs,
        ),
        links=(link, *(each for each in gap.links if each.link != TIMING.name)),
        at_part=AtPart(
            what="time",
            unit=TIMING.unit,
            rms_before=rms_s,
            rms_after=None,
            noise=stamp_s,
            link=TIMING.name,
            per_run=runs,
        ),
        unexplained=Unexplained(rms=rms_s, significant=True, structure="structured"),
        not_examined=tuple(each for each in gap.not_examined if each.link != TIMING.name),
        notes=(*gap.notes, "place by place, on the run's own timing, there is no gap"),
    )


GEOMETRY = "geometry"


def with_geometry(gap: Gap, without_arm: Gap, arm: ArmGeometry) -> Gap:
    """Return an answer with geometry as its first cause; ``without_arm`` answers to the runs without it."""
    noise = next((link.floor for link in without_arm.links if link.link == MECHANICS.name), None)
    shrink = _shrink(arm, noise or 0.0)
    parts = {
        f"{part.name.replace(' ', '_')}_{part.unit}": Interval(
            part.estimate.value, part.estimate.low, part.estimate.high
        )
        for part in arm.fit.told_numbers
    }
    cause = CauseResult(
        effect=GEOMETRY,
        target=None,
        link=MECHANICS.name,
        probability=THRESHOLDS.answer.geometry_probability,
        parameters=parts,
        shrink=shrink,
        rms_after=arm.after_mm,
    )
    verdict = "explained" if without_arm.verdict == "no_gap" else "partly_explained"
    before, after = arm.before_mm, arm.after_mm
    size = replace(gap.gap, rms_before=before, rms_after=after, shrink=shrink, held_out=True)
    at_part = AtPart(
        what="tip", unit="mm", rms_before=before, rms_after=after, noise=None, link=MECHANICS.name
    )
    return replace(
        gap,
        verdict=verdict,
        gap=replace(size, max_after=without_arm.gap.max_after),
        at_part=at_part,
        links=tuple(
            replace(link, rms_before=before, rms_after=after, verdict=verdict)
            if link.link == MECHANICS.name
            else link
            for link in without_arm.links
        ),
        causes=(cause, *without_arm.causes),
        unexplained=without_arm.unexplained,
        next_run=without_arm.next_run,
        named=without_arm.named,
        issues=without_arm.issues,
        notes=(*without_arm.notes, *_notes(arm)),
        observable=without_arm.observable,
    )


def _shrink(arm: ArmGeometry, noise_mm: float) -> float:
    """Return the share of the gap beyond noise that is gone at places left out."""
    gap = arm.before_mm**2 - noise_mm**2
    gone = 1.0 - max(arm.after_mm**2 - noise_mm**2, 0.0) / gap if gap > 0.0 else 1.0
    return min(max(gone, 0.0), 1.0)


def _notes(arm: ArmGeometry) -> list[str]:
    fit = arm.fit
    notes = [
        f"geometry: {len(fit.told_numbers)} small numbers of the arm, {arm.before_mm:.3f} -> "
        f"{arm.after_mm:.3f} mm at places left out of the fit; `gcode2krl identify kinematics` has each "
        "with its interval"
    ]
    if fit.is_outlier.any():
        notes.append(f"geometry: {int(fit.is_outlier.sum())} poses are far off and no part of the fit")
    return notes


_REPEATS, _RUNS = "repeats", "each run by itself"


def noise_of(judgement: Judgement) -> NoiseResult | None:
    """Return the noise of a link, in the unit of the report; None where no instrument measures it."""
    if not judgement.link.has_instrument:
        return None
    models, traces = judgement.examination.noise, judgement.traces
    stated = [trace.declared_sigma for trace in traces if trace.declared_sigma is not None]
    return NoiseResult(
        stated=judgement.factor * max(stated) if stated else None,
        learnt=judgement.factor * rms(np.array([each.sigma for each in models])),
        short=judgement.factor * rms(np.array([each.short_sigma for each in models])),
        source=_source(traces),
    )


def _source(traces: Sequence[Trace]) -> str:
    if traces[0].still:
        return _REPEATS if is_revisited(traces) else OF_POSES
    return _REPEATS if are_repeats(traces) else _RUNS


def readings_of_noise(judgements: Sequence[Judgement]) -> Iterator[str]:
    """Yield for each link whose noise is neither stated nor repeated what it may be."""
    for judgement in judgements:
        noise = noise_of(judgement)
        if noise is None or noise.stated is not None or noise.source == _REPEATS:
            continue
        unit = judgement.link.unit
        said = f"{judgement.link.name}: the noise is neither stated nor repeated; "
        said += f"taken as {number(noise.learnt)} {unit}"
        if judgement.traces[0].still and judgement.verdict == "no_gap":
            off = judgement.factor * (judgement.size.before / judgement.traces[0].shape[1]) ** 0.5
            said += f"; were it less, the {number(off)} {unit} that the poses are off by would be a gap"
        if noise.learnt > _LIMITS.same_reading * noise.short:
            said += (
                f", of which {number(noise.short)} {unit} are forgotten within milliseconds: "
                "what wanders within seconds may be a gap"
            )
        yield said


def issues_of(judgements: Sequence[Judgement]) -> Iterator[Issue]:
    """Yield the findings of instruments: more noise than stated, coarse steps, bursts that were left out."""
    for judgement in judgements:
        noise = noise_of(judgement)
        if noise is not None:
            yield from _above_stated(judgement, noise)
            yield from _in_steps(judgement, noise)
            yield from _bursts(judgement)


def _above_stated(judgement: Judgement, noise: NoiseResult) -> Iterator[Issue]:
    most = THRESHOLDS.noise.noise_most_stated
    if noise.stated is None or noise.short < 0.999 * most * noise.stated:
        return
    known, taken = (f"{number(each)} {judgement.link.unit}" for each in (noise.stated, noise.short))
    message = f"noisier than the {known} that run.toml states; no more than {taken} is taken as noise"
    yield Issue("warning", "noise-above-stated", 0, f"{judgement.link.name}: {message}")


def _in_steps(judgement: Judgement, noise: NoiseResult) -> Iterator[Issue]:
    """Yield the finding that readings move in steps that are coarse beside their noise."""
    known = noise.short if noise.stated is None else noise.stated
    traces = judgement.every or judgement.traces
    coarse = {}
    for j, name in enumerate(traces[0].components):
        step = judgement.factor * max(step_of(trace.measured[:, j]) for trace in traces)
        if step > _LIMITS.coarse_steps * known:
            coarse[name] = step
    if not coarse:
        return
    steps, least = (f"{number(each)} {judgement.link.unit}" for each in (max(coarse.values()), known))
    message = f"readings in a ladder of {steps}, the noise is {least}"
    yield Issue(
        "warning", "readings-in-steps", 0, f"{judgement.link.name}, {listed(list(coarse))}: {message}"
    )


def _bursts(judgement: Judgement) -> Iterator[Issue]:
    """Yield a finding for each run with rows that were left out as bursts of the instrument."""
    for trace in judgement.every or judgement.traces:
        bursts = [each for each in trace.events if each.whose is Whose.INSTRUMENT]
        if not bursts:
            continue
        largest = judgement.factor * max(float(np.linalg.norm(each.peak)) for each in bursts)
        lasts_s = sum(each.span_s[1] - each.span_s[0] for each in bursts)
        shown = [f"{each.at_s:.2f} s (line {each.line})" for each in bursts[: _LIMITS.most_bursts]]
        more = f" and {len(bursts) - len(shown)} more" if len(bursts) > len(shown) else ""
        size = f"{number(largest)} {judgement.link.unit}"
        message = f"rough for {lasts_s:.2f} s in all, up to {size}, at {', '.join(shown)}{more}"
        said = f"{trace.run}: {judgement.link.name}: {message}: left out, in step with nothing"
        yield Issue("note", "instrument-bursts", 0, said)


_SIGNALS = {
    "tcp": "at the tip",
    "force": "of force",
    "joint_actual": "of servo error",
    "joint_load": "behind the gear",
    "joint_commanded": "off the commanded path",
}


def next_run_of(
    context: Context,
    judgements: Sequence[Judgement],
    depends_on: Sequence[tuple[DependsOnResult, Evidence | None]] = (),
) -> NextRun | None:
    """Return the run that parts best what is left open; None where nothing is."""
    families: dict[str, list[Answer]] = {}
    for dependence, evidence in depends_on:
        label = f"{dependence.at}, {dependence.on}"
        answer = Answer(label, dependence.probability, evidence=evidence)
        families.setdefault(dependence.link, []).append(answer)
    choice = choose_next_run(context, judgements, families)
    return None if choice is None else told(choice)


def told(choice: Choice) -> NextRun:
    """Return a choice in words."""
    if choice.bare is not None:
        return _told_bare(choice, choice.bare)
    return NextRun(
        program=choice.program,
        minutes=round(choice.minutes, 1),
        separates=tuple(
            Separates(
                first=parting.pair.first.label,
                second=parting.pair.second.label,
                odds=float(f"{parting.odds:.3g}"),
            )
            for parting in choice.partings
        ),
        expect=tuple(_expected(choice.partings)),
    )


def _told_bare(choice: Choice, bare: Bare) -> NextRun:
    """Return the first question that is asked of a gap."""
    place = _SIGNALS.get(bare.signal, bare.signal)
    size = f"{bare.rms:.2g} {bare.unit} RMS {place}"
    shows = {
        BACK: f"{size} again, at the same places",
        ONCE: "nothing above the noise",
        CUT: "nothing above the noise: the program is in air",
        MOTION: f"about {size} while it moves, nothing at the reference points",
        ALWAYS: f"about {size}, at the reference points too",
    }
    odds = float(f"{bare.odds:.3g}")
    return NextRun(
        program=choice.program,
        minutes=round(choice.minutes, 1),
        separates=tuple(
            Separates(first=first, second=second, odds=odds) for first, second in pairwise(bare.asks)
        ),
        expect=tuple(Expectation(answer=each, shows=shows[each]) for each in bare.asks),
    )


def _expected(partings: Sequence[Parting]) -> Iterator[Expectation]:
    """Yield what each answer shows, by the pair in which the program parts it best from another."""
    told_of: set[str] = set()
    for parting in sorted(partings, key=lambda parting: -parting.odds):
        pair, apart = parting.pair, parting.apart
        words = _in_words(pair, apart)
        for answer, other, said in ((pair.first, pair.second, words[0]), (pair.second, pair.first, words[1])):
            if answer.label not in told_of:
                told_of.add(answer.label)
                same = f"the same as if {other.label}: no program parts them"
                is_same = parting.odds < _LIMITS.parted_odds or words[0] == words[1]
                yield Expectation(answer=answer.label, shows=same if is_same else said)


def _in_words(pair: OpenPair, apart: Apart) -> tuple[str, str]:
    """Return what both answers show; of what nobody can simulate, that it is something else."""
    first = shown(apart, apart.first, apart.is_open[0])
    if pair.second.applied is None and pair.second.evidence is None:
        return first, f"anything but {first}"
    return first, shown(apart, apart.second, apart.is_open[1])


def shown(apart: Apart, value: float, is_open: bool = False) -> str:
    """Return what a value at the moment at which two answers are farthest apart looks like.

    ``is_open``: the runs do not say which way it goes.
    """
    at_s, values_at_a_point = apart.time_s, REFERENCE_DWELL_S / THRESHOLDS.posterior.trial_step_s
    after = f"{at_s:.0f} s" if at_s < _LIMITS.minutes_from_s else f"{at_s / S_PER_MIN:.0f} min"
    if abs(value) < _LIMITS.seen_sigma * apart.noise / values_at_a_point**0.5:
        return f"nothing above the noise after {after}"
    place = _SIGNALS.get(apart.signal, apart.signal)
    since = " since the start" if apart.is_change else ""
    size = f"up to {value:.2g} {apart.unit} either way" if is_open else f"{value:+.2g} {apart.unit}"
    return f"{size} in {apart.component} {place} after {after}{since}"
