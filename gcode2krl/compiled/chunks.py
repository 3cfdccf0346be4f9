"""Long columns in chunks that fit the processor's cache, worked on by all cores at once.

The chunks are the same on every machine, whatever its number of cores, and so are the results.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TypeVar

from gcode2krl.compiled.threads import in_threads

ROWS = 16_384
"""Rows of a chunk: six columns of them and what is made of them stay in a core's cache."""

Result = TypeVar("Result")


def chunk_borders(count: int, rows: int = ROWS) -> list[int]:
    """Return the borders of the chunks of ``count`` rows: 0, rows, 2·rows … count."""
    return [*range(0, count, rows), count]


def in_chunks(
    work: Callable[[int, int], Result], borders: Sequence[int], threads: int | None = None
) -> list[Result]:
    """Return ``work(start, end)`` of each chunk between ``borders``, in their order."""
    return in_threads(lambda chunk: work(*chunk), list(pairwise(borders)), threads)
