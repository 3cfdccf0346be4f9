"""The gap as a person meets it: millimetres at the part, seconds, or newtons where only forces are known."""

from collections.abc import Mapping, Sequence

import numpy as np

from gcode2krl.gap.beside.links import FORCE, TIMING, Link
from gcode2krl.gap.beside.timing import timing_sizes
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.judged import Judged, Judgement
from gcode2krl.gap.slips.slip import Slip
from gcode2krl.gap.tell.abscissa import knows_place
from gcode2krl.gap.tell.evidence import tip_of
from gcode2krl.gap.tell.residuals import Residual, rms_length
from gcode2krl.gap.tell.result import AtPart, RunSize

_ORDER = ("tip", "part", "time", "force", "joints")
"""What a person asks for first."""


def at_part(
    gapped: Sequence[Judged], residuals: Mapping[Link, Sequence[Residual]], late: Judged | None
) -> AtPart | None:
    """Return the largest gap at the tip or the part; seconds, newtons or degrees where there is none.

    Parameters
    ----------
    gapped : the judgements of the links with a gap.
    residuals : those of each such link with a signal in time.
    late : the judgement among them that is a gap of timing.
    """
    sizes = []
    for judged in gapped:
        if isinstance(judged, Judgement) and _by_clocks_alone(judged):
            sizes.append(_by_clocks(judged))
        elif judged is late and isinstance(judged, Judgement):
            sizes.append(_in_time(judged))
        else:
            sizes.append(_in_space(judged, residuals.get(judged.link, ())))
    return max(sizes, key=lambda size: (-_ORDER.index(size.what), size.rms_before), default=None)


def run_sizes(judged: Judgement, residuals: Sequence[Residual]) -> tuple[RunSize, ...]:
    """Return the size of the gap of every run of a link, in the report's unit."""
    factor = judged.factor
    return tuple(
        _run_size(judged, each.trace, factor * rms_length([each.before]), factor * rms_length([each.after]))
        for each in residuals
    )


def _run_size(judged: Judgement, trace: Trace, before: float, after: float | None) -> RunSize:
    explains = any(each.run == trace.run for each in judged.traces)
    return RunSize(run=trace.run, rms_before=before, rms_after=after, held_out=not explains)


def at_part_of(slip: Slip) -> AtPart | None:
    """Return the gap that a slip makes; None for one in joints, which says little of the part."""
    what = {"mm": "tip", "N": "force"}.get(slip.unit)
    if what is None:
        return None
    return AtPart(
        what=what,
        unit=slip.unit,
        rms_before=slip.rms_before,
        rms_after=slip.rms_after,
        noise=None,
        link=slip.link.name,
    )


def _by_clocks_alone(judged: Judgement) -> bool:
    """Tell whether the named causes of a link are clocks: then nothing is off in space."""
    return bool(judged.applied) and all(each.effect.is_clock for each in judged.applied)


def _by_clocks(judged: Judgement) -> AtPart:
    """Return by how much the clocks are off that a link's causes are."""
    offsets = [abs(each[each.effect.sizes[0].name]) for each in judged.applied]
    return AtPart(
        what="time",
        unit="s",
        rms_before=max(offsets, default=0.0),
        rms_after=None,
        noise=None,
        link=judged.link.name,
    )


def _in_time(judged: Judgement) -> AtPart:
    traces, causes = judged.every or judged.traces, (*judged.usual, *judged.applied)
    before, after = timing_sizes(traces, causes)
    return AtPart(
        what="time",
        unit="s",
        rms_before=before,
        rms_after=after,
        noise=None,
        link=TIMING.name,
        per_run=tuple(_run_size(judged, trace, *timing_sizes([trace], causes)) for trace in traces),
    )


def _in_space(judged: Judged, residuals: Sequence[Residual]) -> AtPart:
    if (
        isinstance(judged, Judgement)
        and judged.link.of_joints
        and all(knows_place(each.trace.inputs) for each in residuals)
    ):
        return _converted(judged, residuals)
    size, factor = judged.told, judged.factor
    before = rms_length([each.before for each in residuals]) if residuals else size.before**0.5
    if judged.link.of_joints:
        what = "joints"
    elif judged.link is FORCE:
        what = "force"
    else:
        what = "tip" if isinstance(judged, Judgement) else "part"
    return AtPart(
        what=what,
        unit=judged.link.unit,
        rms_before=factor * before,
        rms_after=factor * size.after**0.5,
        noise=factor * size.floor**0.5,
        link=judged.link.name,
        held_out_before=factor * size.before**0.5 if judged.held_out else None,
        per_run=run_sizes(judged, residuals) if isinstance(judged, Judgement) else (),
    )


def _converted(judged: Judgement, residuals: Sequence[Residual]) -> AtPart:
    """Return a gap in joints as what it is at the tip, along the program: the Jacobian times its shape.

    What is left of it is by the share that is gone on held-out data.
    """
    at_tip = [tip_of(each.trace, each.shape) for each in residuals]
    before_mm, shrink = rms_length(at_tip), judged.shrink
    return AtPart(
        what="tip",
        unit="mm",
        rms_before=before_mm,
        rms_after=None if shrink is None else before_mm * float(np.sqrt(1.0 - shrink)),
        noise=None,
        link=judged.link.name,
        per_run=tuple(
            _run_size(judged, each.trace, rms_length([moved]), None)
            for each, moved in zip(residuals, at_tip, strict=True)
        ),
    )
