"""Signatures: what an effect does to a signal per unit of its size, from the effect's own implementation.

A block is an effect at a target with one set of shapes; its columns are finite differences of `simulate`
around the nominal model, one for each of the settings that span the effect.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Effect, Parameter
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.beside.trace import Trace

_PADDED = 4
"""Finer than the lines of a spectrum, between which a tone would hide."""

_Made = TypeVar("_Made")
_Key = tuple[float, str, str | None, tuple[tuple[str, float], ...]]


@dataclass(frozen=True)
class Block:
    """An effect at a target with its shapes."""

    effect: Effect
    target: str | None
    shape: Mapping[str, float] = field(default_factory=dict)
    tried: float = 1.0
    """Out of so many independent ones it was chosen by looking at the data."""

    @property
    def key(self) -> tuple[str, str | None]:
        """Return the names of effect and target."""
        return self.effect.name, self.target

    def settings(self, trace: Trace, size: float = 1.0) -> list[Applied]:
        """Return the effects whose signals, less the nominal ones, span the block; ``size`` 1 is typical."""
        phase, shapes = self.effect.phase, [dict(self.shape)]
        if phase is not None:
            shapes = [dict(self.shape) | {phase.name: turn} for turn in (0.0, math.pi / 2.0)]
        return [
            Applied(self.effect, self.target, values)
            for shape in shapes
            for values in self.effect.settings(trace.inputs, self.target, shape, size)
        ]

    def applied(
        self, coefficients: Floats, trace: Trace, shape: Mapping[str, float] | None = None
    ) -> Applied:
        """Return the effect that a combination of the block's columns is."""
        phase, form = self.effect.phase, dict(self.shape) | dict(shape or {})
        if phase is not None:
            form[phase.name] = math.atan2(coefficients[1], coefficients[0])
            coefficients = np.array([math.hypot(coefficients[0], coefficients[1])])
        values = self.effect.combined(coefficients, trace.inputs, self.target, form)
        return Applied(self.effect, self.target, values)

    def bounds(self, trace: Trace) -> tuple[Floats, Floats]:
        """Return the plausible range (c,), (c,) of the coefficients; symmetric where they are a vector."""
        effect, sizes = self.effect, self.effect.sizes
        if effect.phase is not None or effect.direction is not None:
            width = 2 if effect.phase is not None else 3 * len(sizes)
            most = max(_share(p.high, p, effect, trace, self.target) for p in sizes)
            return np.full(width, -most), np.full(width, most)
        ends = np.array(
            [sorted(_share(end, p, effect, trace, self.target) for end in (p.low, p.high)) for p in sizes]
        )
        return ends[:, 0], ends[:, 1]


def _share(value: float, p: Parameter, effect: Effect, trace: Trace, target: str | None) -> float:
    """Return the coefficient of the block's column at which the parameter has a value."""
    name = p.name
    nominal = effect.nominal(trace.inputs, target)[name]
    start = effect.start(trace.inputs, target)[name]
    return (value - nominal) / (start - nominal) if start != nominal else 0.0


def blocks_of(effect: Effect, target: str | None) -> Iterator[Block]:
    """Yield the blocks of an effect at a target, one a combination of shapes; a phase is in the columns."""
    phase = effect.phase
    seen = []
    for shape in effect.shapes():
        form = {name: value for name, value in shape.items() if phase is None or name != phase.name}
        if form not in seen:
            seen.append(form)
            yield Block(effect, target, form)


def blocks_at(
    effect: Effect, target: str | None, frequencies_hz: Sequence[float], looked_at: float
) -> Iterator[Block]:
    """Yield the blocks of an effect with a frequency, at these in place of its grid's.

    They were chosen out of ``looked_at`` independent ones: one for each 1/T of the range, T the duration of a
    run (Scargle 1982).
    """
    frequency = effect.frequency
    if frequency is None:
        return
    seen = set()
    for block in blocks_of(effect, target):
        rest = {name: value for name, value in block.shape.items() if name != frequency.name}
        for value in frequencies_hz:
            key = (value, *sorted(rest.items()))
            if key not in seen:
                seen.add(key)
                tried = max(1.0, looked_at / len(frequencies_hz))
                yield Block(effect, target, rest | {frequency.name: value}, tried)


def blocks_from(
    effect: Effect, target: str | None, moments_s: Sequence[float], looked_at: float
) -> Iterator[Block]:
    """Yield the blocks of an effect that begins at a moment, at these out of so many that were looked at."""
    moment = effect.moment
    if moment is None:
        return
    for block in blocks_of(effect, target):
        for at_s in moments_s:
            yield Block(
                effect, target, {**block.shape, moment.name: at_s}, max(1.0, looked_at / len(moments_s))
            )


