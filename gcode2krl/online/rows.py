"""Arrays as the compiled loops of `online` want them."""

import numpy as np
from numpy.typing import ArrayLike

from gcode2krl.arrays import Floats


def frozen(values: ArrayLike, *shape: int) -> Floats:
    """Return a contiguous read-only float array of the shape, -1 for any length; raises ValueError.

    A kernel that always sees this one array type is compiled once.
    """
    array = np.ascontiguousarray(values, dtype=np.float64).view()
    if array.ndim != len(shape) or any(w not in (-1, n) for n, w in zip(array.shape, shape, strict=False)):
        raise ValueError(f"shape {array.shape}, expected {shape}")
    array.flags.writeable = False
    return array
