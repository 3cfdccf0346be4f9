"""What is to be done for each part, before anything is computed: its order, its place, its key.

A key names what a result depends on: the bytes of the part, the cell, the options, and the program itself.
"""

import hashlib
import json
import platform
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from gcode2krl.batch.parts import BatchPart
from gcode2krl.batch.work import Task
from gcode2krl.cell.library import models_folder
from gcode2krl.compiled.core import core_digest
from gcode2krl.errors import Gcode2KrlError, Issue, input_error
from gcode2krl.files.program_names import likely_text_bytes, program_stem
from gcode2krl.krl import suggested_name
from gcode2krl.krl.names import name_problem
from gcode2krl.result import cell_of, sha256_of
from gcode2krl.translation import Order
from gcode2krl.translation.inputs import (
    cell_files,
    files_of_job,
    read_cell_under_job,
    require_search,
    subprogram_files,
)
from gcode2krl.translation.project import project_of
from gcode2krl.version import __version__

_PLACES = ("report", "job_path", "tools_path", "search")
"""Options that say where something is; for a key counts what it is."""


@dataclass(frozen=True)
class Planned:
    """A part, and what its batch does with it."""

    part: BatchPart
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
    """What a plan needs of a cell under a job; empty where it cannot be read."""

    sha256: str = ""
    files: tuple[Path, ...] = ()
    externals: tuple[str, ...] = ()


def plan(
    parts: Iterable[BatchPart], order: Order, pages: bool = False, stated: Collection[str] | None = None
) -> list[Planned]:
    """Return what to do for each part with the options of ``order``, and with ``pages`` a page for each.

    ``stated``: the options that no project file changes; None: there are no project files. Raises
    `NotUnderstoodError` where a project file is wrong, where the cell or job of all parts is, or where two
    parts would have one output; a wrong cell of some parts is told when these are translated.
    """
    require_search(order.search)
    listed = list(parts)
    orders = {part.key: _order_of(part, order, stated) for part in listed}
    sources = {(own.cell_path, own.job_path) for own in orders.values()}
    cells = {source: _read_cell(*source, alone=len(sources) == 1) for source in sources}
    cell_of_part = {key: cells[own.cell_path, own.job_path] for key, own in orders.items()}
    names = {part.key: program_name(part, cell_of_part[part.key].externals) for part in listed}
    refuse_collisions(listed, lambda part: names[part.key])
    notes = alike(listed, lambda part: names[part.key])
    return [
        replace(
            _planned(
                part, cell_of_part[part.key], orders[part.key], f"{names[part.key]}.html" if pages else ""
            ),
            note=notes.get(part.key),
        )
        for part in listed
    ]


def _order_of(part: BatchPart, order: Order, stated: Collection[str] | None) -> Order:
    """Return the order of a part: its cell and job where it has its own, else its project's."""
    of_part = replace(order, part=part.file, cell_path=part.cell, job_path=part.job)
    if stated is None:
        return of_part
    given = {name for name in ("cell_path", "job_path") if getattr(of_part, name) is not None}
    project = project_of(part.file).without({*stated, *given}, {field.name for field in fields(Order)})
    return replace(of_part, **project.options, project=project)


def _read_cell(cell_path: str | Path | None, job_path: str | Path | None, *, alone: bool) -> _Cell:
    """Return a cell under a job; one that cannot be read is empty, unless it is the only one."""
    try:
        cell, _ = read_cell_under_job(cell_path, job_path)
        files = (*cell_files(cell_path), *files_of_job(job_path))
    except Gcode2KrlError:
        if alone:
            raise
        return _Cell()
    return _Cell(cell_of(cell, cell_path)["sha256"], tuple(files), tuple(cell.program.externals))


def _planned(part: BatchPart, cell: _Cell, order: Order, page: str) -> Planned:
    try:
        size_bytes, sha256 = likely_text_bytes(part.file), sha256_of(part.file)
    except OSError:  # reading it reports it
        size_bytes, sha256 = 0, ""
    key = key_of(sha256, cell.sha256, dict(_settings(order, page))) if sha256 and cell.sha256 else ""
    subprograms = subprogram_files(order.part, order.search) if sha256 else ()
    inputs = (part.file, *cell.files, *files_of_job(None, order.tools_path), *subprograms)
    return Planned(part, Task(order, page), inputs, size_bytes, sha256, cell.sha256, key)


