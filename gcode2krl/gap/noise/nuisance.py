"""Nuisance: what normal mismatch does to a signal, as columns with the standard deviation of each.

The linear model of a link has N of all its traces side by side, and beside it the signatures of the
candidates.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.effects import Effect
from gcode2krl.effects.effect import LINKS, NO_TARGET
from gcode2krl.effects.mismatch import Mismatch, sigma
from gcode2krl.gap.compare.interpolation import usual_step_s
from gcode2krl.gap.compare.links import CLOCK, clock_columns, time_law_columns
from gcode2krl.gap.compare.trace import Trace, Verdict, unmeasured_at
from gcode2krl.gap.components import Block, Signatures, blocks_of

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
        nuisance
        for nuisance in every
        if np.any(nuisance.columns) or (nuisance.missed is not None and np.any(nuisance.missed))
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
    sample_s = usual_step_s(trace.inputs.time_s) if len(trace.inputs.time_s) > 1 else 0.0
    unsure_s = 0.5 * np.hypot(sigma(mismatch.clock_s) * clock, sigma(sample_s / 2.0))
    yield Nuisance(CLOCK, False, clock_columns(trace, mismatch) * clock, block, missed=trace.kinks * unsure_s)
    if trace.link.has_time_law(upstream):
        yield Nuisance("time law", False, time_law_columns(trace, mismatch))


@dataclass(frozen=True)
class Question:
    """What a link is examined for."""

    library: Mapping[str, Effect]
    blocks: Sequence[Block]
    mismatch: Mismatch
    upstream: frozenset[str]
    """Links before it that are not measured: their mismatch shows in this one."""
    clocks: int = 1
    """How many clocks of their own the compared signals have."""
    clock_share: float = 1.0
    """Of the clocks' normal mismatch, what is left after they were set."""
    seed: int = 0
    joints: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Link of joints -> those that it has data of."""
    unnamed_before: tuple[Verdict, ...] = ()
    """Measured links before it whose gaps have no name; what they have may show here too."""


def nuisance_for(traces: Sequence[Trace], question: Question, known: Signatures) -> list[list[Nuisance]]:
    """Return the nuisance of each trace."""
    clock = question.clocks**0.5 * question.clock_share

    def make(trace: Trace) -> list[Nuisance]:
        return nuisance_of(
            trace, question.library, question.mismatch, known, question.upstream, clock, question.joints
        )

    return [known.once(trace, question, make) for trace in traces]


@dataclass(frozen=True, eq=False)
class NuisanceDesign:
    """N: one coefficient of b for all runs where nuisance is shared, one for each run where it is not."""

    nuisance: tuple[tuple[Nuisance, ...], ...]
    """Of each trace, in the order of its columns: shared ones first."""
    places: tuple[Ints, ...]
    """Where the columns of each trace stand in b."""
    shared: int
    """So many coefficients stand first and are shared."""
    width: int

    @cached_property
    def of_runs(self) -> tuple[Ints, ...]:
        """Return for each column that is each run's own the places of its coefficients, one a run."""
        places: dict[tuple[str, int], list[int]] = {}
        for items, at in zip(self.nuisance, self.places, strict=True):
            first = 0
            for nuisance in items:
                for number in range(_width(nuisance)):
                    if not nuisance.shared:
                        places.setdefault((nuisance.name, number), []).append(int(at[first + number]))
                first += _width(nuisance)
        return tuple(np.array(own, dtype=np.int64) for own in places.values())

    @classmethod
    def of(cls, nuisance: Sequence[Sequence[Nuisance]]) -> "NuisanceDesign":
        """Return the design of the nuisance of several traces."""
        widths = {each.name: _width(each) for each in _shared(nuisance)}
        firsts = dict(zip(widths, np.cumsum([0, *widths.values()]).tolist(), strict=False))
        shared = at = sum(widths.values())
        ordered, places = [], []
        for items in nuisance:
            common = sorted((each for each in items if each.shared), key=lambda each: firsts[each.name])
            ordered.append((*common, *(each for each in items if not each.shared)))
            width = sum(_width(each) for each in items if not each.shared)
            at_shared = [np.arange(_width(each)) + firsts[each.name] for each in common]
            places.append(np.concatenate([*at_shared, np.arange(at, at + width)]).astype(np.int64))
            at += width
        return cls(tuple(ordered), tuple(places), shared, at)

    def columns(self, number: int, trace: Trace) -> Floats:
        """Return the columns (k, n, w) of a trace."""
        n, k = trace.shape
        return np.concatenate(
            [np.zeros((k, n, 0)), *(each.columns for each in self.nuisance[number])], axis=2
        )

    def names(self, number: int) -> list[str]:
        """Return the name of the nuisance of each column (w,) of a trace."""
        return [each.name for each in self.nuisance[number] for _ in range(_width(each))]

    def effect(self, number: int, trace: Trace, b: Floats) -> Floats:
        """Return N·b (n, k) of a trace for coefficients b (m,)."""
        return (self.columns(number, trace) @ b[self.places[number]]).T


def _shared(nuisance: Sequence[Sequence[Nuisance]]) -> Iterator[Nuisance]:
    return (each for items in nuisance for each in items if each.shared)


def _width(nuisance: Nuisance) -> int:
    return int(nuisance.columns.shape[2])


@dataclass(frozen=True, eq=False)
class Column:
    """A candidate: where its columns stand among the signatures, and the range of its coefficients."""

    block: Block
    first: int
    width: int
    low: Floats
    high: Floats

    @property
    def bent(self) -> bool:
        """Tell whether signals are not proportional to the size: coefficients then tell little of it."""
        return not self.block.effect.is_linear

    @property
    def index(self) -> Ints:
        """Return the numbers of its columns."""
        return np.arange(self.first, self.first + self.width)


@dataclass(frozen=True, eq=False)
class Candidates:
    """The effects that are possible in some traces."""

    columns: tuple[Column, ...]
    signatures: tuple[Floats, ...]
    """(k, n, s) of each trace."""

    @classmethod
    def of(cls, blocks: Sequence[Block], traces: Sequence[Trace], known: Signatures) -> "Candidates":
        """Return the blocks that do something in at least one trace and are possible in all."""
        columns: list[Column] = []
        first = 0
        for block in blocks:
            signatures = [known.columns(block, trace) for trace in traces]
            if _is_possible(signatures):
                width = signatures[0].shape[2]
                columns.append(Column(block, first, width, *block.bounds(traces[0])))
                first += width
        kept = [column.block for column in columns]
        return cls(tuple(columns), tuple(known.stacked(kept, trace) for trace in traces))


def _is_possible(signatures: Sequence[Floats]) -> bool:
    """Tell whether all traces have the same columns and one of them is not zero."""
    widths = {each.shape[2] for each in signatures}
    return len(widths) == 1 and 0 not in widths and any(np.any(each) for each in signatures)
