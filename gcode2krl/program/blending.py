"""CDIS at each corner: from a tolerance if one is given, else the cell's.

The controller leaves the line at d before a corner and joins the next d after it on a parabola; the corner
is then off by d·cos(alpha/2)/2 (Bigliardi et al. 2022, eq. 1-3; alpha = interior angle, d at most half of
the shorter line). Hence d = 2·tolerance/cos(alpha/2), rounded down to a level.
"""

import math

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.core import BOOLS, FLOAT, FLOATS, INT, OUT_FLOATS, core_function
from gcode2krl.tables import Toolpath

LEVELS_MM = np.array([m * 10.0**e for e in range(-3, 3) for m in (1, 2, 5)])
"""The values ``$APO.CDIS`` may take, so that a program changes it rarely."""

_REVERSAL_COS = math.cos(math.radians(1.0))

_corner_cdis = core_function(
    "program_corner_cdis", FLOATS, FLOATS, FLOAT, BOOLS, FLOATS, FLOAT, INT, INT, OUT_FLOATS
)


def asked_tolerance(toolpath: Toolpath, move: Ints32, cell: Cell, tolerance_mm: float | None) -> Floats:
    """Return the blend tolerance (p,) that is asked for at the end of motions, NaN where none is.

    Order of precedence: ``G64 P``, then the option, then the cell's. ``move`` (p,) is the row of the
    Toolpath; to added motions, -1, ``G64 P`` does not apply.
    """
    of_cell = cell.controller.tolerance_mm
    below = tolerance_mm if tolerance_mm is not None else (of_cell if of_cell is not None else np.nan)
    programmed = np.where(move >= 0, toolpath.tolerance_mm[move], np.nan)
    return np.where(np.isnan(programmed), below, programmed)


def corner_cdis(
    position_mm: Floats,
    tolerance_mm: Floats,
    cdis_mm: float,
    exact: Bools,
) -> Floats:
    """Return CDIS (p,) in mm at the end of each motion.

    ``tolerance_mm`` (p,) is NaN where none is given: there ``cdis_mm`` applies. ``exact`` (p,) forces 0.
    A reversal (interior angle below 1°) is an exact stop.
    """
    count = len(position_mm)
    result = np.empty(count)
    position, tolerance = np.ascontiguousarray(position_mm), np.ascontiguousarray(tolerance_mm)

    def part(start: int, end: int) -> None:
        _corner_cdis(position, tolerance, cdis_mm, exact, LEVELS_MM, _REVERSAL_COS, start, end, result)

    # with a tolerance a corner keeps the level of the one before, so they come one after the other
    in_chunks(part, chunk_borders(count) if np.isnan(tolerance).all() else [0, count])
    return result
