"""Records a session as the folder of a run, in another thread so that no cycle waits for a disk.

The queue between them is bounded. Lines that do not fit, and lines that cannot be written, are counted; the
robot goes on. `runs.load_run` reads the folder: ``run.toml``, ``rsi.log``, ``force.csv``;
``events.csv`` records what happened when.
"""

import queue
import threading
from io import RawIOBase
from pathlib import Path

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import input_error

MOST_WAITING = 50_000
"""Lines between the threads: about a minute without the disk at 4 ms."""
_FORCE = "force.csv"
_HEADS = {
    "rsi.log": b"",
    _FORCE: b"t_s,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm\n",
    "events.csv": b"ipoc,phase,reason,gate,lost,ignored\n",
}
_NMM_PER_NM = 1000.0


class Recorder:
    """Accepts lines immediately and writes them later; use as a context manager."""

    def __init__(self, folder: Path | None, head: str = "", most_waiting: int = MOST_WAITING) -> None:
        """Open the files of a run in ``folder`` (None: nothing is written); ``head`` is its ``run.toml``.

        Raises `NotUnderstoodError` where the folder cannot be written.
        """
        self.dropped = 0
        """Lines that did not fit into the queue."""
        self.unwritten = 0
        """Lines that could not be written."""
        self.written = 0
        self.folder = folder
        self._first_ipoc: int | None = None
        self._files: dict[str, RawIOBase] = {}
        self._queue: queue.Queue[tuple[str, bytes] | None] = queue.Queue(most_waiting)
        self._thread = threading.Thread(target=self._write, name="recorder", daemon=True)
        if folder is not None:
            self._open(folder, head)
        self._thread.start()

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()

    def telegram(self, received: bytes, answer: bytes | None) -> None:
        """Record a telegram, and what was answered."""
        self._put("rsi.log", received.strip() + b"\n" + (answer + b"\n" if answer is not None else b""))

    def load(self, ipoc: int, load: Floats) -> None:
        """Record the sensor's load (6,) at an IPOC."""
        if not np.isfinite(load).all():
            return
        self._first_ipoc = first = ipoc if self._first_ipoc is None else self._first_ipoc
        force, moment = load[:3], load[3:] / _NMM_PER_NM
        values = (*force.tolist(), *moment.tolist())
        self._put(_FORCE, f"{(ipoc - first) / 1000.0:.3f},{','.join(f'{v:.4f}' for v in values)}\n".encode())

    def event(self, ipoc: int, phase: str, reason: str, gate: str, lost: int, ignored: int) -> None:
        """Record that something changed."""
        self._put("events.csv", f"{ipoc},{phase},{reason},{gate},{lost},{ignored}\n".encode())

    def close(self) -> None:
        """Write the waiting lines, and close the files."""
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()
        for file in self._files.values():
            try:
                file.close()
            except OSError:
                self.unwritten += 1

    def _open(self, folder: Path, head: str) -> None:
        try:
            folder.mkdir(exist_ok=True)
            (folder / "run.toml").write_text(head, encoding="utf-8", newline="\n")
            for name, first in _HEADS.items():
                self._files[name] = (folder / name).open("wb", buffering=0)  # a line is written or counted
                self._files[name].write(first)
        except OSError as error:
            why = error.strerror or str(error)
            raise input_error("output-unwritable", f"cannot write: {why}", source=str(folder)) from None

    def _put(self, name: str, line: bytes) -> None:
        if self.folder is None:
            return
        try:
            self._queue.put_nowait((name, line))
        except queue.Full:
            self.dropped += 1

    def _write(self) -> None:
        while (item := self._queue.get()) is not None:
            name, line = item
            try:
                is_written = self._files[name].write(line) == len(line)
            except OSError:
                is_written = False
            self.written += is_written
            self.unwritten += not is_written
