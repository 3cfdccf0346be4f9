"""Input arrays of the compiled loops, checked."""

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats
from gcode2krl.compiled.inputs import shaped


def rows_of(name: str, values: npt.ArrayLike, width: int, count: int | None = None) -> Floats:
    """Return (n, width) contiguous; a single row is repeated ``count`` times.

    Raises
    ------
    ValueError
        If the shape is another one.
    """
    array = np.asarray(values, dtype=np.float64)
    if count is not None and array.shape in ((width,), (1, width)) and array.shape != (count, width):
        array = np.broadcast_to(array, (count, width))
    return shaped(name, array, -1 if count is None else count, width)
