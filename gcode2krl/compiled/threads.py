"""Work shared out to threads: numpy and the compiled core release the interpreter, so threads suffice."""

import multiprocessing
import os
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from typing import Any, TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")
_END: Any = object()


THREADS_VARIABLE = "GCODE2KRL_THREADS"
"""In the environment: how many threads to use; ``--threads`` sets it."""


def cores() -> int:
    """Return how many threads to use: what the environment says, one in a pool's worker, else one a core."""
    if named := os.environ.get(THREADS_VARIABLE):
        return int(named)
    return 1 if multiprocessing.parent_process() else usable_cores()


def usable_cores() -> int:
    """Return how many cores this process may use, where the system tells."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(
    work: Callable[[Task], Result], tasks: Sequence[Task], threads: int | None = None
) -> list[Result]:
    """Return ``work(task)`` of each task, in their order; ``threads`` is by default one a core."""
    workers = min(len(tasks), threads or cores())
    if workers < 2:
        return [work(task) for task in tasks]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(work, tasks))


def ahead(items: Generator[Result, None, None], threads: int | None = None) -> Generator[Result, None, None]:
    """Yield items, the next one of which is made in a thread while one is worked on.

    What making one raises is raised here. The thread ends with the last item, or with this generator: one
    that is being made then is waited for.
    """
    if (threads or cores()) < 2:
        yield from items
        return
    with closing(items), ThreadPoolExecutor(1) as maker:
        coming = maker.submit(next, items, _END)
        while (item := coming.result()) is not _END:
            coming = maker.submit(next, items, _END)
            yield item
