"""A crew of worker processes on this machine: tasks in, answers out as they are finished."""

import contextlib
import queue
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcode2krl.batch.shelf import Shelf
from gcode2krl.batch.talk import Raised
from gcode2krl.batch.worker_process import WorkerDiedError, WorkerProcess

_TICK_S = 0.5
"""Windows lets Ctrl-C through between two waits only."""


@dataclass(frozen=True)
class Answer:
    """What became of a task: its value, or why there is none."""

    task: int
    value: Any
    failure: str = ""
    seconds: float = 0.0


class Crew:
    """Worker processes that share tasks among themselves; its ``with`` statement ends them."""

    def __init__(self, processes: int, budget_mb: float = float("inf")) -> None:
        """Take the number of processes, and the memory that all tasks together may need."""
        self.processes = max(1, processes)
        self.budget_mb = budget_mb
        self._shelf: Shelf | None = None
        self._stack = ExitStack()
        self._workers: list[WorkerProcess] = []
        self._threads: list[threading.Thread] = []

    def __enter__(self) -> "Crew":
        folder = self._stack.enter_context(
            tempfile.TemporaryDirectory(prefix="gcode2krl-", ignore_cleanup_errors=True)
        )
        self._workers = [WorkerProcess(Path(folder)) for _ in range(self.processes)]
        return self

    def __exit__(self, *_: object) -> None:
        if self._shelf is not None:
            self._shelf.close()
        for worker in self._workers:
            worker.close()
        for thread in self._threads:
            thread.join()
        with contextlib.suppress(OSError):  # a system that still holds a file of a killed worker
            self._stack.close()

    def answers(
        self,
        function: Callable[[Any], Any],
        tasks: Sequence[Any],
        costs_mb: Sequence[float],
        order: Sequence[int] | None = None,
        ahead: int | None = None,
    ) -> Iterator[Answer]:
        """Yield the answer of each task as it is finished.

        ``function`` and the tasks are sent to the workers. ``order`` says which is begun first. A task whose
        worker dies, or that lacks memory, is tried again when nothing else runs; the second time it fails.
        With ``ahead`` the answers come in the order of the tasks, and so many at most wait for their turn.
        """
        numbers = list(range(len(tasks))) if order is None else list(order)
        shelf = self._shelf = Shelf(numbers, costs_mb, self.budget_mb, ahead)
        answers: queue.SimpleQueue[Answer] = queue.SimpleQueue()
        self._threads = [
            threading.Thread(target=_work, args=(worker, shelf, function, tasks, answers), daemon=True)
            for worker in self._workers[: len(tasks)]
        ]
        for thread in self._threads:
            thread.start()
        finished = (_next(answers) for _ in numbers)
        yield from finished if ahead is None else _in_turn(finished, shelf)


def _next(answers: "queue.SimpleQueue[Answer]") -> Answer:
    while True:
        with contextlib.suppress(queue.Empty):
            return answers.get(timeout=_TICK_S)


def _in_turn(finished: Iterator[Answer], shelf: Shelf) -> Iterator[Answer]:
    """Yield answers in the order of their tasks."""
    early: dict[int, Answer] = {}
    turn = 0
    for answer in finished:
        early[answer.task] = answer
        while turn in early:
            yield early.pop(turn)
            turn += 1
            shelf.passed(turn)


def _work(
    worker: WorkerProcess,
    shelf: Shelf,
    function: Callable[[Any], Any],
    tasks: Sequence[Any],
    answers: "queue.SimpleQueue[Answer]",
) -> None:
    """Let a worker carry out tasks until none is left."""
    while (task := shelf.take()) is not None:
        began_s = time.perf_counter()
        value: Any = None
        try:
            value = worker.call(function, tasks[task])
            failure = str(value) if isinstance(value, Raised) else ""
            again = isinstance(value, Raised) and value.kind == "MemoryError"
        except WorkerDiedError as error:
            failure, again = str(error), True
        except Exception as error:  # what cannot be sent or read
            worker.kill()
            failure, again = f"{type(error).__name__}: {error}", False
        if again and shelf.died(task):
            continue
        shelf.done(task)
        answers.put(Answer(task, None if failure else value, failure, time.perf_counter() - began_s))