def strongest_hz(
    residuals: list[Floats], step_s: float, low: float, high: float, most: int
) -> tuple[float, ...]:
    """Return the frequencies of the highest peaks of the mean power of residuals (n, k), most powerful first.

    Neighbours within 15 % of a higher peak are not taken. Peaks are looked for in a spectrum smoothed over
    0.3 Hz; where one is, is the centre of its cubed power, which a steady tone has within a bin.
    """
    length = min(len(residual) for residual in residuals)
    padded = _PADDED * length
    mean = sum(
        np.abs(np.fft.rfft(rows[:length] - rows[:length].mean(axis=0), padded, axis=0)) ** 2
        for rows in residuals
    )
    power, hz = np.sum(mean, axis=1), np.fft.rfftfreq(padded, step_s)
    wide = max(1, round(0.3 * padded * step_s))
    smooth = np.convolve(power, np.ones(wide) / wide, mode="same")
    peaks: list[float] = []
    for i in np.argsort(-smooth):
        if low <= hz[i] <= high and all(abs(hz[i] / peak - 1.0) > 0.15 for peak in peaks):
            around = slice(max(i - wide, 0), i + wide + 1)
            weight = power[around] ** 3
            centre = float(weight @ hz[around] / max(float(weight.sum()), 1e-300))
            peaks.append(min(max(centre, low), high))
            if len(peaks) == most:
                break
    return tuple(peaks)


class Signatures:
    """Columns of blocks on traces, each computed once and kept as long as its trace is in use."""

    def __init__(self) -> None:
        self._by_trace: WeakKeyDictionary[Trace, dict[_Key, Floats]] = WeakKeyDictionary()
        self._made: WeakKeyDictionary[Trace, tuple[object, Any]] = WeakKeyDictionary()
        self._stacks: WeakKeyDictionary[Trace, tuple[list[_Key], Floats]] = WeakKeyDictionary()

    def once(self, trace: Trace, asked: object, make: Callable[[Trace], _Made]) -> _Made:
        """Return what ``make`` makes of a trace for a question, once as long as no other one is asked."""
        if trace not in self._made or self._made[trace][0] is not asked:
            self._made[trace] = asked, make(trace)
        made: _Made = self._made[trace][1]
        return made

    def same(self, known: Trace, other: Trace) -> None:
        """Let a trace whose stamps are moved by a few ms have the columns of the other one."""
        self._by_trace[other] = self._by_trace.setdefault(known, {})

    def columns(self, block: Block, trace: Trace, size: float = 1.0) -> Floats:
        """Return the block's columns (k, n, c) on a trace, none where the effect is not possible there."""
        known = self._by_trace.setdefault(trace, {})
        key = self._key(block, size)
        if key not in known:
            known[key] = _columns(block, trace, size)
        return known[key]

    def stacked(self, blocks: Sequence[Block], trace: Trace) -> Floats:
        """Return the columns (k, n, s) of blocks side by side, where they are kept from now on.

        But for blocks chosen by looking at the data: with some of it held out others are.
        """
        keys = [self._key(block) for block in blocks]
        if trace in self._stacks and self._stacks[trace][0] == keys:
            return self._stacks[trace][1]
        parts = [self.columns(block, trace) for block in blocks]
        stack, first = unwritten((*trace.shape[::-1], sum(part.shape[2] for part in parts))), 0
        for block, key, part in zip(blocks, keys, parts, strict=True):
            own = stack[:, :, first : first + part.shape[2]]
            for j, column in np.argwhere(part.any(axis=1)).tolist():
                own[j, :, column] = part[j, :, column]
            if block.tried == 1.0:
                self._by_trace[trace][key] = own
            first += part.shape[2]
        self._stacks[trace] = keys, stack
        return stack

    def forget(self) -> None:
        """Let go of all columns, when a link is judged; what is asked for again is made again."""
        self._by_trace.clear()
        self._stacks.clear()

    @staticmethod
    def _key(block: Block, size: float = 1.0) -> _Key:
        return (size, *block.key, tuple(sorted(block.shape.items())))


def _columns(block: Block, trace: Trace, size: float) -> Floats:
    n, k = trace.shape
    try:
        settings = block.settings(trace, size)
        columns = unwritten((k, n, len(settings)))
        for number, applied in enumerate(settings):
            change = (trace.sample([applied]) - trace.nominal).T
            change[~np.isfinite(change)] = 0.0
            for j in np.flatnonzero(change.any(axis=1)):
                columns[j, :, number] = change[j]
    except Gcode2KrlError:
        return np.zeros((k, n, 0))
    return columns


def unwritten(shape: tuple[int, int, int]) -> Floats:
    """Return zeros (k, n, c), one column of one component behind the other.

    What is never written takes no memory: most effects of a joint move it alone.
    """
    k, n, c = shape
    return np.zeros((k, c, n)).transpose(0, 2, 1)
