"""Columns that do not have to stay in memory: they lie in temporary files, and may grow piece by piece."""

import mmap
import tempfile
from dataclasses import fields, replace
from typing import IO, TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gcode2krl.compiled.long_columns import note_mapped
from gcode2krl.files.output import naming_temporary_folder

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Record = TypeVar("Record", bound=DataclassInstance)

_IN_MEMORY_BYTES = 1 << 20
_ROWS = 65_536


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
        with naming_temporary_folder():
            if self._file is None:
                self._file = tempfile.TemporaryFile()  # noqa: SIM115 - it lives as long as the column
            for piece in self._pieces:
                self._file.write(piece.data)
            self._file.flush()
        self._pieces, self._bytes = [], 0

    def column(self) -> NDArray[Any]:
        """Return all rows, read-only; those of a file are read where they are looked at."""
        if self._file is None:
            return np.concatenate([np.empty((0, *self._tail), self._dtype), *self._pieces])
        self._spill()
        mapped = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
        note_mapped(mapped)
        return np.frombuffer(mapped, self._dtype).reshape(self._rows, *self._tail)


def on_disk(table: "Record") -> "Record":
    """Return a table whose long columns lie in temporary files, and are read where they are looked at."""
    columns = {}
    for spec in fields(table):
        values = getattr(table, spec.name)
        if isinstance(values, np.ndarray) and values.nbytes > _IN_MEMORY_BYTES and values.strides[0]:
            spool = Spool(values.dtype, *values.shape[1:])
            for start in range(0, len(values), _ROWS):
                spool.append(values[start : start + _ROWS])
            columns[spec.name] = spool.column()
    return replace(table, **columns)


def let_go(*tables: "DataclassInstance | NDArray[Any]") -> None:
    """Let go of what has been read of tables on disk; it is read again where it is looked at."""
    if not hasattr(mmap, "MADV_DONTNEED"):
        return  # there the system takes such pages where it needs memory
    for table in tables:
        columns = (
            [table]
            if isinstance(table, np.ndarray)
            else [getattr(table, spec.name) for spec in fields(table)]
        )
        for column in columns:
            while isinstance(column, np.ndarray):
                column = column.base
            column = column.obj if isinstance(column, memoryview) else column
            if isinstance(column, mmap.mmap):
                column.madvise(mmap.MADV_DONTNEED)
