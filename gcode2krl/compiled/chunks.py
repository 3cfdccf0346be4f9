"""Long columns in chunks that fit the processor's cache, worked on by all cores at once.

The chunks are the same on every machine, whatever its number of cores, and so are the results.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gcode2krl.compiled.threads import in_threads

ROWS = 16_384
"""Rows of a chunk: six columns of them and what is made of them stay in a core's cache."""

Result = TypeVar("Result")


def chunk_borders(count: int, rows: int = ROWS) -> list[int]:
    """Return the borders of the chunks of ``count`` rows: 0, rows, 2·rows … count."""
    return [*range(0, count, rows), count]


def chunked(work: Callable[[slice], NDArray[Any]], count: int) -> NDArray[Any]:
    """Return ``work(rows)`` of each chunk joined, a column (count,): what it makes on the way stays small."""
    if count <= ROWS:
        return work(slice(0, count))
    column = np.empty(count)

    def write(start: int, end: int) -> None:
        column[start:end] = work(slice(start, end))

    in_chunks(write, chunk_borders(count))
    return column


def in_chunks(
    work: Callable[[int, int], Result], borders: Sequence[int], threads: int | None = None
) -> list[Result]:
    """Return ``work(start, end)`` of each chunk between ``borders``, in their order."""
    return in_threads(lambda chunk: work(*chunk), list(pairwise(borders)), threads)
