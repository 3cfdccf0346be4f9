"""Means over blocks of time of what was measured and of what may explain it: the data of the slow noise."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.block_sums import sums_between
from gcode2krl.gap.fit.explaining import explaining_columns
from gcode2krl.gap.fit.nuisance import Nuisance
from gcode2krl.gap.fit.slow_noise import BlockMeans
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.fit
_FULL = 0.6
"""Of the usual rows of a block: one with fewer is left out."""
_STEP_SPACING_S, _MOST_STEPS = 0.25, 60
"""Between the times at which a run may have a step, and how many of a run are tried."""


@dataclass(frozen=True, eq=False)
class _Blocks:
    """The rows of one trace by blocks of time."""

    starts: Ints
    """(b,) first row of each block with rows"""
    counts: Floats
    kept: Bools
    numbers: Ints
    """(b,) the number of each block's time, from the start of the model"""

    @classmethod
    def of(cls, trace: Trace) -> "_Blocks":
        number = np.floor((trace.time_s - trace.inputs.time_s[0]) / _LIMITS.noise_block_s).astype(np.int64)
        starts = np.flatnonzero(np.concatenate([[True], np.diff(number) != 0]))
        counts = np.diff(np.append(starts, len(number))).astype(np.float64)
        return cls(starts, counts, counts >= _FULL * float(np.median(counts)), number[starts])

    def means(self, values: Floats) -> Floats:
        """Return the means (b, …) of values (n, …) over the blocks that are kept."""
        wide = values if values.ndim == 2 else values[:, None]
        sums = sums_between(wide, np.append(self.starts, len(values)))
        means: Floats = (sums / self.counts[:, None])[self.kept]
        return means if values.ndim == 2 else means[:, 0]


def block_means(
    traces: Sequence[Trace],
    residuals: Sequence[Floats],
    signatures: Sequence[Floats],
    nuisance: Sequence[Sequence[Nuisance]],
    repeats: bool,
) -> Iterator[BlockMeans]:
    """Yield the block means of each component of residuals (n, k).

    ``repeats``: the runs repeat one program; then of their orthonormal contrasts, without what they share.
    """
    blocks = [_Blocks.of(trace) for trace in traces]
    numbers = [each.numbers[each.kept] for each in blocks]
    for j, inputs in enumerate(explaining_columns(traces)):
        y = [each.means(rows[:, j]) for each, rows in zip(blocks, residuals, strict=True)]
        signed = [each.means(columns[j]) for each, columns in zip(blocks, signatures, strict=True)]
        usual = [
            each.means(_joined([one.columns[j] for one in own], len(trace.time_s)))
            for each, own, trace in zip(blocks, nuisance, traces, strict=True)
        ]
        known = _stacked([*zip(map(_trend, numbers), usual, strict=True)], nuisance)
        smooth = [each.means(own) for each, own in zip(blocks, inputs, strict=True)]
        yield _component(y, numbers, known, signed, smooth, repeats)


def _component(
    y: Sequence[Floats],
    numbers: Sequence[Ints],
    known: Floats,
    signatures: Sequence[Floats],
    smooth: Sequence[Floats],
    repeats: bool,
) -> BlockMeans:
    shared = np.column_stack([np.concatenate(signatures), np.concatenate(smooth)])
    candidates = np.column_stack([shared, _block_diagonal([_steps(each) for each in numbers])])
    values, lengths = np.concatenate(y), [len(each) for each in numbers]
    if not repeats:
        return BlockMeans(values, _segments(numbers), known, candidates, _runs(lengths))
    common = numbers[0]
    for each in numbers[1:]:
        common = np.intersect1d(common, each)
    firsts = np.cumsum([0, *lengths[:-1]])
    rows = [first + np.flatnonzero(np.isin(own, common)) for first, own in zip(firsts, numbers, strict=True)]
    contrasts = _contrasts(len(rows))

    def contrasted(columns: Floats) -> Floats:
        runs = np.stack([columns[at] for at in rows])
        return np.concatenate(list(np.tensordot(contrasts, runs, axes=1)))

    segments, runs = _segments([common] * len(contrasts)), _runs([len(common)] * len(contrasts))
    return BlockMeans(contrasted(values), segments, contrasted(known), contrasted(candidates), runs)


def _runs(lengths: Sequence[int]) -> tuple[tuple[int, int], ...]:
    ends = np.cumsum([0, *lengths]).tolist()
    return tuple(pairwise(ends))


def _contrasts(runs: int) -> Floats:
    """Return orthonormal contrasts (r - 1, r) of runs (Helmert)."""
    rows = []
    for i in range(1, runs):
        row = np.zeros(runs)
        row[:i], row[i] = 1.0, -float(i)
        rows.append(row / np.sqrt(i * (i + 1.0)))
    return np.array(rows)


def _segments(numbers: Sequence[Ints]) -> Ints:
    """Return (s, 2) the stretches of consecutive blocks, those of each run by themselves."""
    found, first = [], 0
    for own in numbers:
        breaks = np.flatnonzero(np.diff(own) > 1) + 1
        edges = first + np.concatenate([[0], breaks, [len(own)]])
        found += [(a, b) for a, b in pairwise(edges.tolist()) if b > a]
        first += len(own)
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def _joined(columns: Sequence[Floats], count: int) -> Floats:
    return np.concatenate([np.zeros((count, 0)), *columns], axis=1)


def _stacked(own: Sequence[tuple[Floats, Floats]], nuisance: Sequence[Sequence[Nuisance]]) -> Floats:
    """Return what is never noise: each run's constant and trend, and mismatch, that of machines shared."""
    trends = _block_diagonal([trend for trend, _ in own])
    shared, single = [], []
    for (_, usual), items in zip(own, nuisance, strict=True):
        widths = [each.columns.shape[2] for each in items]
        is_shared = np.repeat([each.shared for each in items], widths).astype(bool)
        shared.append(usual[:, is_shared])
        single.append(usual[:, ~is_shared])
    alike = len({each.shape[1] for each in shared}) == 1
    together = np.concatenate(shared) if alike else _block_diagonal(shared)
    columns = np.column_stack([trends, together, _block_diagonal(single)])
    kept: Floats = columns[:, np.any(columns != 0.0, axis=0)]
    return kept


def _block_diagonal(parts: Sequence[Floats]) -> Floats:
    whole = np.zeros((sum(len(each) for each in parts), sum(each.shape[1] for each in parts)))
    row = column = 0
    for each in parts:
        whole[row : row + len(each), column : column + each.shape[1]] = each
        row, column = row + len(each), column + each.shape[1]
    return whole


def _trend(numbers: Ints) -> Floats:
    """Return a constant and a straight line (b, 2) over a run."""
    line = numbers - np.mean(numbers)
    return np.column_stack([np.ones(len(numbers)), line / max(float(np.abs(line).max(initial=0.0)), 1.0)])


def _steps(numbers: Ints) -> Floats:
    """Return steps (b, s) of a run at evenly spaced times."""
    seconds = (numbers[-1] - numbers[0]) * _LIMITS.noise_block_s
    count = int(min(_MOST_STEPS, seconds / _STEP_SPACING_S))
    at = np.linspace(numbers[0], numbers[-1], count + 2)[1:-1]
    return (numbers[:, None] >= at).astype(np.float64)