def _settings(order: Order, page: str) -> Iterator[tuple[str, Any]]:
    """Yield what the files of a part depend on beside the content of part and cell: options and names."""
    yield from ((name, value) for name, value in order.options().items() if name not in _PLACES)
    yield "part", Path(order.part).name
    yield "cell_name", Path(order.cell_path).name if order.cell_path is not None else None
    yield "page", page
    if order.project.file is not None:
        yield "project", (str(order.project.file), order.project.keys)
    subprograms = subprogram_files(order.part, order.search)
    if subprograms:
        yield "subprograms", [(file.name, sha256_of(file)) for file in subprograms]
    if order.job_path is not None:
        job = Path(order.job_path)
        yield "job", (job.name, hashlib.sha256(job.read_bytes()).hexdigest())
    if order.tools_path is not None and Path(order.tools_path).is_file():
        yield "tools", (Path(order.tools_path).name, sha256_of(Path(order.tools_path)))


# where programs go ------------------------------------------------------------------------------------------


def program_name(part: BatchPart, taken: Sequence[str]) -> str:
    """Return the name of a part's program: the file's, or one made from it that a controller takes."""
    stem = program_stem(part.key)
    return suggested_name(stem, taken) if name_problem(stem, taken) else stem


def refuse_collisions(parts: Iterable[BatchPart], name_of: Callable[[BatchPart], str]) -> None:
    """Raise `NotUnderstoodError` where two parts of one folder have one program name; names both."""
    seen: dict[str, BatchPart] = {}
    for part in parts:
        place = f"{part.folder}{name_of(part)}"
        other = seen.setdefault(place.casefold(), part)  # neither KRL nor Windows tells case apart
        if other is not part:
            sentence = f"{other.file} and {part.file} would both be written as {place}.src"
            raise input_error("output-is-input", sentence, "rename one of them")


def alike(parts: Iterable[BatchPart], name_of: Callable[[BatchPart], str]) -> Mapping[str, Issue]:
    """Return part → finding for parts of different folders whose programs have one name."""
    of_name: dict[str, list[BatchPart]] = {}
    for part in parts:
        of_name.setdefault(name_of(part).casefold(), []).append(part)
    findings = {}
    for same in of_name.values():
        for part in same if len(same) > 1 else ():
            others = [other.key for other in same if other is not part]
            more = f" and {len(others) - 1} more" if len(others) > 1 else ""
            sentence = f"{others[0]}{more} has the program name {name_of(part)} too"
            remedy = "a controller keeps one program of a name: rename one if both go to the same robot"
            findings[part.key] = Issue("note", "krl-name", 0, sentence, remedy)
    return findings


# what a result depends on -----------------------------------------------------------------------------------


_FORMAT = 1
"""Of an entry of the cache; a change of it lets all earlier entries go."""
_RECKONING = ("numpy", "scipy", "trimesh", "manifold3d")
"""Packages whose versions may decide over the last digit."""
_MADE = frozenset(["__pycache__", "built"])
"""Folders of what is made from the sources."""


@cache
def program_digest() -> str:
    """Return what tells one state of this program from another: version, files, core, packages, processor.

    The version alone would not do in a source tree, where the files change below it.
    """
    digest = hashlib.sha256(f"{__version__} {core_digest()} {platform.machine()}".encode())
    for name in _RECKONING:
        digest.update(f"{name} {_version_of(name)}\n".encode())
    package = Path(__file__).resolve().parents[1]
    for folder in (package, models_folder()):
        for file in sorted(folder.rglob("*")):
            if file.is_file() and not _MADE.intersection(file.parts):
                digest.update(file.relative_to(folder).as_posix().encode() + b"\0")
                digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def key_of(input_sha256: str, cell_sha256: str, settings: Mapping[str, Any]) -> str:
    """Return the name of an entry; ``settings`` are the options and names that its files depend on."""
    stated = {
        "format": _FORMAT,
        "program": program_digest(),
        "input": input_sha256,
        "cell": cell_sha256,
        "settings": dict(settings),
    }
    return hashlib.sha256(json.dumps(stated, sort_keys=True, default=str).encode()).hexdigest()


def _version_of(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""
