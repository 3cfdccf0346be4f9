"""Nuisance: what normal mismatch does to a signal, as columns with the standard deviation of each."""

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.effects import Effect
from gcode2krl.effects.effect import LINKS, NO_TARGET
from gcode2krl.effects.mismatch import Mismatch, sigma
from gcode2krl.gap.beside.context import unmeasured_at
from gcode2krl.gap.beside.instruments import CLOCK, clock_columns, time_law_columns
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.signatures import Block, Signatures, blocks_of

NO_JOINTS: Mapping[str, frozenset[str]] = MappingProxyType({})

_BENT = 0.5 / 3.0**0.5
"""Of 2·f(B/2) - f(B), a standard deviation: with u = size/B a signal of second order is u·f(B) and beside it
2·u·(1 - u) of that column, at most a half."""
_STRAIGHT = 1e-6
"""Of f(B): less is rounding."""


class Nuisance(NamedTuple):
    """Columns (k, n, c), already times their standard deviation."""

    name: str
    shared: bool
    """One value for all runs, or one for each."""
    columns: Floats
    block: Block | None = None
    """Of which effect, target and shape it is the usual size; None for what only instruments have."""
    bent: bool = False
    """It is what the effect does beyond the first order of its size."""
    missed: Floats | None = None
    """(n, k) standard deviation of what its columns do not have."""


def nuisance_of(
    trace: Trace,
    library: Mapping[str, Effect],
    mismatch: Mismatch,
    known: Signatures,
    upstream: frozenset[str],
    clock: float = 1.0,
    joints: Mapping[str, frozenset[str]] = NO_JOINTS,
) -> list[Nuisance]:
    """Return what normal mismatch may do to a trace.

    ``upstream``: links that are not measured before it; ``clock``: mismatch of its clock over that of one;
    ``joints``: of links of joints those with data.
    """
    every = [
        *_of_effects(trace, library, mismatch, known, upstream, joints),
        *_of_instruments(trace, library, mismatch, upstream, clock),
    ]
    return [
        each for each in every if np.any(each.columns) or (each.missed is not None and np.any(each.missed))
    ]


# Effects at their usual size, one value for all runs


def _of_effects(
    trace: Trace,
    library: Mapping[str, Effect],
    mismatch: Mismatch,
    known: Signatures,
    upstream: frozenset[str],
    joints: Mapping[str, frozenset[str]],
) -> Iterator[Nuisance]:
    cell = trace.inputs.cell
    for effect in _in_order(library, cell):
        for target in effect.targets(cell):
            missing = upstream | unmeasured_at(effect, target, joints)
            if trace.link.name in effect.disturbed(target, missing):
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
        whole = _of_size(known.columns(block, trace, size), number, len(sizes))
        words = (effect.name, target, *(f"{value:g}" for value in block.shape.values()))
        if len(sizes) > 1:
            words = (*words, p.name)
        name = " ".join(filter(None, words))
        yield Nuisance(name, True, whole * (sigma(bound) / bound), block)
        if p.low == p.nominal:
            half = _of_size(known.columns(block, trace, size / 2.0), number, len(sizes))
            bent = 2.0 * half - whole
            if np.abs(bent).max(initial=0.0) > _STRAIGHT * np.abs(whole).max(initial=0.0):
                yield Nuisance(f"{name}, bent", True, bent * _BENT, block, bent=True)


def _of_size(columns: Floats, number: int, count: int) -> Floats:
    """Return the columns (k, n, c) of one of so many sizes."""
    width = columns.shape[2] // count
    return columns[:, :, number * width : (number + 1) * width]


# Instruments, each run its own value


def _of_instruments(
    trace: Trace, library: Mapping[str, Effect], mismatch: Mismatch, upstream: frozenset[str], clock: float
) -> Iterator[Nuisance]:
    for name, columns in trace.link.mismatch(trace, mismatch):
        yield Nuisance(name, False, columns)
    effect = next((each for each in library.values() if each.is_clock), None)
    block = None if effect is None else Block(effect, trace.link.clock)
    # within the clock's deviation of a kink, and between two samples, either rate may hold
    sample_s = float(np.median(np.diff(trace.inputs.time_s))) if len(trace.inputs.time_s) > 1 else 0.0
    unsure_s = 0.5 * np.hypot(sigma(mismatch.clock_s) * clock, sigma(sample_s / 2.0))
    yield Nuisance(CLOCK, False, clock_columns(trace, mismatch) * clock, block, missed=trace.kinks * unsure_s)
    if trace.link.has_time_law(upstream):
        yield Nuisance("time law", False, time_law_columns(trace, mismatch))
