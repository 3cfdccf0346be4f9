"""Sums of columns over blocks of rows."""

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.compiled.core import FLOATS, INTS, OUT_FLOATS, core_function

_block_sums = core_function("gap_block_sums", FLOATS, INTS, OUT_FLOATS)


def sums_between(values: Floats, edges: Ints) -> Floats:
    """Return the sums (b, c) of values (n, c) from each edge (b + 1,) to the next, row after row.

    `np.add.reduceat` takes several times as long where columns are many.
    """
    sums = np.zeros((len(edges) - 1, values.shape[1]))
    if sums.size:
        _block_sums(np.ascontiguousarray(values, dtype=np.float64), edges, sums)
    return sums
