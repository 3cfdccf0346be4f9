"""Feed moves that follow each other merged into one straight move, within a tolerance.

Which corners may go: both moves are feed moves of the G-code with the same feed, tool, tool axis, spindle
speed, length offset and blend tolerance, and nothing happens at the corner: no event, dwell, exact stop or
reversal. A run of moves from corner a to corner b becomes one if, with u the unit vector of the new move,

1. every move of the run points along u within `MOST_TURN_RAD`;
2. every corner between a and b is within the tolerance of the new move.

**The bound.** Take for each corner p of the run the nearest point n(p) of the new move S. By 1 the
projections on the line of S rise from corner to corner, and so do the nearest points, which are these
projections clipped to S. Between two corners p and q, p + t·(q - p) is no further from the point n(p) +
t·(n(q) - n(p)) of S than the farther of |p - n(p)| and |q - n(q)|, as the distance is convex in t. So
walking along the run and along S at once, never backwards, the two stay within the tolerance of each other:
the whole original path is within it of the new one, the whole new path within it of the original, and in
the same order (the Fréchet distance). S begins and ends where the program's text says it, at its last
decimal, so rounding is within the bound; the tolerance has to be larger than it, `LEAST_MM`. A move back,
however short, is not merged, by 1.

**The way there.** From a corner that stays, 1, 2, 4, 8 … moves are tried, then halves between the last that
fits and the first that does not (as Agarwal et al. 2005, Near-linear time approximation algorithms for curve
simplification). A trial looks at its moves once, so m moves that become one cost O(m·log m). Every merged
move has passed both conditions on its own; greedy means only that there may be a way with fewer moves.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Rows
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import BOOLS, FLOAT, FLOATS, OUT_BOOLS, OUT_FLOATS, core_function
from gcode2krl.errors import Issue, input_error
from gcode2krl.program.blending import asked_tolerance, corner_cdis
from gcode2krl.tables import Simplified, Targets, Toolpath, rows_at
from gcode2krl.units import RAD_PER_DEG

MOST_TURN_RAD = 45.0 * RAD_PER_DEG
"""Largest angle between a merged move and the new one: assumed. Two moves that follow each other turn by at
most twice that; a step across the path or a spike stays."""
LEAST_MM, MOST_MM = 0.001, 1.0
"""Range of the tolerance: not below the last decimal; above, it is no tolerance of a milled part."""
_ROUNDING_MM = 1e-9
_NANO_MM, _NANO_IN_GRID, _GRID_IN_MM = 1e-9, 1e6, 1e3
"""The decimals of the KRL text: positions are rounded to 1e-9 mm, then to 0.001 mm."""

_merge = core_function("program_merge", FLOATS, FLOATS, BOOLS, FLOAT, FLOAT, OUT_BOOLS, OUT_FLOATS)


def merged(
    targets: Targets,
    toolpath: Toolpath,
    cell: Cell,
    simplify_mm: float,
    tolerance_mm: float | None = None,
) -> Targets:
    """Return targets without the corners that straight moves may leave out, see the module's head.

    A merged move has the columns of the last of its moves: its row of the Toolpath, its G-code line. The
    approximation is computed anew for the corners that stay, as `blending.corner_cdis` says.

    Parameters
    ----------
    targets : those of the whole toolpath.
    simplify_mm : how far corners that are left out may be from the new moves.
    tolerance_mm : blend tolerance that the targets were made with.

    Raises
    ------
    NotUnderstoodError
        Where the tolerance is not between `LEAST_MM` and `MOST_MM`.
    """
    require_tolerance(simplify_mm)
    blend_mm = asked_tolerance(toolpath, targets.move, cell, tolerance_mm)
    feed = _feed_moves(targets, toolpath)
    may_go = _may_go(targets, toolpath, feed, blend_mm)
    keep, off_mm = straightened(targets.position_mm, may_go, simplify_mm)
    rows = np.flatnonzero(keep)
    new = rows[1:][np.diff(rows) > 1]
    worst = int(new[np.argmax(off_mm[new])]) if len(new) else 0
    simplified = Simplified(
        tolerance_mm=simplify_mm,
        moves=int(np.count_nonzero(feed)),
        left_out=int(np.count_nonzero(~keep)),
        largest_mm=float(off_mm[worst]),
        worst_line=int(targets.source_line[worst]),
    )
    if keep.all():
        return replace(targets, simplified=simplified)
    place = np.cumsum(keep) - 1
    fewer = rows_at(targets, rows)
    exact = np.asarray(fewer.cdis_mm == 0.0)
    return replace(
        fewer,
        cdis_mm=corner_cdis(fewer.position_mm, blend_mm[rows], cell.controller.cdis_mm, exact),
        events=tuple(event._replace(row=int(place[event.row])) for event in targets.events),
        simplified=simplified,
    )


def merging_note(simplified: Simplified, before_s: float, after_s: float, law: str) -> Issue:
    """Return what there is to say of merged moves; the times are those of the motion, by the law named."""
    count, within = simplified.moves, f"within {simplified.tolerance_mm:g} mm"
    if not simplified.left_out:
        sentence = f"simplified: none of {count} feed moves can be merged {within}"
        return Issue("note", "simplified", 0, sentence, "leave out --simplify")
    sentence = (
        f"simplified: {count} feed moves became {count - simplified.left_out} {within}, "
        f"{simplified.largest_mm:.4f} mm off at most, at this line; "
        f"{before_s:.1f} s became {after_s:.1f} s (law {law}, look-ahead unverified)"
    )
    remedy = f"verify it with --simplify {simplified.tolerance_mm:g}"
    return Issue("note", "simplified", simplified.worst_line, sentence, remedy)


def require_tolerance(simplify_mm: float) -> None:
    """Raise where a tolerance is out of its range."""
    if not LEAST_MM <= simplify_mm <= MOST_MM:  # NaN too
        sentence = f"simplify {simplify_mm:g} mm: allowed {LEAST_MM:g} to {MOST_MM:g}"
        raise input_error("option-value", sentence, "0.01 is usual")


def straightened(position_mm: Floats, may_go: Bools, limit_mm: float) -> tuple[Bools, Floats]:
    """Return which corners (p,) of a path stay, and how far (p,) those between are off the move to each.

    ``may_go`` (p,) marks the corners that may be left out.
    """
    keep, off_mm = np.zeros(len(position_mm), dtype=np.bool_), np.zeros(len(position_mm))
    path = np.ascontiguousarray(position_mm)
    _merge(path, as_written(path), may_go, limit_mm - _ROUNDING_MM, math.cos(MOST_TURN_RAD), keep, off_mm)
    return keep, off_mm


def as_written(position_mm: Floats) -> Floats:
    """Return positions as the text says them: rounded to 1e-9, then to 0.001 mm, half away from zero."""
    nano = np.rint(np.abs(position_mm) / _NANO_MM)
    whole = np.floor((nano + _NANO_IN_GRID / 2.0) / _NANO_IN_GRID)
    return np.asarray(np.copysign(whole / _GRID_IN_MM, position_mm))


def _feed_moves(targets: Targets, toolpath: Toolpath) -> Bools:
    row = np.maximum(targets.move, 0)
    programmed = (targets.move >= 0) & ~targets.ptp
    return np.asarray(programmed & ~toolpath.rapid[row] & ~toolpath.machine[row])


def _may_go(targets: Targets, toolpath: Toolpath, feed: Bools, blend_mm: Floats) -> Bools:
    """Mark the targets (p,) at which nothing but a corner between two alike feed moves is."""
    row = np.maximum(targets.move, 0)
    plain = toolpath.is_position() & ~toolpath.machine
    programmed = (targets.move >= 0) & plain[row]
    stretch = np.cumsum(~plain)[row]  # one number as long as row follows row on the path
    follows = programmed[1:] & programmed[:-1] & _same(stretch) & _same(toolpath.axis, row)
    alike = follows & feed[1:] & feed[:-1] & _same(targets.speed_mm_s) & _same(blend_mm)
    for column in (toolpath.tool, toolpath.spindle_rad_s, toolpath.length_offset_mm):
        alike &= _same(column, row)
    may_go = np.zeros(len(row), dtype=np.bool_)
    may_go[1:-1] = follows[:-1] & alike[1:] & (targets.tool[:-2] == targets.tool[2:])
    may_go &= (targets.cdis_mm > 0.0) & (targets.wait_s == 0.0)
    for event in targets.events:
        comes_from_elsewhere = event.kind == "tool"
        may_go[event.row : event.row + 1 + comes_from_elsewhere] = False
    return may_go


def _same(column: NDArray[Any], row: Rows | None = None) -> Bools:
    """Mark where (p - 1,) a column, or chosen rows of one, is as in the row before; NaN is as NaN."""
    if column.strides[0] == 0:
        return np.ones(len(column if row is None else row) - 1, dtype=np.bool_)
    values = column if row is None else column[row]
    equal = values[1:] == values[:-1]
    if values.dtype.kind == "f":
        equal |= np.isnan(values[1:]) & np.isnan(values[:-1])
    return np.asarray(equal if equal.ndim == 1 else equal.all(axis=1))
