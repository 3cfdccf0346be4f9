"""The columns of the linear model: N of all traces side by side, and the signatures of the candidates."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Effect
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.nuisance import Nuisance, nuisance_of
from gcode2krl.gap.fit.signatures import Block, Signatures


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
    behind_unknown: bool = False
    """A measured link before it has a gap without a name, which may show here too."""


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
            for each in items:
                for number in range(_width(each)):
                    if not each.shared:
                        places.setdefault((each.name, number), []).append(int(at[first + number]))
                first += _width(each)
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
            own = sum(_width(each) for each in items if not each.shared)
            at_shared = [np.arange(_width(each)) + firsts[each.name] for each in common]
            places.append(np.concatenate([*at_shared, np.arange(at, at + own)]).astype(np.int64))
            at += own
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
        effect: Floats = (self.columns(number, trace) @ b[self.places[number]]).T
        return effect


def _shared(nuisance: Sequence[Sequence[Nuisance]]) -> Iterator[Nuisance]:
    return (each for items in nuisance for each in items if each.shared)


def _width(nuisance: Nuisance) -> int:
    return int(nuisance.columns.shape[2])


@dataclass(frozen=True, eq=False)
class Column:
    """Where a candidate's columns stand among the signatures, and the range of its coefficients."""

    block: int
    first: int
    width: int
    low: Floats
    high: Floats
    bent: bool = False
    """The signals are not proportional to the size: coefficients tell little of it."""
    tried: float = 1.0
    """Of the block: out of so many it was chosen by looking at the data."""

    @property
    def index(self) -> Ints:
        """Return the numbers of its columns."""
        return np.arange(self.first, self.first + self.width)


@dataclass(frozen=True, eq=False)
class Candidates:
    """The effects that are possible in some traces."""

    blocks: tuple[Block, ...]
    columns: tuple[Column, ...]
    signatures: tuple[Floats, ...]
    """(k, n, s) of each trace."""

    @classmethod
    def of(cls, blocks: Sequence[Block], traces: Sequence[Trace], known: Signatures) -> "Candidates":
        """Return the blocks that do something in at least one trace and are possible in all."""
        kept: list[Block] = []
        columns: list[Column] = []
        first = 0
        for block in blocks:
            signatures = [known.columns(block, trace) for trace in traces]
            if not _is_possible(signatures):
                continue
            width = signatures[0].shape[2]
            low, high = block.bounds(traces[0])
            columns.append(
                Column(len(kept), first, width, low, high, not block.effect.is_linear, block.tried)
            )
            kept.append(block)
            first += width
        stacked = tuple(known.stacked(kept, trace) for trace in traces)
        return cls(tuple(kept), tuple(columns), stacked)

    def block(self, column: Column) -> Block:
        """Return the block whose columns these are."""
        return self.blocks[column.block]


def _is_possible(signatures: Sequence[Floats]) -> bool:
    """Tell whether all traces have the same columns and one of them is not zero."""
    widths = {each.shape[2] for each in signatures}
    return len(widths) == 1 and 0 not in widths and any(np.any(each) for each in signatures)
