"""Work shared out to threads: numpy and the compiled core release the interpreter, so threads suffice."""

import os
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

Task = TypeVar("Task")
Result = TypeVar("Result")
_END: Any = object()
HELPER = "gcode2krl helper"
"""Name of the threads that stay for the next work."""
_MOST_HELPERS = 256
"""More than are ever asked for at once: three stages with one a core."""


THREADS_VARIABLE = "GCODE2KRL_THREADS"
"""In the environment: how many threads to use; ``--threads`` sets it."""


def cores() -> int:
    """Return how many threads to use: what the environment says, one in a pool's worker, else one a core."""
    if named := os.environ.get(THREADS_VARIABLE):
        return int(named)
    multiprocessing = sys.modules.get("multiprocessing")  # a pool's worker has it
    return 1 if multiprocessing is not None and multiprocessing.parent_process() else usable_cores()


def usable_cores() -> int:
    """Return how many cores this process may use, where the system tells."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(
    work: Callable[[Task], Result], tasks: Sequence[Task], threads: int | None = None
) -> list[Result]:
    """Return ``work(task)`` of each task, in their order; ``threads`` is by default one a core.

    The caller works too, so work may be divided again, and raises what the first task that fails raises.
    """
    workers = min(len(tasks), threads or cores())
    if workers < 2:
        return [work(task) for task in tasks]
    waiting = iter(enumerate(tasks))  # shared: no two threads get the same item of it
    results: dict[int, Result] = {}
    errors: dict[int, BaseException] = {}

    def work_on() -> None:
        for k, task in waiting:
            try:
                results[k] = work(task)
            except BaseException as error:
                errors[k] = error
                list(waiting)  # nothing more is begun

    helpers = [_helpers().submit(work_on) for _ in range(workers - 1)]
    work_on()
    for helper in helpers:
        if not helper.cancel():  # one that has not begun finds nothing left to do
            helper.result()
    if errors:
        raise errors[min(errors)]
    return [results[k] for k in range(len(tasks))]


def in_background(work: Callable[[], Result]) -> "Future[Result]":
    """Begin work that waits rather than computes, as for a disk; whoever begins it waits for its end."""
    return _helpers().submit(work)


@cache
def _helpers() -> "ThreadPoolExecutor":
    """Return threads that stay once they are started: starting one takes as long as a small task."""
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(_MOST_HELPERS, thread_name_prefix=HELPER)


if hasattr(os, "register_at_fork"):  # a forked process has none of the threads of its parent
    os.register_at_fork(after_in_child=_helpers.cache_clear)


@contextmanager
def ahead(items: Generator[Result, None, None], threads: int | None = None) -> Iterator[Iterator[Result]]:
    """Give items, the next of which is made in a thread while one is worked on, and close them at the end.

    What making one raises is raised where it is due. At the end of the context the item that is being made is
    waited for. This is no generator with a thread of its own: one that is left behind, as by an exception, is
    closed by the garbage collector, which may run where Python itself starts or ends a thread and holds the
    lock that ending this thread takes, so that the process stands still for ever.
    """
    with closing(items):
        if (threads or cores()) < 2:
            yield items
            return
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(1) as maker:
            yield _made_ahead(items, maker)


def _made_ahead(items: Iterator[Result], maker: "ThreadPoolExecutor") -> Iterator[Result]:
    coming = maker.submit(next, items, _END)
    while (item := coming.result()) is not _END:
        coming = maker.submit(next, items, _END)
        yield item
