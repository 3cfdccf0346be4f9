"""Long columns in parts that fit the processor's cache, worked on by all cores at once.

numpy and the compiled kernels release the interpreter, so threads suffice. The parts are the same on every
machine, whatever its number of cores, and so are the results.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import TypeVar

ROWS = 16_384
"""Rows of a part: six columns of them and what is made of them stay in a core's cache."""

Result = TypeVar("Result")


def edges(count: int, rows: int = ROWS) -> list[int]:
    """Return the borders of the parts of ``count`` rows: 0, rows, 2·rows … count."""
    return [*range(0, count, rows), count]


def in_parts(work: Callable[[int, int], Result], borders: Sequence[int]) -> list[Result]:
    """Return ``work(start, end)`` of each part between ``borders``, in their order."""
    spans = list(pairwise(borders))
    workers = min(len(spans), os.cpu_count() or 1)
    if workers < 2:
        return [work(start, end) for start, end in spans]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(work, *zip(*spans, strict=True)))
