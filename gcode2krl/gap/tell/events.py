"""Events as the answer states them: run, seconds, G-code line and size."""

from collections.abc import Iterator

import numpy as np

from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.beside.trace import Event, Whose
from gcode2krl.gap.choose.judged import Judgement
from gcode2krl.gap.tell.result import DependsOnResult, EventResult
from gcode2krl.gap.thresholds import THRESHOLDS

IMPULSE = "impulse"
"""The form of what happens in a moment and leaves nothing behind in its signal."""
_WORDS = {Whose.IMPULSE: IMPULSE, Whose.SLIP: "slip", Whose.INSTRUMENT: "burst"}


def events_of(judgement: Judgement) -> Iterator[EventResult]:
    """Yield the events of a link."""
    for event in judgement.events:
        deviation = event.change if event.whose is Whose.SLIP else event.peak
        yield EventResult(
            link=event.link,
            run=event.run,
            t_s=event.at_s,
            line=event.line,
            what=_WORDS[event.whose],
            size=judgement.factor * float(np.linalg.norm(deviation)),
            unit=judgement.link.unit,
            lasts_s=event.span_s[1] - event.span_s[0],
        )


def impulses_of(judgement: Judgement) -> Iterator[DependsOnResult]:
    """Yield the impulses of a link, or the slips that are its gap, the largest first."""
    found = judgement.impulses or (() if judgement.told.significant else judgement.slips)
    impulses = sorted(found, key=lambda event: -event.power)
    power = sum(event.power for event in impulses)
    power += max(judgement.size.excess_before, 0.0) * judgement.size.rows
    for event in impulses[: THRESHOLDS.tell.most_alike]:
        off = event.change if event.whose is Whose.SLIP else event.peak
        length = float(np.linalg.norm(off))
        is_vector = len(event.peak) == 3 and not judgement.link.of_joints
        yield DependsOnResult(
            link=event.link,
            at=_at(event, judgement),
            on=Dependence.RUN_TIME.value,
            form="step" if event.whose is Whose.SLIP else IMPULSE,
            probability=THRESHOLDS.tell.impulse_probability,
            share=event.power / max(power, 1e-300),
            at_time_s=event.at_s,
            run=event.run,
            line=event.line,
            size=judgement.factor * length,
            unit=judgement.link.unit,
            direction=tuple((off / length).tolist()) if is_vector and length > 0.0 else None,
        )


def _at(event: Event, judgement: Judgement) -> str:
    """Return the place: the joint or the axis of the force that is off by most, or the tip."""
    if judgement.link.of_tip:
        return "tip"
    name = judgement.traces[0].components[int(np.argmax(np.abs(event.peak)))]
    return name if judgement.link.of_joints else f"f{name}"
