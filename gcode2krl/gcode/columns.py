"""The interpreter's rows as the columns of a Toolpath, a buffer at a time."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

_COLUMNS: dict[str, tuple[str, DTypeLike]] = {
    "rapid": ("rapid", np.bool_),
    "feed_mm_s": ("feed", np.float64),
    "spindle_rad_s": ("spindle", np.float64),
    "tool": ("tool", np.int32),
    "exact_stop": ("exact_stop", np.bool_),
    "tolerance_mm": ("tolerance", np.float64),
    "dwell_s": ("dwell", np.float64),
    "source_line": ("line", np.int32),
    "arc": ("arc", np.int32),
    "machine": ("machine", np.bool_),
    "length_offset_mm": ("length_offset", np.float64),
    "length_offset_tool": ("offset_tool", np.int32),
}
"""Column of the Toolpath: field of the row, type."""
_TRIPLES: dict[str, tuple[tuple[str, str, str], DTypeLike]] = {
    "position_mm": (("x", "y", "z"), np.float64),
    "known": (("known_x", "known_y", "known_z"), np.bool_),
}


class Columns:
    """Columns that grow; pages that no row has reached yet cost nothing."""

    def __init__(self) -> None:
        self.count = 0
        self._room = 0
        self._arrays: dict[str, NDArray[Any]] = {
            **{name: np.empty(0, dtype) for name, (_, dtype) in _COLUMNS.items()},
            **{name: np.empty((0, 3), dtype) for name, (_, dtype) in _TRIPLES.items()},
        }

    def reserve(self, rows: int) -> None:
        """Make room for so many rows in all."""
        if rows <= self._room:
            return
        self._room = max(rows, self._room * 3 // 2)
        for name, old in self._arrays.items():
            larger = np.empty((self._room, *old.shape[1:]), old.dtype)
            larger[: self.count] = old[: self.count]
            self._arrays[name] = larger

    def append(self, rows: NDArray[np.void]) -> None:
        """Take over rows of the interpreter (`machine.ROW`)."""
        self.reserve(self.count + len(rows))
        own = slice(self.count, self.count + len(rows))
        for name, (field, _) in _COLUMNS.items():
            self._arrays[name][own] = rows[field]
        for name, (fields, _) in _TRIPLES.items():
            for axis, field in enumerate(fields):
                self._arrays[name][own, axis] = rows[field]
        self.count += len(rows)

    def finished(self) -> dict[str, NDArray[Any]]:
        """Return the columns by their names in the Toolpath."""
        return {name: array[: self.count] for name, array in self._arrays.items()}
