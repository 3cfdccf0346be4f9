"""CDIS at each corner: from a tolerance if one is given, else the cell's.

The controller leaves the line at d before a corner and joins the next d after it on a parabola; the corner
is then off by d·cos(alpha/2)/2 (Bigliardi et al. 2022, eq. 1-3; alpha = interior angle, d at most half of
the shorter line). Hence d = 2·tolerance/cos(alpha/2), rounded down to a level.
"""

import math

import numpy as np
from numba import njit

from gcode2krl.arrays import Bools, Floats
from gcode2krl.compiled.chunks import chunk_borders, in_chunks

LEVELS_MM = np.array([m * 10.0**e for e in range(-3, 3) for m in (1, 2, 5)])
"""The values ``$APO.CDIS`` may take, so that a program changes it rarely."""

_REVERSAL_COS = math.cos(math.radians(1.0))


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
    # with a tolerance a corner keeps the level of the one before, so they come one after the other
    borders = chunk_borders(count) if np.isnan(tolerance_mm).all() else [0, count]
    in_chunks(
        lambda start, end: _corner_cdis(
            position_mm, tolerance_mm, cdis_mm, exact, LEVELS_MM, start, end, result
        ),
        borders,
    )
    return result


# each branch is a rule for a corner: ends, reversal, tolerance, level
@njit(cache=True, nogil=True)
def _corner_cdis(position, tolerance, cdis, exact, levels, start, end, result):
    count = len(position)
    current = 0.0
    for i in range(start, end):
        result[i] = 0.0
        if exact[i] or i == 0 or i == count - 1:
            continue
        dot, before, after = 0.0, 0.0, 0.0
        for k in range(3):
            a = position[i, k] - position[i - 1, k]
            b = position[i + 1, k] - position[i, k]
            dot += a * b
            before += a * a
            after += b * b
        if before == 0.0 or after == 0.0:
            result[i] = current if current > 0.0 else cdis
            continue
        cos_turn = min(1.0, max(-1.0, dot / math.sqrt(before * after)))  # alpha = 180° - turn
        if cos_turn < -_REVERSAL_COS:
            continue
        if math.isnan(tolerance[i]):
            result[i] = cdis
            continue
        cos_half = math.sqrt(max(0.0, 0.5 * (1.0 - cos_turn)))  # cos(alpha/2)
        largest = levels[-1] if cos_half < 1e-12 else 2.0 * tolerance[i] / cos_half
        half_line = 0.5 * math.sqrt(min(before, after))
        level = 0.0
        for value in levels:  # the largest allowed level, none beyond what half the line can use
            if value > largest * (1.0 + 1e-12) or level >= half_line:
                break
            level = value
        keeps = current <= largest and current > 0.0 and current >= min(level, half_line)
        current = current if keeps else level
        result[i] = current
