"""Rows on which families are compared: whitened values, averaged over short blocks of time."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array

from gcode2krl.arrays import Floats, Ints
from gcode2krl.gap.beside.stretches import stretches_of_all
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.block_sums import sums_between
from gcode2krl.gap.fit.gram import UsedColumns
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.split_columns import SplitColumns
from gcode2krl.gap.thresholds import THRESHOLDS


class Rows:
    """Blocks of the whitened values of all traces, component after component.

    A block is the sum of its values over the root of their number: white noise of unit variance stays that.
    """

    def __init__(self, likelihood: Likelihood) -> None:
        self.likelihood, self.traces = likelihood, likelihood.traces
        self.starts = [_block_starts(trace) for trace in self.traces]
        """First rows of the blocks of each trace."""
        stretches = self._of_values(stretches_of_all(self.traces))
        self.members = _members(stretches)
        """(g, v) 1 where a block belongs to a stretch of time."""
        self.components: Ints = self._of_values(
            np.concatenate([np.repeat(np.arange(k), n) for n, k in (trace.shape for trace in self.traces)])
        )
        """(v,) the component of each block."""
        counts = [trace.shape[1] * len(at) for trace, at in zip(self.traces, self.starts, strict=True)]
        self.runs: Ints = np.repeat(np.arange(len(counts)), counts)
        """(v,) the number of each block's trace."""
        self.nuisance = self._nuisance()
        """(v, m) N."""

    def __len__(self) -> int:
        return len(self.components)

    @property
    def step_s(self) -> float:
        """Return the time between blocks."""
        return float(np.median(np.diff(self.traces[0].time_s[self.starts[0]])))

    def of(self, columns: Sequence[Floats], component: int | None = None) -> Floats:
        """Return columns (k, n, c) of each trace whitened and in blocks, (v, c).

        With ``component`` they are (1, n, c) of that one, and so are the blocks.
        """
        used = range(len(self.likelihood.noise)) if component is None else (component,)
        blocks = [
            self._blocks(number, j, own)
            for number, each in enumerate(columns)
            for j, own in zip(used, each, strict=True)
        ]
        return np.concatenate(blocks)

    def _nuisance(self) -> SplitColumns:
        columns = [
            UsedColumns(self._in_blocks(number, used.values), used.at)
            for number, own in enumerate(self.likelihood.whitened_nuisance)
            for used in own
        ]
        return SplitColumns.of_parts(columns, self.likelihood.design.width)

    def _blocks(self, number: int, component: int, values: Floats) -> Floats:
        """Return the blocks of columns (n, c) of one trace; what is zero stays zero."""
        used = np.asarray(values.any(axis=0))
        if used.all():
            return self._averaged(number, component, values)
        blocks = np.zeros((len(self.starts[number]), len(used)))
        if used.any():
            blocks[:, used] = self._averaged(number, component, values[:, used])
        return blocks

    def _averaged(self, number: int, component: int, values: Floats) -> Floats:
        return self._in_blocks(number, self.likelihood.white(number, component, values))

    def _in_blocks(self, number: int, white: Floats) -> Floats:
        starts = self.starts[number]
        if len(starts) == len(white):
            return white
        edges = np.append(starts, len(white))
        return sums_between(white, edges) / np.sqrt(np.diff(edges))[:, None]

    def _of_values(self, numbers: Ints) -> Ints:
        """Return the number (v,) of each block's first value."""
        ends = np.cumsum([trace.measured.size for trace in self.traces])[:-1]
        parts = []
        for trace, starts, own in zip(self.traces, self.starts, np.split(numbers, ends), strict=True):
            n, k = trace.shape
            parts.append(own.reshape(k, n)[:, starts].ravel())
        return np.concatenate(parts)


def _block_starts(trace: Trace) -> Ints:
    """Return the first rows of blocks; none reaches over a gap of the data."""
    step_s = float(np.median(np.diff(trace.time_s)))
    length = max(1, int(1.0 / (THRESHOLDS.families.rows_hz * step_s) + 1e-6))
    return np.concatenate([np.arange(first, last, length) for first, last in trace.segments])


def _members(stretches: Ints) -> csr_array:
    names, at = np.unique(stretches, return_inverse=True)
    return csr_array((np.ones(len(at)), (at, np.arange(len(at)))), shape=(len(names), len(at)))
