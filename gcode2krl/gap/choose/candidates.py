"""Which effects a link tries, and what else its examination needs to know."""

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial

import numpy as np

from gcode2krl.effects import Effect
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.beside.links import SIGNALS, Link
from gcode2krl.gap.beside.stretches import stretches_of_all
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.design import Question
from gcode2krl.gap.fit.moments import strongest_moments
from gcode2krl.gap.fit.signatures import Block, blocks_at, blocks_from, blocks_of, strongest_hz
from gcode2krl.gap.thresholds import THRESHOLDS

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
        any(each.verdict == "unexplained" and not each.link.tells_time for each in context.judgements),
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
        yield from blocks_from(effect, target, moments_s(effect.moment.low, effect.moment.high), stretches)
        return
    p = effect.frequency
    if p is None:
        yield from blocks_of(effect, target)
        return
    residuals = [trace.residual for trace in traces]
    step_s = float(np.median(np.diff(traces[0].time_s)))
    peaks = strongest_hz(residuals, step_s, p.low, p.high, THRESHOLDS.beside.frequency_peaks)
    duration_s = float(traces[0].time_s[-1] - traces[0].time_s[0])
    yield from blocks_at(effect, target, peaks, (p.high - p.low) * duration_s)
