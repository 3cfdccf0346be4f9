"""The tasks that wait for a worker, and which of them may begin.

A task begins when its memory fits beside those that run. One that has cost a worker its life begins again
once, when nothing else runs, so that it has all the memory.
"""

import threading
from collections.abc import Sequence


class Shelf:
    """Tasks by their numbers, in the order in which they are to begin."""

    def __init__(
        self, order: Sequence[int], costs_mb: Sequence[float], budget_mb: float, ahead: int | None = None
    ) -> None:
        """Take the order, each task's memory and that of all together.

        ``ahead`` bounds by how many a task may be ahead of the first that was not `passed` on.
        """
        self._waiting = list(order)
        self._costs_mb, self._budget_mb = costs_mb, budget_mb
        self._ahead = ahead
        self._passed = 0
        self._running: set[int] = set()
        self._again: set[int] = set()
        self._closed = False
        self._changed = threading.Condition()

    def take(self) -> int | None:
        """Return the next task as soon as it may begin, None where nothing is left."""
        with self._changed:
            while not self._closed and (self._waiting or self._running):
                task = next(filter(self._may_begin, self._waiting), None)
                if task is not None:
                    self._waiting.remove(task)
                    self._running.add(task)
                    return task
                self._changed.wait()
            return None

    def done(self, task: int) -> None:
        """Note that a task has ended."""
        with self._changed:
            self._running.discard(task)
            self._changed.notify_all()

    def died(self, task: int) -> bool:
        """Note that the worker died of a task; True if it is tried again."""
        with self._changed:
            self._running.discard(task)
            first = task not in self._again
            if first:
                self._again.add(task)
                self._waiting.append(task)
            self._changed.notify_all()
            return first

    def passed(self, count: int) -> None:
        """Note that the first so many tasks are no longer held."""
        with self._changed:
            self._passed = count
            self._changed.notify_all()

    def close(self) -> None:
        """Let nothing begin any more."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _may_begin(self, task: int) -> bool:
        if self._ahead is not None and task >= self._passed + self._ahead:
            return False
        if not self._running:
            return True
        if task in self._again or self._running & self._again:
            return False
        used_mb = sum(self._costs_mb[running] for running in self._running)
        return used_mb + self._costs_mb[task] <= self._budget_mb
