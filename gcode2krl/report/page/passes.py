"""Passes: what of a motion belongs together on the part, so that one can be looked at without the others."""

from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints, Ints32

MOST_PASSES = 24
"""A list of more check boxes helps nobody."""
_SAME_LEVEL_MM = 0.01


@dataclass(frozen=True)
class Pass:
    """Feed moves between two rapids, or of one height where there would be too many."""

    tool: int
    low_mm: float
    high_mm: float
    first_line: int
    last_line: int

    @property
    def name(self) -> str:
        """Tool, height and lines."""
        z = f"Z {self.low_mm:.2f}"
        if self.high_mm - self.low_mm > _SAME_LEVEL_MM:
            z += f" to {self.high_mm:.2f}"
        return f"T{self.tool}, {z} mm, lines {self.first_line}-{self.last_line}"


def passes_of(z_mm: Floats, rapid: Bools, tool: Ints32, line: Ints32) -> tuple[Ints, list[Pass]]:
    """Return the number (m,) of the pass of each sample, -1 on rapids, and the passes.

    A pass is a run of feed moves of one tool between two rapids. Where these are more than `MOST_PASSES`,
    those of one tool and one height are joined; where these are still too many, heights close to each other.
    """
    number = _runs(rapid, tool)
    if number.max(initial=-1) >= MOST_PASSES:
        number = _joined(number, _levels(number, z_mm), tool)
    count = int(number.max(initial=-1)) + 1
    return number, [_pass(np.flatnonzero(number == one), z_mm, tool, line) for one in range(count)]


def _runs(rapid: Bools, tool: Ints32) -> Ints:
    """Return (m,) the number of the run of feed samples with one tool, -1 on rapids."""
    begins = ~rapid
    begins[1:] &= rapid[:-1] | (tool[1:] != tool[:-1])
    return np.where(rapid, -1, np.cumsum(begins) - 1)


def _levels(run: Ints, z_mm: Floats) -> Floats:
    """Return (r,) the median height of each run."""
    rows = np.flatnonzero(run >= 0)
    edges = np.flatnonzero(np.diff(run[rows])) + 1
    return np.array([np.median(z_mm[part]) for part in np.split(rows, edges)])


def _joined(run: Ints, level_mm: Floats, tool: Ints32) -> Ints:
    """Return (m,) passes of which each joins the runs of one tool at one height or in one band of heights."""
    step_mm = _SAME_LEVEL_MM
    _, first = np.unique(run, return_index=True)
    tool_of_run = tool[first[1:]] if run.min() < 0 else tool[first]
    while True:
        band = np.rint(level_mm / step_mm).astype(np.int64)
        kinds, number = np.unique(np.stack([tool_of_run, -band], axis=1), axis=0, return_inverse=True)
        if len(kinds) <= max(MOST_PASSES, len(np.unique(tool_of_run))):
            break
        step_mm *= 2.0
    return np.where(run >= 0, number.reshape(-1)[run], -1)


def _pass(rows: Ints, z_mm: Floats, tool: Ints32, line: Ints32) -> Pass:
    z, lines = z_mm[rows], line[rows]
    low, high = np.percentile(z, (10.0, 90.0))  # without the way in and out
    return Pass(int(tool[rows[0]]), float(low), float(high), int(lines.min()), int(lines.max()))
