"""Where a tool may go down into material that is already cut: what a restart asks of what is left."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections import Tool
from gcode2krl.compiled.core import INT, OUT_FLOATS, core_function
from gcode2krl.cutting.dexels import DEXELS, Dexels
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.stock_checks import standing_mm
from gcode2krl.cutting.turned import TURNED, Turned, body_of, longest_step

_AROUND_MM = 1.0
"""Margin around a tool within which material counts as below it."""
_STEP_MM = 1.0
"""Of the way down along which dexels are asked where material begins."""
_FINE_CELLS = 0.05
"""Shares of a cell by which a surface of dexels may be beside the true one."""
_STANDS_MM = 1e-3

_first_contact = core_function("cutting_first_contact", DEXELS, TURNED, OUT_FLOATS, returns=INT)


def depth_in_material(
    stock: HeightField | Dexels, to_field: Floats, tip_mm: Floats, axis: Floats, tool: Tool, slack_mm: float
) -> float:
    """Return how deep in mm a tool with its tip at a place (3,) in ``$BASE`` is in material.

    A layer of ``slack_mm`` below it and around it does not count: what a rounded corner has left there. In a
    height field the way down the tool axis is free where its end is, as it has no undercuts; of dexels it is
    the smallest of the longest stretches that the tool takes along x, y and z.
    """
    if isinstance(stock, HeightField):
        within = 2.0 * (slack_mm + float(stock.cell_mm.max()))
        smaller = max(tool.diameter_mm - within, 0.1 * tool.diameter_mm)
        inner = tool.model_copy(update={"diameter_mm": smaller})
        return standing_mm(stock, to_field @ tip_mm + np.array([0.0, 0.0, slack_mm]), inner)
    within = slack_mm + _FINE_CELLS * float(stock.cell_mm.max())
    above = tip_mm + within * axis
    removed_mm = _met(stock, np.array([above + _STANDS_MM * axis, above]), axis, tool, -within)[1]
    return float(removed_mm.min())


def free_above_mm(
    stock: HeightField | Dexels, to_field: Floats, tip_mm: Floats, axis: Floats, tool: Tool, above_mm: float
) -> float:
    """Return how far above a tip (3,), along its axis, no material is below the tool or near it.

    Dexels are asked from ``above_mm`` downwards.
    """
    if isinstance(stock, HeightField):
        x, y, z = to_field @ tip_mm
        reach = tool.diameter_mm / 2.0 + _AROUND_MM
        (j0, j1), (i0, i1) = (stock.cells(k, at - reach, at + reach) for k, at in enumerate((x, y)))
        part = stock.height_mm[i0 : i1 + 1, j0 : j1 + 1]
        return float(max(part.max(initial=-np.inf), stock.bottom_mm) - z)
    height_mm = np.append(np.arange(above_mm, 0.0, -_STEP_MM), 0.0)
    met, _ = _met(stock, tip_mm + height_mm[:, None] * axis, axis, tool, _AROUND_MM)
    return float(height_mm[met - 1]) if met < len(height_mm) else 0.0


def _met(stock: Dexels, tip_mm: Floats, axis: Floats, tool: Tool, wider_mm: float) -> tuple[int, Floats]:
    """Return at which of tips (n, 3) a tool made wider meets material, n for none, and what it takes (3,)."""
    bottom, corner, sine, cosine, radius, top = body_of(tool)
    round_off = min(bottom + wider_mm, 0.0)  # of a ball that becomes smaller
    body = (max(bottom + wider_mm, 0.0), max(corner + round_off, 0.0), sine, cosine, radius + wider_mm, top)
    count, bodies = len(tip_mm), np.array([body])
    none, zero, vectors = np.zeros(count, np.bool_), np.zeros(count), np.zeros((count, 3))
    points = Turned(
        position_mm=np.ascontiguousarray(tip_mm),
        axis=np.ascontiguousarray(np.broadcast_to(axis, (count, 3))),
        feed_mm=vectors,
        swing=vectors,
        tool=np.zeros(count, np.int32),
        rapid=none,
        wanted=none,
        way_mm=zero,
        first=none,
        node=none,
        bodies=bodies,
        longest_mm=longest_step(bodies),
    )
    removed_mm = np.zeros(3)
    return int(_first_contact(stock.copy(), points, removed_mm)), removed_mm
