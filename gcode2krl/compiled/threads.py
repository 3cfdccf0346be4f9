"""Work shared out to threads: numpy and the compiled kernels release the interpreter, so threads suffice."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")


def cores() -> int:
    """Return how many threads to use: one a core, or what ``NUMBA_NUM_THREADS`` says in the environment."""
    return int(os.environ.get("NUMBA_NUM_THREADS") or os.cpu_count() or 1)


def in_threads(
    work: Callable[[Task], Result], tasks: Sequence[Task], threads: int | None = None
) -> list[Result]:
    """Return ``work(task)`` of each task, in their order; ``threads`` is by default one a core."""
    workers = min(len(tasks), threads or cores())
    if workers < 2:
        return [work(task) for task in tasks]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(work, tasks))
