"""What a slip is, what a test for one kind of slip is, and what the tests share."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Effect
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.beside.links import MECHANICS, PATH
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.trace import Signal, Trace
from gcode2krl.gap.thresholds import THRESHOLDS

Alike = tuple[tuple[str, str | None], ...]


@dataclass(frozen=True)
class Slip:
    """A slip, where it showed, and whether anything can be said beyond it."""

    applied: Applied
    link: Signal
    rms_before: float
    """In the unit of the report, as ``rms_after``, which is None where the slip cannot be simulated."""
    rms_after: float | None
    unit: str
    words: str
    final: bool = False
    """The run cannot be compared further."""
    alike: Alike = ()
    """Names and targets of the slips that it cannot be told from; None for a target that is not known."""


class SlipTest(Protocol):
    """A test for one kind of slip."""

    @property
    def effects(self) -> tuple[str, ...]:
        """Return the names of the effects that it finds; one that the library lacks is not found."""

    def find(self, pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
        """Return the slip that all runs share; empty where nothing shows one."""


def motion_traces(pairs: Sequence[Pair]) -> list[Trace]:
    """Return what shows how far the runs have come: their joints, or without any their tips."""
    joints = [trace for pair in pairs if (trace := PATH.motion(pair)) is not None]
    return [
        trace for trace in joints if len(trace.time_s) >= THRESHOLDS.beside.trace_least_rows
    ] or MECHANICS.traces(pairs)


def rms(vectors: Iterable[Floats]) -> float:
    """Return the rms length of the rows of arrays (n, k)."""
    return float(np.sqrt(np.mean(np.concatenate([np.sum(each**2, axis=1) for each in vectors]))))


def rms_left(traces: Sequence[Trace], applied: Applied) -> float:
    """Return the rms length of what is left with an effect in the model."""
    return rms(trace.measured - trace.sample([applied]) for trace in traces)


def rms_before(traces: Sequence[Trace]) -> float:
    """Return the rms length of the gap, a constant clock error of a run left in."""
    return rms(trace.residual for trace in traces)


def best_of(traces: Sequence[Trace], candidates: Sequence[Applied]) -> tuple[Applied, float]:
    """Return the effect that leaves least, and the rms that it leaves; inf where none can be simulated."""
    best, least = candidates[0], float("inf")
    for candidate in candidates:
        try:
            left = rms_left(traces, candidate)
        except Gcode2KrlError:
            continue
        if left < least:
            best, least = candidate, left
    return best, least


def slip_if_explained(traces: Sequence[Trace], applied: Applied, left: float, words: str) -> list[Slip]:
    """Return the slip where it takes nine tenths of the gap's power; ``left`` is the rms that it leaves."""
    before = rms_before(traces)
    if left**2 > (1.0 - THRESHOLDS.slips.explained_share) * before**2:
        return []
    trace = traces[0]
    factor = trace.factor
    return [Slip(applied, trace.link, before * factor, left * factor, trace.unit, words)]


def final_slip(effect: Effect, target: str | None, words: str, pairs: Sequence[Pair]) -> Slip:
    """Return a slip beyond which nothing is compared."""
    traces = motion_traces(pairs)
    factor, unit = (traces[0].factor, traces[0].unit) if traces else (1.0, "mm")
    before = rms_before(traces) if traces else 0.0
    values = {p.name: p.start if p.nominal is None else p.nominal for p in effect.parameters}
    return Slip(Applied(effect, target, values), PATH, before * factor, None, unit, words, final=True)
