"""A Dask cluster as the workers of a batch: what a part needs goes over the wire, and its files come back.

Workers need the same gcode2krl and no shared disk. Dask gives the parts of a worker that died to another one.
"""

import os
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.batch.crew import TaskAnswer
from gcode2krl.batch.planning import program_digest
from gcode2krl.batch.work import Made, Task, make
from gcode2krl.compiled.threads import THREADS_VARIABLE
from gcode2krl.errors import NotUnderstoodError, input_error, install_command
from gcode2krl.translation.inputs import cell_files, files_of_job, subprogram_files

if TYPE_CHECKING:
    from distributed import Client

_IN_FLIGHT = 2
"""Parts a thread of the cluster that are sent ahead; more would wait in the scheduler's memory."""
_CONNECT_S = 15


@dataclass(frozen=True)
class Shipment:
    """A task and the content of every file that it reads; its paths begin at the folder it is unpacked to."""

    task: Task
    contents: dict[str, bytes]
    origin: str
    """The folder that the paths began with here, for what a finding says."""


def pack(task: Task) -> Shipment:
    """Return a task as it is sent; raises `NotUnderstoodError` where its files have no folder in common."""
    order = task.order
    cell = None if order.cell_path is None else str(order.cell_path)
    job = None if order.job_path is None else str(order.job_path)
    files = [Path(file).absolute() for file in (*cell_files(cell), *files_of_job(job, order.tools_path))]
    files += [file.absolute() for file in subprogram_files(order.part, order.search)]
    part = Path(order.part).absolute()
    search = [Path(folder).absolute() for folder in order.search]
    try:
        origin = Path(os.path.commonpath([part.parent, *(file.parent for file in files), *search]))
    except ValueError:
        remedy = "put part, cell and job on one drive"
        raise input_error("cluster", "its files are on several drives", remedy, source=str(part)) from None
    moved: dict[str, Any] = {
        name: None if path is None else _below(Path(path).absolute(), origin)
        for name, path in (
            ("part", part),
            ("cell_path", cell),
            ("job_path", job),
            ("tools_path", order.tools_path),
        )
    }
    moved["search"] = tuple(_below(folder, origin) for folder in search)
    contents = {_below(file, origin): file.read_bytes() for file in {part, *files} if file.is_file()}
    return Shipment(replace(task, order=replace(order, **moved)), contents, str(origin / "x")[:-1])


def make_shipped(shipment: Shipment) -> Made:
    """Carry out a shipment on a worker of the cluster."""
    os.environ.setdefault(THREADS_VARIABLE, "1")
    with tempfile.TemporaryDirectory(prefix="gcode2krl-", ignore_cleanup_errors=True) as folder:
        place = Path(folder).resolve()
        for name, content in shipment.contents.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_bytes(content)
        order = shipment.task.order
        moved: dict[str, Any] = {
            "part": place / order.part,
            "cell_path": None if order.cell_path is None else place / order.cell_path,
            "job_path": None if order.job_path is None else place / order.job_path,
            "tools_path": None if order.tools_path is None else place / order.tools_path,
            "search": tuple(str(place / folder) for folder in order.search),
        }
        for folder in moved["search"]:
            Path(folder).mkdir(parents=True, exist_ok=True)
        made = make(replace(shipment.task, order=replace(order, **moved)))
        return Made(_at_home(made.record, f"{place}{os.sep}", shipment.origin), made.files)


def _below(file: Path, origin: Path) -> str:
    """Return the place of a file below a folder, with ``/``."""
    return Path(os.path.normpath(file)).relative_to(os.path.normpath(origin)).as_posix()


def _at_home(value: Any, place: str, origin: str) -> Any:
    """Return a record whose texts name files as the batch knows them."""
    if isinstance(value, str):
        return value.replace(place, origin)
    if isinstance(value, list):
        return [_at_home(each, place, origin) for each in value]
    if isinstance(value, dict):
        return {key: _at_home(each, place, origin) for key, each in value.items()}
    return value


class Cluster:
    """The workers of a Dask scheduler; its ``with`` statement lets go of what is not finished."""

    def __init__(self, address: str) -> None:
        """Take the scheduler's address, such as ``tcp://host:8786``."""
        self.address = address
        self._client: Client | None = None

    def __enter__(self) -> "Cluster":
        self._client = _connected(self.address)
        try:
            self._refuse_other_programs(self._client)
        except BaseException:
            self._client.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._client is not None:
            self._client.close()

    def answers(
        self,
        function: Callable[[Any], Any],
        tasks: Sequence[Task],
        costs_mb: Sequence[float],
        order: Sequence[int] | None = None,
    ) -> Iterator[TaskAnswer]:
        """Yield the answer of each task as it is finished.

        ``function`` is `make`, which `make_shipped` calls; ``costs_mb`` is left to the limits that the
        cluster's workers have.
        """
        assert function is make
        assert self._client is not None
        from distributed import as_completed

        client = self._client
        finished = as_completed(loop=client.loop)
        waiting = iter(range(len(tasks)) if order is None else order)
        began: dict[Any, tuple[int, float]] = {}

        def send(count: int) -> Iterator[TaskAnswer]:
            """Send so many tasks; yield the failure of those that cannot be sent."""
            for task in islice(waiting, count):
                try:
                    future = client.submit(make_shipped, pack(tasks[task]), pure=False)
                except (OSError, NotUnderstoodError) as error:
                    yield TaskAnswer(task, None, str(error))
                    continue
                began[future.key] = task, time.perf_counter()
                finished.add(future)

        with _quiet():
            yield from send(_IN_FLIGHT * max(1, sum(client.nthreads().values())))
            for future in finished:
                task, began_s = began.pop(future.key)
                value, failure = _result(future)
                yield TaskAnswer(task, value, failure, time.perf_counter() - began_s)
                yield from send(1)

    def _refuse_other_programs(self, client: "Client") -> None:
        """Raise where a worker would compute with another program, whose results may differ."""
        remedy = "install this version of gcode2krl and its dependencies on every worker"
        try:
            digests = client.run(program_digest)
        except Exception as error:
            sentence = f"a worker cannot use gcode2krl: {type(error).__name__}: {error}"
            raise input_error("cluster", sentence, remedy, source=self.address) from None
        other = [worker for worker, digest in digests.items() if digest != program_digest()]
        if other:
            sentence = f"{other[0]} has another version of gcode2krl or of what it computes with"
            raise input_error("cluster", sentence, remedy, source=self.address)


def _connected(address: str) -> "Client":
    try:
        from distributed import Client
    except ImportError:
        remedy = install_command("cluster")
        raise input_error("cluster", "dask[distributed] is not installed", remedy) from None
    try:
        return Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        remedy = "start one with `dask scheduler`, or correct the address"
        sentence = f"no scheduler answers: {str(error).splitlines()[0]}"
        raise input_error("cluster", sentence, remedy, source=address) from None


def _result(future: Any) -> tuple[Any, str]:
    """Return the value of a future, or why there is none; the cluster lets go of it."""
    from distributed import KilledWorker

    try:
        return future.result(), ""
    except KilledWorker as error:
        return None, f"the workers of the cluster died of it: {error}".splitlines()[0]
    except MemoryError:
        return None, "MemoryError"
    except Exception as error:
        return None, f"{type(error).__name__}: {error}"
    finally:
        future.release()


@contextmanager
def _quiet() -> Iterator[None]:
    """Let Dask not warn that a part is larger than what it usually sends."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sending large graph")
        yield
