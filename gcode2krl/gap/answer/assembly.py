"""The answer: judgements of the links, slips and clocks, put together."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.effects import Dependence
from gcode2krl.errors import Issue
from gcode2krl.gap.answer.causes import (
    cause_of,
    depends_on,
    issues_of,
    next_run_of,
    noise_of,
    readings_of_noise,
    slip_cause,
)
from gcode2krl.gap.answer.evidence import Depends, Residual, evidence_of, residuals_of
from gcode2krl.gap.answer.result import (
    AtPart,
    CauseResult,
    DependsOnResult,
    Detectable,
    Gap,
    GapSize,
    LinkResult,
    NotExamined,
    SignalResult,
    Unexplained,
    Where,
)
from gcode2krl.gap.answer.where import at_part, at_part_of, place, run_sizes
from gcode2krl.gap.answer.words import IMPULSE, events_of, impulses_of
from gcode2krl.gap.compare.clocks import timing_share, timing_sizes
from gcode2krl.gap.compare.links import GEAR, JOINTS, LINKS, MECHANICS, PATH, TIMING
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.slips import Slip
from gcode2krl.gap.compare.trace import Context, Link
from gcode2krl.gap.posterior.examination import observable
from gcode2krl.gap.posterior.families import Evidence
from gcode2krl.gap.posterior.judgement import Judged, Judgement
from gcode2krl.gap.thresholds import THRESHOLDS


def answer(context: Context, slips: Sequence[Slip], issues: Sequence[Issue]) -> Gap:
    """Return the diagnosis of all links together."""
    judgements = [judged for judged in context.judgements if isinstance(judged, Judged)]
    signals = [judged for judged in judgements if isinstance(judged, Judgement)]
    largest = max(signals, key=_weight, default=None)
    residuals = {
        judged.link: residuals_of(judged)
        for judged in signals
        if judged is largest or judged.verdict != "no_gap"
    }
    dependences = list(_dependences(signals))
    unexplained = _unexplained(largest, [each for each, _ in dependences])
    of_largest = residuals[largest.link] if largest is not None else []
    return Gap(
        verdict=_verdict(judgements, slips),
        gap=_size(_with_largest_gap(judgements, largest), slips, residuals),
        links=tuple(_links(judgements, slips)),
        at_part=_at_part(judgements, slips, residuals),
        events=tuple(event for judgement in signals for event in events_of(judgement)),
        where=_where(largest, judgements, of_largest),
        causes=_causes(judgements, slips, context.pairs),
        unexplained=unexplained,
        not_examined=tuple(_not_examined(judgements, slips)),
        observable=tuple(
            Detectable(**entry) for judgement in signals for entry in observable(judgement.examination)
        ),
        next_run=next_run_of(context, signals, [each for each in dependences if each[0].form != IMPULSE]),
        named=(
            *(slip.applied for slip in slips if not slip.final),
            *(applied for judgement in _gapped(judgements) for applied in judgement.applied),
        ),
        issues=(
            *issues,
            *(
                replace(issue, message=f"{pair.name}: {issue.message}")
                for pair in context.pairs
                for issue in pair.run.issues
            ),
            *issues_of(signals),
        ),
        runs=tuple(pair.name for pair in context.pairs),
        notes=tuple(_notes(context.pairs, signals)),
        evidence=None
        if largest is None
        else evidence_of(largest, of_largest, _depends(largest, unexplained)),
    )


def _at_part(
    judgements: Sequence[Judged], slips: Sequence[Slip], residuals: Mapping[Link, Sequence[Residual]]
) -> AtPart | None:
    """Return the gap as it is met at the part; None where there is none."""
    gapped = _gapped(judgements)
    late = next((judged for judged in gapped if _is_timing(judged)), None)
    if gapped:
        return at_part(gapped, residuals, late)
    return at_part_of(slips[0]) if slips else None


def _depends(largest: Judgement, unexplained: Unexplained) -> Depends | None:
    """Return on what a link's first named cause depends or, without one, what is left; None if unknown."""
    if largest.applied:
        cause = largest.applied[0]
        return Depends(cause.target if cause.target in JOINTS else None, cause.effect.depends_on)
    for dependence in unexplained.depends_on:
        if dependence.link == largest.link.name:
            at = dependence.at if dependence.at in JOINTS else None
            return Depends(at, frozenset(each for each in Dependence if each.value == dependence.on))
    return None


