"""Worker processes on this machine: tasks in, answers out as they are finished.

A worker is a pool of loky with one process. A process that dies breaks its whole pool, so with one process it
is known which task it died of, and no other task is lost. loky and not `concurrent.futures`, because its
processes do not run the caller's script again, which a script without an ``if __name__ == "__main__"`` does
not survive, and because their environment is set before a library is loaded.
"""

import contextlib
import faulthandler
import os
import queue
import re
import signal
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing import parent_process
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.batch.free_memory import budget_mb, fitting_processes
from gcode2krl.compiled import MATRIX_VARIABLES
from gcode2krl.compiled.threads import THREADS_VARIABLE, usable_cores

if TYPE_CHECKING:
    from loky import ProcessPoolExecutor

_TICK_S = 0.5
"""Windows lets Ctrl-C through between two waits only; and how soon a worker notes that the batch is gone."""
_LONGEST_WORD = 200
_LIBRARIES = ("OMP_NUM_THREADS", *MATRIX_VARIABLES)
"""What says how many threads a library may have."""
_EXIT_CODE = re.compile(r"\{(SIG\w+|\w+\((\d+)\))")
"""What loky says of a process that ended: ``SIGKILL(-9)`` or ``EXIT(1)``."""


@dataclass(frozen=True)
class TaskAnswer:
    """What became of a task: its value, or why there is none."""

    task: int
    value: Any
    failure: str = ""
    seconds: float = 0.0


def crew_of(processes: int | None, costs_mb: Sequence[float]) -> "Crew":
    """Return a crew: so many processes or one a core, and no more than fit into the free memory."""
    budget = budget_mb()
    return Crew(fitting_processes(min(processes or usable_cores(), len(costs_mb)), budget), budget)


class Crew:
    """Worker processes that share tasks among themselves; its ``with`` statement ends them."""

    def __init__(self, processes: int, budget_mb: float = float("inf")) -> None:
        """Take the number of processes, and the memory that all tasks together may need."""
        self.processes = max(1, processes)
        self._budget_mb = budget_mb
        self._stack = ExitStack()
        self._workers: list[_Worker] = []
        self._threads: list[threading.Thread] = []
        self._changed = threading.Condition()
        self._closed = False
        self._waiting: list[int] = []
        self._running: set[int] = set()
        self._again: set[int] = set()
        self._costs_mb: Sequence[float] = ()
        self._before = 0
        """Tasks from this one on have to wait for their turn."""

    def __enter__(self) -> "Crew":
        temporary = tempfile.TemporaryDirectory(prefix="gcode2krl-", ignore_cleanup_errors=True)
        folder = Path(self._stack.enter_context(temporary))
        self._stack.enter_context(warnings.catch_warnings())
        # loky warns where a system has no pgrep to look for children of a worker, which has none.
        warnings.filterwarnings("ignore", module=r"loky\.")
        self._workers = [_Worker(folder, number) for number in range(self.processes)]
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
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
    ) -> Iterator[TaskAnswer]:
        """Yield the answer of each task as it is finished.

        ``function`` and the tasks are sent to the workers. ``order`` says which is begun first. A task whose
        worker dies, or that lacks memory, is tried again when nothing else runs; the second time it fails.
        With ``ahead`` the answers come in the order of the tasks, and so many at most wait for their turn.
        """
        self._waiting = list(range(len(tasks))) if order is None else list(order)
        self._costs_mb = costs_mb
        self._before = len(tasks) if ahead is None else ahead
        answers: queue.SimpleQueue[TaskAnswer] = queue.SimpleQueue()
        self._threads = [
            threading.Thread(target=self._work, args=(worker, function, tasks, answers), daemon=True)
            for worker in self._workers[: len(tasks)]
        ]
        for thread in self._threads:
            thread.start()
        finished = (_next(answers) for _ in tasks)
        yield from finished if ahead is None else self._in_turn(finished, ahead)

    def _in_turn(self, finished: Iterator[TaskAnswer], ahead: int) -> Iterator[TaskAnswer]:
        """Yield answers in the order of their tasks."""
        early: dict[int, TaskAnswer] = {}
        turn = 0
        for answer in finished:
            early[answer.task] = answer
            while turn in early:
                yield early.pop(turn)
                turn += 1
                with self._changed:
                    self._before = turn + ahead
                    self._changed.notify_all()

    def _work(
        self,
        worker: "_Worker",
        function: Callable[[Any], Any],
        tasks: Sequence[Any],
        answers: "queue.SimpleQueue[TaskAnswer]",
    ) -> None:
        """Let a worker carry out tasks until none is left."""
        while (task := self._take()) is not None:
            began_s = time.perf_counter()
            value, failure, again = worker.call(function, tasks[task])
            if not self._done(task, again):
                answers.put(TaskAnswer(task, value, failure, time.perf_counter() - began_s))

    def _take(self) -> int | None:
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

    def _may_begin(self, task: int) -> bool:
        if task >= self._before:
            return False
        if not self._running:
            return True
        if task in self._again or self._running & self._again:
            return False
        used_mb = sum(self._costs_mb[running] for running in self._running)
        return used_mb + self._costs_mb[task] <= self._budget_mb

    def _done(self, task: int, again: bool) -> bool:
        """Note that a task has ended; True if it is tried again, which happens once."""
        with self._changed:
            self._running.discard(task)
            again = again and task not in self._again
            if again:
                self._again.add(task)
                self._waiting.append(task)
            self._changed.notify_all()
            return again


