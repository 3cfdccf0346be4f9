"""The output folder: files and line of each part, files about the whole batch, what is outdated."""

import contextlib
import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from gcode2krl.batch.planning import Planned
from gcode2krl.batch.written import contents, records_of
from gcode2krl.errors import Gcode2KrlError, Issue, input_error
from gcode2krl.files import unwritable, write_together
from gcode2krl.result import input_of, issue_dicts, record_of

Record = dict[str, Any]
RESULTS = "results.jsonl"


def write_results(out: Path, records: Iterable[Record], before: Sequence[Record] | None) -> list[Path]:
    """Write what there is to say about all parts, beside those of ``before``; return the files."""
    made = contents(records, before, Path.cwd().as_posix())
    files = {out / name: content for name, content in made.items()}
    write_together(files)
    return list(files)


def read_results(folder: Path) -> list[Record]:
    """Return the records of an earlier batch; raises `NotUnderstoodError` where there are none."""
    file = folder / RESULTS
    remedy = "name the output folder of an earlier batch"
    try:
        records = records_of(file.read_bytes())
    except OSError as error:
        why = f"cannot read: {error.strerror}"
        raise input_error("file-unreadable", why, remedy, source=str(file)) from None
    if not records:
        raise input_error("file-unreadable", "no record of a part", remedy, source=str(file))
    return [dict(record) for record in records]


def earlier_files(out: Path) -> dict[str, dict[str, str]]:
    """Return part → file → SHA-256 of what an earlier batch wrote into the folder; empty if unknown."""
    with contextlib.suppress(Exception):
        return {
            str(record["part"]): {str(name): str(sha256) for name, sha256 in record["sha256"].items()}
            for record in read_results(out)
        }
    return {}


def remove_outdated(out: Path, earlier: Mapping[str, str], record: Record) -> None:
    """Remove what an earlier batch wrote for a part and this one did not, if nobody has changed it since.

    A program that is refused now must not stay beside those that were written.
    """
    for name in earlier.keys() - set(record["files"]):
        place = out / PurePosixPath(name)
        if ".." in PurePosixPath(name).parts or PurePosixPath(name).is_absolute():
            continue
        with contextlib.suppress(OSError):
            if hashlib.sha256(place.read_bytes()).hexdigest() == earlier[name]:
                place.unlink()


# of one part ------------------------------------------------------------------------------------------------


_NOT_KNOWN: Record = {
    "moves": None,
    "time_s": None,
    "path_mm": None,
    "max_force_N": None,
    "max_deflection_mm": None,
    "corner_error_mm": None,
    "verify": {"max_deviation_mm": None},
    "pilot": {"knots": None, "max_error_N": None},
    "thumbnail": None,
}


def write_outputs(out: Path, planned: Planned, record: Record, content: Callable[[str], bytes]) -> None:
    """Write the files of a record that are not there as they should be, together.

    ``content`` returns a file by its name. Raises `NotUnderstoodError` where one is an input or cannot be
    written, and what ``content`` raises.
    """
    place = out / planned.part.folder
    hashes: Mapping[str, str] = record["sha256"]
    missing = [name for name, sha256 in hashes.items() if not _is_there(place / name, sha256)]
    if not missing:
        return
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(place, error.strerror or str(error)) from None
    write_together({place / name: content(name) for name in missing}, planned.inputs)


def _is_there(file: Path, sha256: str) -> bool:
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest() == sha256
    except OSError:
        return False


def line_of(planned: Planned, record: Record, *, seconds: float, cached: bool) -> Record:
    """Return the line of a part: its record with the names of this batch, whoever computed it and when."""
    part, cell, order = planned.part, record["cell"], planned.task.order
    line: Record = {
        **record,
        "input": record["input"] and record["input"] | {"file": str(part.file)},
        "cell": cell and cell | {"file": None if order.cell_path is None else str(order.cell_path)},
        "options": _options(planned, record["options"]),
        "files": [f"{part.folder}{name}" for name in record["files"]],
        "sha256": {f"{part.folder}{name}": sha256 for name, sha256 in record["sha256"].items()},
    }
    if planned.note is not None:
        counts = dict(line["counts"])
        counts["notes"] += 1
        line |= {"counts": counts, "issues": [*line["issues"], *issue_dicts([planned.note])]}
    ours = {"part": part.key, "seconds": round(seconds, 4), "cached": cached}
    return {**line, **ours, "thumbnail": record.get("thumbnail"), "against": None}


def _options(planned: Planned, options: Record) -> Record:
    job = planned.task.order.job_path
    return options | ({"job_path": str(job)} if "job_path" in options and job is not None else {})


def failed(planned: Planned, error: Gcode2KrlError) -> Record:
    """Return the record of a part of which nothing is known but why."""
    order = planned.task.order
    options = order.options() | ({"report": planned.task.page} if planned.task.page else {})
    source = input_of(order.part)
    return record_of("translate", _NOT_KNOWN, error.issues, exit_code=2, input=source, options=options)


def why_failed(failure: str) -> Issue:
    """Return the finding for a part that cost its workers their lives, or that the program failed at."""
    if failure.startswith("the worker") or failure == "MemoryError":
        remedy = "give it more memory, or fewer --processes; if neither helps, report it with the part"
        return Issue("error", "worker-died", 0, f"tried twice: {failure}", remedy)
    return Issue("error", "internal-error", 0, failure, "report it with the part")
