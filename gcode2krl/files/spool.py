"""A column that grows piece by piece and does not have to stay in memory: a temporary file, once it is long."""

import tempfile
from typing import IO, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

_IN_MEMORY_BYTES = 1 << 20


class Spool:
    """A column of rows in a temporary file that vanishes with it; a short one stays in memory."""

    def __init__(self, dtype: DTypeLike, *tail: int) -> None:
        """Take the type and the trailing shape of a row."""
        self._dtype, self._tail = np.dtype(dtype), tail
        self._pieces: list[NDArray[Any]] = []
        self._bytes = 0
        self._rows = 0
        self._file: IO[bytes] | None = None

    def append(self, values: NDArray[Any]) -> None:
        """Add rows."""
        piece = np.array(values, dtype=self._dtype)
        self._rows += len(piece)
        self._pieces.append(piece)
        self._bytes += piece.nbytes
        if self._bytes > _IN_MEMORY_BYTES:
            self._spill()

    def _spill(self) -> None:
        if self._file is None:
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 - it lives as long as the column
        for piece in self._pieces:
            self._file.write(piece.data)
        self._pieces, self._bytes = [], 0

    def column(self) -> NDArray[Any]:
        """Return all rows, read-only; those of a file are read where they are looked at."""
        if self._file is None:
            return np.concatenate([np.empty((0, *self._tail), self._dtype), *self._pieces])
        self._spill()
        self._file.flush()
        return np.memmap(self._file, self._dtype, "r", shape=(self._rows, *self._tail))
