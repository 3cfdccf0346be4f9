"""Input arrays of the compiled loops, checked, and the loops shared out to threads."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats

CHUNK = 20_000
"""Rows that a thread takes at once: inputs and results of a chunk stay in its cache."""


def rows_of(name: str, values: npt.ArrayLike, width: int, count: int | None = None) -> Floats:
    """Return (n, width) contiguous and read-only; a single row is repeated where ``count`` are wanted.

    A kernel that always sees this one array type is compiled once, whatever table its input came from.

    Raises
    ------
    ValueError
        If the shape is another one.
    """
    array = np.asarray(values, dtype=np.float64)
    if count is not None and array.shape in ((width,), (1, width)):
        array = np.broadcast_to(array, (count, width))
    if array.ndim != 2 or array.shape[1] != width or count not in (None, len(array)):
        raise ValueError(f"{name} has shape {array.shape}, not ({'n' if count is None else count}, {width})")
    array = np.ascontiguousarray(array).view()
    array.flags.writeable = False
    return array


def in_chunks(work: Callable[[slice], None], count: int, threads: int | None) -> None:
    """Do ``work`` on every slice of so many rows; the compiled loops in it release the interpreter."""
    chunks = [slice(first, min(first + CHUNK, count)) for first in range(0, count, CHUNK)]
    threads = min(threads or os.cpu_count() or 1, len(chunks))
    if threads <= 1:
        for chunk in chunks:
            work(chunk)
        return
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(work, chunks):
            pass