def _gapped(judgements: Sequence[Judged]) -> list[Judged]:
    """Return the judgements of links with a gap."""
    return [judgement for judgement in judgements if judgement.verdict != "no_gap"]


def _with_largest_gap(judgements: Sequence[Judged], largest: Judgement | None) -> Judged | None:
    """Return the judgement of the largest gap: that of the part where no signal has one."""
    if largest is not None and largest.verdict != "no_gap":
        return largest
    return next(iter(_gapped(judgements)), largest)


def _weight(judgement: Judgement) -> tuple[bool, float]:
    """Order links by whether there is a gap, then by its power over the noise's."""
    return judgement.verdict != "no_gap", judgement.size.power


def _verdict(judgements: Sequence[Judged], slips: Sequence[Slip]) -> str:
    """Return the verdict of all links with a gap together."""
    verdicts = {judgement.verdict for judgement in _gapped(judgements)}
    if not verdicts:
        return "explained" if slips else "no_gap"
    if verdicts == {"explained"}:
        return "explained"
    if verdicts == {"unexplained"} and not slips:
        return "unexplained"
    return "partly_explained"


def _size(
    largest: Judged | None, slips: Sequence[Slip], residuals: Mapping[Link, Sequence[Residual]]
) -> GapSize:
    """Return the size of the largest gap: that of a link or, where none has one, that of the first slip."""
    if largest is None or (slips and largest.verdict == "no_gap"):
        if not slips:
            return GapSize(signal=MECHANICS.signal, unit=MECHANICS.unit)
        slip = slips[0]
        before, after = slip.rms_before, slip.rms_after
        return GapSize(signal=slip.link.signal, unit=slip.link.unit, rms_before=before, rms_after=after)
    size, link, factor = largest.told, largest.link, largest.factor
    return GapSize(
        signal=TIMING.signal if _is_timing(largest) else link.signal,
        unit=link.unit,
        rms_before=factor * size.before**0.5,
        rms_after=factor * size.after**0.5,
        noise_floor=factor * size.floor**0.5,
        max_before=factor * size.largest_before,
        max_after=factor * size.largest_after,
        shrink=largest.shrink,
        held_out=largest.held_out,
        per_run=run_sizes(largest, residuals.get(link, ())) if isinstance(largest, Judgement) else (),
    )


def _is_timing(judgement: Judged) -> bool:
    """Tell whether the gap of a path is one of timing: most of it lies along the motion."""
    if not isinstance(judgement, Judgement) or not judgement.link.tells_time:
        return False
    return judgement.verdict != "no_gap" and timing_share(judgement.traces) > THRESHOLDS.answer.timing_share


def _links(judgements: Sequence[Judged], slips: Sequence[Slip]) -> Iterator[LinkResult]:
    """Yield the examined links in the chain's order."""
    judged = {judgement.link: judgement for judgement in judgements}
    slipped = {slip.link for slip in slips}
    for link in LINKS:
        path = judged.get(PATH)
        if link is TIMING and isinstance(path, Judgement):
            yield _timing(path)
        if link in judged:
            yield _link(judged[link], link in slipped)


def _timing(path: Judgement) -> LinkResult:
    """Return by how much runs are late along their path."""
    before_s, after_s = timing_sizes(path.traces, (*path.usual, *path.applied))
    return LinkResult(
        link=TIMING.name,
        rms_before=before_s,
        rms_after=after_s,
        floor=None,
        unit=TIMING.unit,
        verdict=path.verdict if _is_timing(path) else "no_gap",
    )


def _link(judgement: Judged, slipped: bool) -> LinkResult:
    """Return a judged link; ``slipped``: a slip showed in it."""
    factor, size = judgement.factor, judgement.told
    verdict = "no_gap" if _is_timing(judgement) else judgement.verdict
    return LinkResult(
        link=judgement.link.name,
        rms_before=factor * size.before**0.5,
        rms_after=factor * size.after**0.5,
        floor=factor * size.floor**0.5,
        noise=noise_of(judgement) if isinstance(judgement, Judgement) else None,
        unit=judgement.link.unit,
        verdict="explained" if slipped and verdict == "no_gap" else verdict,
        offset_deg=_zeros_deg(judgement) if isinstance(judgement, Judgement) else None,
    )


