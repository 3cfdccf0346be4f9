"""A run that leaves the planned times, told as a gap of timing where nothing else is one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.gap.beside.links import TIMING
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.tell.result import AtPart, Gap, GapSize, LinkResult, RunSize, Unexplained


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
        RunSize(run=each.run, rms_before=each.rms_s, rms_after=each.rms_s, held_out=False) for each in late
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
