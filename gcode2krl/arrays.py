"""Names for the types of arrays; shapes and units are in the docstrings of what has them."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Ints32 = NDArray[np.int32]
"""Columns of the tables: moves, lines, tools."""
