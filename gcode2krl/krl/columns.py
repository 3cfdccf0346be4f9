"""Statements in the order of execution to columns of motions: speed and approximation in force, line."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.core import (
    BYTES,
    FLOATS,
    INTS32,
    OUT_BOOLS,
    OUT_FLOATS,
    OUT_INTS,
    OUT_INTS32,
    core_function,
)

_pass = core_function("krl_pass", BYTES, FLOATS, OUT_FLOATS, OUT_INTS)
_motions = core_function(
    "krl_motions", BYTES, BYTES, INTS32, FLOATS, FLOATS, OUT_BOOLS, OUT_FLOATS, OUT_FLOATS, OUT_INTS32
)


def motion_columns(
    kind: NDArray[np.int8], blend: NDArray[np.int8], line: Ints32, number: Floats
) -> tuple[Bools, Floats, Floats, Ints32]:
    """Return PTP, speed in mm/s, approximation in mm and line (p,) of the motions among statements (k,).

    ``number`` (k - p,) is the first number of each statement that is no motion. Speed and approximation are
    those of the last setting that has one, NaN before the first and behind `KIND_FORGETS`; the speed of a PTP
    is NaN, the approximation of a motion without ``C_DIS`` is 0.
    """
    kinds, blends = kind.view(np.uint8), blend.view(np.uint8)
    borders = chunk_borders(len(kind))
    in_force, counts = np.full(2, np.nan), np.zeros(2, dtype=np.int64)
    before = {0: (in_force.copy(), (0, 0))}
    for start, end in pairwise(borders):
        _pass(kinds[start:end], number, in_force, counts)
        before[end] = in_force.copy(), (int(counts[0]), int(counts[1]))
    count = before[borders[-1]][1][0]
    ptp, motion_line = np.empty(count, dtype=np.bool_), np.empty(count, dtype=np.int32)
    speed_mm_s, cdis_mm = np.empty((2, count))

    def part(start: int, end: int) -> None:
        (settings, (motion, other)), (_, (last_motion, last_other)) = before[start], before[end]
        rows, own = slice(start, end), slice(motion, last_motion)
        columns = ptp[own], speed_mm_s[own], cdis_mm[own], motion_line[own]
        _motions(kinds[rows], blends[rows], line[rows], number[other:last_other], settings, *columns)

    in_chunks(part, borders)
    return ptp, speed_mm_s, cdis_mm, motion_line
