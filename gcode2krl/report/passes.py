"""The passes of a program: what one tool cuts at one depth, so that none hides another in a picture."""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32

MOST_PASSES = 8
_FLAT_MM = 1e-3
"""A step between samples that changes Z by less is level."""
_LEVEL = 0.02
"""A level holds at least this share of a tool's level samples."""
_LEVELLED = 0.6
"""A tool works in levels where at least this share of its samples lies in one."""
_GRID_MM = 0.01
"""Heights that are closer are one level."""


class Pass(NamedTuple):
    """Samples of one tool at one depth, or at neighbouring ones where there are too many."""

    name: str
    rows: Bools
    """(m,)"""


def passes_of(z_mm: Floats, tool: Ints32, cuts: Bools, most: int = MOST_PASSES) -> list[Pass]:
    """Divide the samples that ``cuts`` (m,) names by tool and depth, in at most ``most`` passes.

    Each of them is in exactly one pass. A tool that does not work in levels is one pass. A sample between
    two levels belongs to the one below, on the way to which it is.
    """
    tools, first = np.unique(tool[cuts], return_index=True)
    tools = tools[np.argsort(first)]
    if len(tools) > most:
        named, others = tools[: most - 1], tools[most - 1 :]
        return [
            *(Pass(f"T{number}", cuts & (tool == number)) for number in named),
            Pass(f"{len(others)} other tools", cuts & np.isin(tool, others)),
        ]
    passes: list[Pass] = []
    for place, number in enumerate(tools):
        room = (most - len(passes)) // (len(tools) - place)
        passes += _passes_of_tool(z_mm, cuts & (tool == number), f"T{number}", room)
    return passes


def levels_of(z_mm: Floats, rows: Bools) -> Floats:
    """Return the heights (k,) at which the samples lie level, from the top; none where they do not."""
    step = np.abs(np.diff(z_mm, append=z_mm[-1:]))
    level = rows & (step < _FLAT_MM)
    heights, counts = np.unique(np.round(z_mm[level] / _GRID_MM), return_counts=True)
    often = counts >= _LEVEL * counts.sum()
    if counts[often].sum() < _LEVELLED * np.count_nonzero(rows):
        return np.empty(0)
    levels: Floats = heights[often][::-1] * _GRID_MM
    return levels


def _passes_of_tool(z_mm: Floats, rows: Bools, name: str, most: int) -> list[Pass]:
    """Divide a tool's samples by level, neighbouring levels together where there are too many."""
    levels = levels_of(z_mm, rows)
    if len(levels) < 2 or most < 2:
        return [Pass(name, rows)]
    bottoms = np.sort(levels)  # from the lowest
    at = np.clip(np.searchsorted(bottoms, z_mm + _GRID_MM, side="right") - 1, 0, len(bottoms) - 1)
    passes = []
    for group in np.array_split(np.arange(len(bottoms))[::-1], min(len(bottoms), most)):
        depth = f"Z {bottoms[group[0]]:g}" + (f" to {bottoms[group[-1]]:g}" if len(group) > 1 else "")
        passes.append(Pass(f"{name}, {depth}", rows & np.isin(at, group)))
    return [each for each in passes if each.rows.any()]


def overlap(images: list[Floats]) -> float:
    """Return the share of the drawn pixels that more than one of the images covers."""
    covered = sum(np.isfinite(image).astype(np.int64) for image in images)
    drawn = np.count_nonzero(covered)
    return float(np.count_nonzero(np.asarray(covered) > 1) / drawn) if drawn else 0.0
