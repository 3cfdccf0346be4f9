"""Many cases at once: on processes of this machine, or on a Dask cluster; each record is stored when made."""

import functools
import itertools
import json
import math
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any, TypeVar

from gap_blind_cases import Case, predictions
from gap_blind_run import How, fingerprint, run_case

Result = TypeVar("Result")
NO_DASK = (
    "gap_blind: --scheduler needs Dask, which is not installed: python -m pip install distributed. Without "
    "--scheduler the cases run on processes of this machine"
)


class NoClusterError(Exception):
    """The cluster that was asked for cannot be used; the message says why."""


def done(case: Case, folder: Path, code: str | None) -> dict[str, Any] | None:
    """Return the record of a case that this code has made already; of any code where None is given."""
    file = folder / "results" / f"{case.name}.json"
    if not file.exists():
        return None
    record: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    asked = record["case"]
    same = (asked["effect"], asked.get("form")) == (case.effect, case.form)
    return record if same and code in (None, record["code"]) else None


def store(record: dict[str, Any], folder: Path) -> None:
    """Keep a record; a half-written one is never left behind."""
    case = record["case"]
    file = folder / "results" / f"{case['kind']}-{case['seed']:05d}.json"
    file.parent.mkdir(exist_ok=True)
    unfinished = file.with_suffix(".part")
    unfinished.write_text(json.dumps(record), encoding="utf-8")
    unfinished.replace(file)


def fresh_records(
    cases: Sequence[Case],
    folder: Path,
    how: How,
    jobs: int,
    scheduler: str | None,
    until_s: float = math.inf,
) -> Iterator[dict[str, Any]]:
    """Yield the record of each case as soon as it is made.

    ``until_s``: of `time.monotonic`; no case begins later (on a cluster all of them are made).
    """
    if scheduler is not None:
        yield from _on_cluster(cases, how, scheduler)
    elif cases:
        places = predictions(folder / "predictions" / how.code)
        asked = ((case, folder, how, places) for case in cases)
        yield from in_processes(run_case, asked, jobs, until_s)


def in_processes(
    work: Callable[..., Result], asked: Iterable[tuple[Any, ...]], jobs: int, until_s: float = math.inf
) -> Iterator[Result]:
    """Yield what a function returns for each tuple of arguments, as it comes; none begins after a time."""
    timely = itertools.takewhile(lambda _: time.monotonic() < until_s, asked)
    if jobs <= 1:
        yield from (work(*each) for each in timely)
        return
    fresh = multiprocessing.get_context("spawn")  # so that the threads of numpy stay at one
    with ProcessPoolExecutor(jobs, mp_context=fresh) as pool:
        under_way = {pool.submit(work, *each) for each in itertools.islice(timely, jobs)}
        while under_way:
            finished, under_way = wait(under_way, return_when=FIRST_COMPLETED)
            under_way |= {pool.submit(work, *each) for each in itertools.islice(timely, len(finished))}
            yield from (each.result() for each in finished)


def _on_cluster(cases: Sequence[Case], how: How, scheduler: str) -> Iterator[dict[str, Any]]:
    try:
        from distributed import Client
        from distributed import as_completed as completed
    except ImportError as error:
        raise NoClusterError(NO_DASK) from error
    try:
        client = Client(scheduler, timeout="20s")
    except OSError as error:
        raise NoClusterError(f"gap_blind: no scheduler answers at {scheduler}: {error}") from error
    with client:
        waiting = client.map(at_worker, cases, how=how, pure=False)
        for each in completed(waiting):
            record = each.result()
            each.release()
            yield record


def at_worker(case: Case, how: How) -> dict[str, Any]:
    """Return the record of a case, made on a cluster's worker in a folder of its own.

    Raises NoClusterError where the worker's checkout is not the one that asks.
    """
    if fingerprint() != how.code:
        raise NoClusterError("gap_blind: a worker has another state of the code; give all the same checkout")
    folder, places = _own_folder()
    return run_case(case, folder, how, places)


@functools.cache
def _own_folder() -> tuple[Path, dict[str, str]]:
    """Make a folder with all predictions, once a process."""
    folder = Path(tempfile.mkdtemp(prefix="gap_blind-"))
    return folder, predictions(folder / "predictions")


def say(line: str) -> None:
    """Tell how far the check is."""
    print(line, file=sys.stderr, flush=True)
