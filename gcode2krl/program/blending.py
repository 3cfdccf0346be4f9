"""CDIS at each corner: from a tolerance if one is given, else the cell's.

The controller leaves the line at d before a corner and joins the next d after it on a parabola; the corner
is then off by d·cos(alpha/2)/2 (Bigliardi et al. 2022, eq. 1-3; alpha = interior angle, d at most half of
the shorter line). Hence d = 2·tolerance/cos(alpha/2), rounded down to a level.
"""

import math

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.core import BOOLS, FLOAT, FLOATS, INT, OUT_FLOATS, core_function

LEVELS_MM = np.array([m * 10.0**e for e in range(-3, 3) for m in (1, 2, 5)])
"""The values ``$APO.CDIS`` may take, so that a program changes it rarely."""

_REVERSAL_COS = math.cos(math.radians(1.0))

_corner_cdis = core_function(
    "program_corner_cdis", FLOATS, FLOATS, FLOAT, BOOLS, FLOATS, FLOAT, INT, INT, OUT_FLOATS
)


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