class _Worker:
    """A pool of one process, which begins with the first call and after it died."""

    def __init__(self, folder: Path, number: int) -> None:
        """Take the folder for its temporary files."""
        self._folder, self._words = folder, folder / f"words-{number}"
        self._pool: ProcessPoolExecutor | None = None
        self._closed = False
        self._lock = threading.Lock()

    def call(self, function: Callable[[Any], Any], task: Any) -> tuple[Any, str, bool]:
        """Return the value of a call, why there is none, and whether the task is worth another try."""
        from loky.process_executor import TerminatedWorkerError

        try:
            return self._begun().submit(_call, function, task).result()  # type: ignore[no-any-return]  # loky has no types
        except TerminatedWorkerError as error:
            failure = _ending(str(error), self._words)
            self._end()
            return None, failure, True
        except Exception as error:  # what cannot be sent or read, or the batch has ended
            self._end()
            return None, f"{type(error).__name__}: {error}", False

    def close(self) -> None:
        """End the process, and let none begin any more; called from any thread."""
        with self._lock:
            self._closed = True
        self._end()

    def _begun(self) -> "ProcessPoolExecutor":
        from loky import ProcessPoolExecutor

        with self._lock:
            if self._closed:
                raise RuntimeError("the batch was stopped")
            if self._pool is None:
                libraries = {
                    name: os.environ.get(name, "1") for name in ("OMP_NUM_THREADS", *MATRIX_VARIABLES)
                }
                places = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(self._folder))
                environment = {**libraries, THREADS_VARIABLE: "1", **places}
                begin = (self._words, os.getpid())
                self._pool = ProcessPoolExecutor(1, initializer=_begin, initargs=begin, env=environment)
            return self._pool

    def _end(self) -> None:
        with self._lock:
            pool, self._pool = self._pool, None
        if pool is not None:
            pool.shutdown(kill_workers=True)


def _next(answers: "queue.SimpleQueue[TaskAnswer]") -> TaskAnswer:
    while True:
        with contextlib.suppress(queue.Empty):
            return answers.get(timeout=_TICK_S)


def _ending(stated: str, words: Path) -> str:
    """Return how a process ended, with its last word."""
    code = _EXIT_CODE.search(stated)
    how = "the worker ended"
    if code is not None:
        how = f"{how} with exit code {code[2]}" if code[2] else f"the worker was ended by {code[1]}"
    try:
        lines = words.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    except OSError:  # it died before it began
        return how
    return f"{how}: {lines[-1][:_LONGEST_WORD]}" if lines else how


# --- in the worker ------------------------------------------------------------------------------------------


def _begin(words: Path, batch: int) -> None:
    """Set up a worker: deaf to Ctrl-C, silent, and gone when the batch is."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    faulthandler.enable(Path(os.devnull).open("w"))  # noqa: SIM115 - loky's would print pages into the words
    descriptor = os.open(words, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for standard in (1, 2):  # what a library prints is none of the batch's output
        os.dup2(descriptor, standard)
    threading.Thread(target=_end_with, args=(batch,), daemon=True).start()


def _end_with(batch: int) -> None:
    """End this process when the batch has ended, however it did."""
    parent = parent_process()
    if sys.platform == "win32" and parent is not None:
        parent.join()  # getppid goes on naming a process that has ended
    else:
        while os.getppid() == batch:
            time.sleep(_TICK_S)
    os._exit(1)


def _call(function: Callable[[Any], Any], task: Any) -> tuple[Any, str, bool]:
    """Carry out a task; an exception comes back as text, as it may be of a kind that cannot be sent."""
    try:
        return function(task), "", False
    except MemoryError:
        return None, "MemoryError", True
    except Exception as error:
        return None, f"{type(error).__name__}: {error}" if str(error) else type(error).__name__, False
