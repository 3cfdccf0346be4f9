"""The array types of the whole package; shapes stand in the docstrings of what takes and returns them."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Ints32 = NDArray[np.int32]
"""Source lines, tools and rows of other tables: the columns that are stored as they are."""
Bools = NDArray[np.bool_]
Complexes = NDArray[np.complex128]
Rows = NDArray[np.int64]
"""Row numbers, to index a table's columns with."""
