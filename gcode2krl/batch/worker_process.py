"""A worker as the batch sees it: a child process that is called and may die.

It is a plain child and not one of `multiprocessing`: such a child runs the caller's script again, which a
script without an ``if __name__ == "__main__"`` does not survive.
"""

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import IO, Any, Self

from gcode2krl.batch.talk import receive, send
from gcode2krl.compiled import MATRIX_VARIABLES
from gcode2krl.compiled.threads import THREADS_VARIABLE

_SERVE = "import sys; sys.path[:] = sys.argv[1:]; from gcode2krl.batch.worker import serve; serve()"
_LIBRARIES = ("OMP_NUM_THREADS", *MATRIX_VARIABLES)
_LONGEST_WORD = 200


class WorkerDiedError(Exception):
    """A worker ended in the middle of a call; the text says how."""


class WorkerProcess:
    """A child process that carries out calls; it starts with the first one and after it died."""

    def __init__(self, folder: Path, threads: int = 1) -> None:
        """Take the folder for its temporary files, and its number of threads."""
        self._folder, self._threads = folder, threads
        self._process: subprocess.Popen[bytes] | None = None
        self._words: IO[bytes] | None = None
        self._closed = False
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def process_id(self) -> int | None:
        """The number of the process, None where none runs."""
        return self._process.pid if self._process is not None else None

    def call(self, function: Any, argument: Any) -> Any:
        """Return ``function(argument)`` of the process; raises `WorkerDiedError` where it dies of it."""
        process = self._process or self._start()
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            send(process.stdin, (function, argument))
            return pickle.loads(receive(process.stdout))
        except (EOFError, OSError):
            raise WorkerDiedError(self._buried(process)) from None

    def close(self) -> None:
        """End the process, and let none begin any more; called from any thread."""
        with self._lock:
            self._closed = True
        self.kill()

    def kill(self) -> None:
        """End the process, whatever it is doing; the next call begins another."""
        with self._lock:
            process, self._process = self._process, None
            words, self._words = self._words, None
        if process is not None:
            process.kill()
            process.wait()
            for stream in (process.stdin, process.stdout):
                if stream is not None:
                    with contextlib.suppress(OSError):  # what was not sent yet
                        stream.close()
        if words is not None:
            words.close()

    def _start(self) -> "subprocess.Popen[bytes]":
        with self._lock:
            if self._closed:
                raise WorkerDiedError("the batch was stopped")
            self._words = tempfile.TemporaryFile(dir=self._folder)  # noqa: SIM115 - lives as long as the process
            self._process = subprocess.Popen(
                [sys.executable, "-c", _SERVE, *(path or str(Path.cwd()) for path in sys.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._words,
                env=self._environment(),
            )
            return self._process

    def _environment(self) -> dict[str, str]:
        threads = {THREADS_VARIABLE: str(self._threads)}
        libraries = {name: os.environ.get(name, str(self._threads)) for name in _LIBRARIES}
        places = {name: str(self._folder) for name in ("TMPDIR", "TEMP", "TMP")}
        return {**os.environ, **libraries, **threads, **places}

    def _buried(self, process: "subprocess.Popen[bytes]") -> str:
        """Return how the process ended, with its last word."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=5.0)  # the pipe closes a little before the process ends
        code, last = process.poll(), self._last_word()
        self.kill()
        how = "the worker ended" if code is None else _ending(code)
        return f"{how}: {last}" if last else how

    def _last_word(self) -> str:
        words = self._words
        if words is None:
            return ""
        try:
            words.seek(0)
            lines = words.read().decode("utf-8", "replace").strip().splitlines()
        except ValueError:  # closed meanwhile
            return ""
        return lines[-1][:_LONGEST_WORD] if lines else ""


def _ending(code: int) -> str:
    """Return an exit code in words."""
    if code >= 0:
        return f"the worker ended with exit code {code}"
    try:
        return f"the worker was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"the worker was ended by signal {-code}"