def _zeros_deg(judgement: Judgement) -> dict[str, float] | None:
    """Return the mean difference of each joint's two encoders: zeros are set by hand and never a finding."""
    if judgement.link is not GEAR:
        return None
    trace = judgement.traces[0]
    zeros = trace.factor * np.mean([each.measured.mean(axis=0) for each in judgement.traces], axis=0)
    return dict(zip(trace.components, zeros.tolist(), strict=True))


def _where(largest: Judgement | None, judgements: Sequence[Judged], residuals: Sequence[Residual]) -> Where:
    """Return which signals have a gap, and the place of the largest."""
    signals = tuple(
        SignalResult(
            signal=judgement.link.signal,
            rms=judgement.factor * judgement.size.before**0.5,
            noise=judgement.factor * judgement.size.floor**0.5,
            significant=judgement.verdict != "no_gap",
        )
        for judgement in judgements
    )
    if largest is None or largest.verdict == "no_gap":
        return Where(signals=signals)
    traces, shapes = [each.trace for each in residuals], [each.shape for each in residuals]
    return replace(place(traces, shapes, residuals[0].noise, largest.applied), signals=signals)


def _causes(
    judgements: Sequence[Judged], slips: Sequence[Slip], pairs: Sequence[Pair]
) -> tuple[CauseResult, ...]:
    """Return the causes of all links, the most probable first."""
    causes = [slip_cause(slip) for slip in slips]
    for judgement in judgements:
        for cause in judgement.reported:
            in_time = TIMING.name in cause.applied.effect.links and _is_timing(judgement)
            causes.append(cause_of(cause, judgement, (TIMING if in_time else judgement.link).name, pairs))
    return tuple(sorted(causes, key=lambda cause: -cause.probability))


def _dependences(signals: Sequence[Judgement]) -> Iterator[tuple[DependsOnResult, Evidence | None]]:
    """Yield on what depends what is left of all links, the largest gap first; of a family what it says."""
    links: set[str] = set()
    for judgement in sorted(signals, key=_weight, reverse=True):
        impulses = list(impulses_of(judgement))
        families = list(depends_on(judgement, larger_links=len(links)))  # its own impulses are no other gap
        yield from ((impulse, None) for impulse in impulses)
        yield from families
        links |= {dependence.link for dependence in [*impulses, *(family for family, _ in families)]}


def _unexplained(largest: Judgement | None, families: Sequence[DependsOnResult] = ()) -> Unexplained:
    """Return what is left of the largest gap, and on what depends what is left of all of them."""
    if largest is None:
        return Unexplained(rms=None, significant=False, structure="unknown")
    size = largest.told
    is_left = bool(size.significant) and largest.verdict != "explained"
    significant = is_left or any(each.link == largest.link.name for each in families)
    return Unexplained(
        rms=largest.factor * max(size.after, 0.0) ** 0.5,
        significant=significant,
        structure="structured" if significant else "white",
        depends_on=tuple(families),
        probability=largest.unknown,
    )


def _not_examined(judgements: Sequence[Judged], slips: Sequence[Slip]) -> Iterator[NotExamined]:
    """Yield the links without a judgement, and what they need."""
    examined = {judgement.link for judgement in judgements}
    if PATH in examined:
        examined.add(TIMING)
    final = any(slip.final for slip in slips)
    for link in LINKS:
        if link not in examined:
            needs = "a run that belongs to the prediction" if final else link.needs
            yield NotExamined(link=link.name, needs=needs)


def _notes(pairs: Sequence[Pair], judgements: Sequence[Judgement]) -> Iterator[str]:
    """Yield what a reader should know of what was left out."""
    if any(pair.run.head.angles == "relative" for pair in pairs):
        yield "angles are relative: no kinematics, no limits, no gravity"
    for judgement in judgements:
        missing = [joint for joint in JOINTS if joint not in judgement.traces[0].components]
        if judgement.link.of_joints and missing:
            yield f"{judgement.link.name}: {', '.join(missing)} left out: not recorded, or never moving"
    for judgement in judgements:
        if judgement.usual:
            labels = ", ".join(applied.label for applied in judgement.usual)
            yield f"{judgement.link.name}: {labels} within normal mismatch"
    for judgement in judgements:
        for trace in judgement.traces:
            yield from (f"{judgement.link.name}, {trace.run}: {what} left out" for what in trace.left_out)
    yield from readings_of_noise(judgements)
