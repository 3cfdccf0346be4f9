"""Checks that no part of the tool goes below the table that carries the work."""

from collections.abc import Iterator

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import Tool
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import Issue
from gcode2krl.tables import Targets

_GRID_MM = 1e-3
"""Decimals of the KRL text."""
_MOST = 20


def below_table(targets: Targets, cell: Cell) -> Iterator[Issue]:
    """Yield where a tool goes below ``[table] z_mm``: any motion, approach and retract included.

    Judged at the targets: between two of them the tool goes straight, and a corner is rounded within its
    triangle. (A PTP is not straight, but none ends below the clearance plane, except at HOME.)
    """
    if cell.table is None:
        return
    table_mm = cell.table.z_mm
    lowest_mm = lowest_points(targets, cell)
    below = lowest_mm < table_mm - _GRID_MM
    starts = np.flatnonzero(below & ~np.concatenate([[False], below[:-1]]))
    for row in starts[:_MOST].tolist():
        above = np.flatnonzero(~below[row:])
        end = row + int(above[0]) if len(above) else len(below)
        depth_mm = table_mm - float(lowest_mm[row:end].min())
        what = "HOME" if targets.home[row] else f"T{targets.tool[row]}"
        yield Issue(
            "error",
            "below-table",
            int(targets.source_line[row]),
            f"{what} is up to {depth_mm:.3f} mm below the table at Z {table_mm:g}",
            "check Z, the tool's length and the work offset, or correct [table] z_mm",
        )


def lowest_points(targets: Targets, cell: Cell) -> Floats:
    """Return the height (p,) in ``$BASE`` of the lowest point of the cutter at each target.

    For an upright cutter that is its tip, for an inclined one its corner or its rim.
    """
    x, y, *_ = targets.rotation.T
    upright = 1.0 - 2.0 * (x * x + y * y)  # z component of the tool axis
    leaning = np.sqrt(np.maximum(0.0, 1.0 - upright**2))
    lowest = np.array(targets.position_mm[:, 2])
    if leaning.max(initial=0.0) < 1e-9:
        return lowest
    for number in distinct(targets.tool).tolist():
        with_tool = targets.tool == number
        points = [
            upright[with_tool] * height - leaning[with_tool] * radius - corner
            for radius, height, corner in _outline(cell.tool[number])
        ]
        lowest[with_tool] += np.minimum.reduce([np.zeros(np.count_nonzero(with_tool)), *points])
    return lowest


def _outline(tool: Tool) -> Iterator[tuple[float, float, float]]:
    """Yield radius, height and corner radius of the circles that bound a cutter's lower end."""
    radius = tool.diameter_mm / 2.0
    corner = radius if tool.kind == "ball" else tool.corner_radius_mm
    if tool.kind == "drill":
        half_point = (tool.point_deg or 118.0) / 2.0
        yield radius, radius / float(np.tan(np.radians(half_point))), 0.0
    else:
        yield radius - corner, corner, corner
