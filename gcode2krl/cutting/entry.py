"""Where a tool may go down into material that is already cut: what a restart asks of a height field."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections import Tool
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.stock_checks import standing_mm

_AROUND_MM = 1.0
"""Margin around a tool within which material counts as below it."""


def depth_in_material(field: HeightField, tip_mm: Floats, tool: Tool, slack_mm: float) -> float:
    """Return how deep in mm a tool at a tip position (3,) in the frame of the field is in material.

    A layer of ``slack_mm`` below it and around it does not count: what a rounded corner has left there. The
    way down the tool axis is free where its end is, as the field has no undercuts.
    """
    within = 2.0 * (slack_mm + float(field.cell_mm.max()))
    inner = tool.model_copy(update={"diameter_mm": max(tool.diameter_mm - within, 0.1 * tool.diameter_mm)})
    return standing_mm(field, tip_mm + np.array([0.0, 0.0, slack_mm]), inner)


def highest_below(field: HeightField, tip_mm: Floats, tool: Tool) -> float:
    """Return the height of the highest material below a tool and near it, else that of the underside."""
    reach = tool.diameter_mm / 2.0 + _AROUND_MM
    (j0, j1), (i0, i1) = (field.cells(axis, tip_mm[axis] - reach, tip_mm[axis] + reach) for axis in (0, 1))
    part = field.height_mm[i0 : i1 + 1, j0 : j1 + 1]
    return float(max(part.max(initial=-np.inf), field.bottom_mm))
