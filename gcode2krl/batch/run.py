"""A batch: what is in the cache is taken from there, the rest goes to the workers, the longest part first."""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from gcode2krl.batch.cache import Cache
from gcode2krl.batch.crew import TaskAnswer, crew_of
from gcode2krl.batch.free_memory import expected_mb
from gcode2krl.batch.planning import Planned
from gcode2krl.batch.results import Record, failed, line_of, why_failed, write_outputs
from gcode2krl.batch.work import Made, make
from gcode2krl.errors import Gcode2KrlError, NotUnderstoodError

_OF_THE_MACHINE = frozenset(["core-missing", "file-unreadable", "output-unwritable"])
"""Findings that the next run may not have."""


class Workers(Protocol):
    """Whoever carries out tasks: a crew on this machine, or a cluster."""

    def answers(
        self,
        function: Callable[[Any], Any],
        tasks: Sequence[Any],
        costs_mb: Sequence[float],
        order: Sequence[int] | None = None,
    ) -> Iterator[TaskAnswer]:
        """Yield the answer of each task as it is finished."""


@dataclass(frozen=True)
class Line:
    """A finished part: its line of ``results.jsonl``, and the share of the batch that is finished with it."""

    record: Record
    share: float


def run_batch(
    planned: Sequence[Planned],
    out: Path,
    workers: Callable[[Sequence[float]], AbstractContextManager[Workers]],
    cache: Cache | None = None,
) -> Iterator[Line]:
    """Yield the line of each part as it is finished; its files are in the folder by then.

    ``workers`` is called with the memory (MB) that the parts need which are not in the cache. Leaving the
    iterator ends the workers; what was finished stays.
    """
    all_bytes = sum(map(_weight, planned))
    done_bytes = 0.0
    to_compute = []
    for part in planned:
        record = _from_cache(part, out, cache)
        if record is None:
            to_compute.append(part)
            continue
        done_bytes += _weight(part)
        yield Line(record, done_bytes / all_bytes)
    for part, record in _computed(to_compute, out, workers, cache):
        done_bytes += _weight(part)
        yield Line(record, done_bytes / all_bytes)
    if cache is not None and to_compute:
        cache.prune()


def crew_for(processes: int | None) -> Callable[[Sequence[float]], AbstractContextManager[Workers]]:
    """Return the maker of a crew: so many processes or one a core, and no more than fit into the memory."""
    return partial(crew_of, processes)


def cluster_at(address: str) -> Callable[[Sequence[float]], AbstractContextManager[Workers]]:
    """Return the maker of a Dask cluster's workers, which have limits of memory of their own."""
    from gcode2krl.batch.cluster import Cluster

    return lambda costs_mb: Cluster(address)


def _weight(planned: Planned) -> float:
    """Return how much of the work a part is; its size says enough."""
    return planned.size_bytes + 1.0


def _from_cache(planned: Planned, out: Path, cache: Cache | None) -> Record | None:
    """Return the line of a part that was computed before, None where it has to be computed."""
    began_s = time.perf_counter()
    entry = cache.get(planned.key) if cache is not None and planned.key else None
    if entry is None:
        return None
    hashes = entry.record.get("sha256", {})
    try:
        write_outputs(out, planned, entry.record, lambda name: entry.content(name, hashes[name]))
        return line_of(planned, entry.record, seconds=time.perf_counter() - began_s, cached=True)
    except (ValueError, KeyError, TypeError):  # the entry is damaged
        return None
    except Gcode2KrlError as error:
        record = failed(planned, error)
        return line_of(planned, record, seconds=time.perf_counter() - began_s, cached=False)


def _computed(
    planned: Sequence[Planned],
    out: Path,
    workers: Callable[[Sequence[float]], AbstractContextManager[Workers]],
    cache: Cache | None,
) -> Iterator[tuple[Planned, Record]]:
    if not planned:
        return
    costs_mb = [expected_mb(part.size_bytes, _has_whole_tables(part)) for part in planned]
    longest_first = sorted(range(len(planned)), key=lambda k: -planned[k].size_bytes)
    with workers(costs_mb) as crew:
        for answer in crew.answers(make, [part.task for part in planned], costs_mb, longest_first):
            part = planned[answer.task]
            yield part, _finished(part, answer, out, cache)


def _is_of(record: Record, planned: Planned) -> bool:
    """Tell whether a record may be kept: part and cell are the same, the machine is not to blame."""
    part, cell = record["input"] or {}, record["cell"] or {}
    same = part.get("sha256") == planned.sha256 and cell.get("sha256") == planned.cell_sha256
    return same and not any(issue["code"] in _OF_THE_MACHINE for issue in record["issues"])


def _has_whole_tables(planned: Planned) -> bool:
    return bool(planned.task.page) or planned.task.order.compensate is not None


def _finished(planned: Planned, answer: TaskAnswer, out: Path, cache: Cache | None) -> Record:
    """Write the files of a part, keep them in the cache, and return its line."""
    try:
        if answer.failure:
            raise NotUnderstoodError(why_failed(answer.failure), str(planned.part.file))
        made: Made = answer.value
        write_outputs(out, planned, made.record, made.files.__getitem__)
    except Gcode2KrlError as error:
        return line_of(planned, failed(planned, error), seconds=answer.seconds, cached=False)
    if cache is not None and planned.key and _is_of(made.record, planned):
        with contextlib.suppress(Gcode2KrlError):  # a full disk costs the time of the next run only
            cache.put(planned.key, made.record, made.files)
    return line_of(planned, made.record, seconds=answer.seconds, cached=False)
