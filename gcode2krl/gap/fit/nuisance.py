"""Nuisance: what normal mismatch does to a signal, as columns with the standard deviation of each."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.effects import Effect
from gcode2krl.effects.effect import LINKS, NO_TARGET
from gcode2krl.effects.mismatch import Mismatch, sigma
from gcode2krl.gap.beside.interpolation import nearest_rows
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.signatures import Block, Signatures, blocks_of

CLOCK, ENCODER_ZERO = "table clock", "encoder zero"
"""Nuisance of instruments: two words, so that no effect can have such a name."""
_JITTER_KNOTS_S = 1.0
_ROUGH = 1e3
"""Standard deviation of a quantity that is never reported, however large, in units of its bound."""


class Nuisance(NamedTuple):
    """Columns (k, n, c), already times their standard deviation."""

    name: str
    shared: bool
    """One value for all runs, or one for each."""
    columns: Floats


def nuisance_of(
    trace: Trace,
    library: Mapping[str, Effect],
    mismatch: Mismatch,
    known: Signatures,
    upstream: frozenset[str],
    clock: float = 1.0,
) -> list[Nuisance]:
    """Return what normal mismatch may do to a trace.

    ``upstream``: links that are not measured before it; ``clock``: mismatch of its clock over that of one.
    """
    every = [
        *_of_effects(trace, library, mismatch, known, upstream),
        *_of_instruments(trace, mismatch, upstream, clock),
    ]
    return [nuisance for nuisance in every if np.any(nuisance.columns)]


# Effects at their usual size, one value for all runs


def _of_effects(
    trace: Trace,
    library: Mapping[str, Effect],
    mismatch: Mismatch,
    known: Signatures,
    upstream: frozenset[str],
) -> Iterator[Nuisance]:
    cell = trace.inputs.cell
    for effect in _in_order(library, cell):
        for target in effect.targets(cell):
            if trace.link.name in effect.disturbed(target, upstream):
                for block in blocks_of(effect, target):
                    yield from _of_block(block, trace, mismatch, known)


def _in_order(library: Mapping[str, Effect], cell: Cell) -> list[Effect]:
    """Return the effects that are nuisances: along the chain of links, in a link those with targets first.

    The order moves sums in their last digits only.
    """

    def place(effect: Effect) -> tuple[int, bool]:
        return min(LINKS.index(link) for link in effect.links), effect.targets(cell) == NO_TARGET

    return sorted((effect for effect in library.values() if effect.is_nuisance), key=place)


def _of_block(block: Block, trace: Trace, mismatch: Mismatch, known: Signatures) -> Iterator[Nuisance]:
    """Yield the columns of each size of a block that has a usual bound."""
    effect, target = block.effect, block.target
    usual = effect.usual(mismatch, float(trace.time_s[-1] - trace.time_s[0]))
    start, nominal = effect.start(trace.inputs, target), effect.nominal(trace.inputs, target)
    sizes = effect.sizes
    for number, p in enumerate(sizes):
        bound, typical = usual.get(p.name, 0.0), start[p.name] - nominal[p.name]
        if bound == 0.0 or typical == 0.0:
            continue
        # at the size that it may have: a lag of 15 ms has another shape than one of half a millisecond
        size = abs(bound / typical)
        columns = known.columns(block, trace, size)
        width = columns.shape[2] // len(sizes)
        own = columns[:, :, number * width : (number + 1) * width]
        words = (effect.name, target, *(f"{value:g}" for value in block.shape.values()))
        if len(sizes) > 1:
            words = (*words, p.name)
        yield Nuisance(" ".join(filter(None, words)), True, own * (sigma(bound) / (size * typical)))


# Instruments, each run its own value


def _of_instruments(
    trace: Trace, mismatch: Mismatch, upstream: frozenset[str], clock: float
) -> Iterator[Nuisance]:
    yield from _of_encoders(trace, mismatch)
    yield from _of_force_sensor(trace, mismatch)
    yield from _of_tracker(trace, mismatch)
    yield Nuisance(CLOCK, False, -_stacked(trace.clock_rate)[:, :, None] * sigma(mismatch.clock_s) * clock)
    yield from _of_time_law(trace, mismatch, upstream)


def _of_encoders(trace: Trace, mismatch: Mismatch) -> Iterator[Nuisance]:
    if trace.link.name == "gear":
        yield Nuisance(ENCODER_ZERO, False, _constants(trace) * mismatch.joint_zero_rad * _ROUGH)


def _of_force_sensor(trace: Trace, mismatch: Mismatch) -> Iterator[Nuisance]:
    if trace.link.name == "force":
        yield Nuisance("force zero", False, _force_zero(trace) * sigma(mismatch.force_zero_N))
        yield Nuisance("sensor gain", False, _diagonal(trace.nominal) * sigma(mismatch.sensor_gain))


def _of_tracker(trace: Trace, mismatch: Mismatch) -> Iterator[Nuisance]:
    if trace.link.name == "mechanics":
        yield Nuisance("tracker frame", False, _frame(trace, mismatch))


def _of_time_law(trace: Trace, mismatch: Mismatch, upstream: frozenset[str]) -> Iterator[Nuisance]:
    if trace.link.name == "path" or (trace.link.name == "mechanics" and "path" in upstream):
        yield Nuisance("time law", False, _jitter(trace, _JITTER_KNOTS_S) * sigma(mismatch.clock_s))


def _stacked(values: Floats) -> Floats:
    return np.ascontiguousarray(values.T)


def _constants(trace: Trace) -> Floats:
    n, k = trace.shape
    return np.repeat(np.eye(k)[:, None, :], n, axis=1)


def _diagonal(values: Floats) -> Floats:
    """Return (k, n, k): column j is component j alone."""
    n, k = values.shape
    columns = np.zeros((k, n, k))
    for j in range(k):
        columns[j, :, j] = values[:, j]
    return columns


def _force_zero(trace: Trace) -> Floats:
    """Return a unit force along each axis of the sensor, in the frame of the measured values."""
    if trace.in_sensor_frame or trace.in_tool_frame:
        return _constants(trace)
    turned = _rows(trace, trace.inputs.sensor_rotation)
    return np.ascontiguousarray(np.moveaxis(turned, 0, 1))


def _frame(trace: Trace, mismatch: Mismatch) -> Floats:
    """Return a shift along and a small turn about each axis of ``$BASE``, about the path's middle."""
    position = trace.nominal
    turned = np.zeros((3, len(position), 6))
    for axis in range(3):
        turned[axis, :, axis] = sigma(mismatch.frame_mm)
    arm = position - position.mean(axis=0)
    for axis in range(3):
        turn = np.cross(np.eye(3)[axis], arm)
        turned[:, :, 3 + axis] = turn.T * sigma(mismatch.frame_rad)
    return turned


def _jitter(trace: Trace, knots_s: float) -> Floats:
    """Return the signal's rate times hats over time: a time law that is off by a little, here and there."""
    start, end = trace.time_s[0], trace.time_s[-1]
    knots = np.linspace(start, end, max(2, round((end - start) / knots_s) + 1))
    hats = np.maximum(0.0, 1.0 - np.abs(trace.time_s[:, None] - knots) / (knots[1] - knots[0]))
    columns: Floats = -_stacked(trace.rate)[:, :, None] * hats[None]
    return columns


def _rows(trace: Trace, rotations: Floats) -> Floats:
    return rotations[nearest_rows(trace.inputs.time_s, trace.time_s)]
