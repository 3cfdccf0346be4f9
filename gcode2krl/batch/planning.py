"""What is to be done for each part, before anything is computed: its order, its key, its place."""

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gcode2krl.batch.identity import key_of
from gcode2krl.batch.parts import Part
from gcode2krl.batch.places import alike, program_name, refuse_collisions
from gcode2krl.batch.work import Task
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue
from gcode2krl.files.program_names import likely_text_bytes
from gcode2krl.result import cell_of, sha256_of
from gcode2krl.translation import Order
from gcode2krl.translation.inputs import (
    cell_files,
    files_of_job,
    read_cell_under_job,
    require_search,
    subprogram_files,
)

_PLACES = ("report", "job_path", "search")
"""Options that say where something is; for a key counts what it is."""


@dataclass(frozen=True)
class Planned:
    """A part, and what its batch does with it."""

    part: Part
    task: Task
    inputs: tuple[Path, ...]
    """Files that no output may replace."""
    size_bytes: int
    sha256: str = ""
    """Of the part; empty where it cannot be read."""
    cell_sha256: str = ""
    key: str = ""
    """Of its entry in the cache; empty where the part cannot be read."""
    note: Issue | None = None


@dataclass(frozen=True)
class _Cell:
    """A cell under a job, and the files of both."""

    cell: Cell
    sha256: str
    files: tuple[Path, ...]


def plan(parts: Iterable[Part], order: Order, pages: bool = False) -> list[Planned]:
    """Return what to do for each part with the options of ``order``, and with ``pages`` a page for each.

    Raises `NotUnderstoodError` where a cell or a job is wrong, or where two parts would have one output.
    """
    require_search(order.search)
    listed = list(parts)
    cells = {(part.cell, part.job): _read_cell(part) for part in listed}
    names = {
        part.key: program_name(part, cells[part.cell, part.job].cell.program.externals) for part in listed
    }
    refuse_collisions(listed, lambda part: names[part.key])
    notes = alike(listed, lambda part: names[part.key])
    return [
        replace(
            _planned(part, cells[part.cell, part.job], order, f"{names[part.key]}.html" if pages else ""),
            note=notes.get(part.key),
        )
        for part in listed
    ]


def _read_cell(part: Part) -> _Cell:
    path = None if part.cell is None else str(part.cell)
    job = None if part.job is None else str(part.job)
    cell, _ = read_cell_under_job(path, job)
    files = (*cell_files(path), *files_of_job(job))
    return _Cell(cell, cell_of(cell, path)["sha256"], tuple(files))


def _planned(part: Part, cell: _Cell, order: Order, page: str) -> Planned:
    own = replace(order, part=part.file, cell_path=part.cell, job_path=part.job)
    try:
        size_bytes, sha256 = likely_text_bytes(part.file), sha256_of(part.file)
    except OSError:  # reading it reports it
        size_bytes, sha256 = 0, ""
    key = key_of(sha256, cell.sha256, dict(_settings(own, page))) if sha256 else ""
    inputs = (part.file, *cell.files, *(subprogram_files(own.part, own.search) if sha256 else ()))
    return Planned(part, Task(own, page), inputs, size_bytes, sha256, cell.sha256, key)


def _settings(order: Order, page: str) -> Iterator[tuple[str, Any]]:
    """Yield what the files of a part depend on beside the content of part and cell: options and names."""
    yield from ((name, value) for name, value in order.options().items() if name not in _PLACES)
    yield "part", Path(order.part).name
    yield "cell_name", Path(order.cell_path).name if order.cell_path is not None else None
    yield "page", page
    subprograms = subprogram_files(order.part, order.search)
    if subprograms:
        yield "subprograms", [(file.name, sha256_of(file)) for file in subprograms]
    if order.job_path is not None:
        job = Path(order.job_path)
        yield "job", (job.name, hashlib.sha256(job.read_bytes()).hexdigest())
