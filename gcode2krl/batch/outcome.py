"""The outputs of a part in the output folder, and its line of ``results.jsonl``."""

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gcode2krl.batch.planning import Planned
from gcode2krl.errors import Gcode2KrlError, Issue
from gcode2krl.files import unwritable, write_together
from gcode2krl.result import input_of, issue_dicts, record_of

Record = dict[str, Any]
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
    part, cell = planned.part, record["cell"]
    found: Record = {
        **record,
        "input": record["input"] and record["input"] | {"file": str(part.file)},
        "cell": cell and cell | {"file": None if part.cell is None else str(part.cell)},
        "options": _options(planned, record["options"]),
        "files": [f"{part.folder}{name}" for name in record["files"]],
        "sha256": {f"{part.folder}{name}": sha256 for name, sha256 in record["sha256"].items()},
    }
    if planned.note is not None:
        counts = dict(found["counts"])
        counts["notes"] += 1
        found |= {"counts": counts, "issues": [*found["issues"], *issue_dicts([planned.note])]}
    ours = {"part": part.key, "seconds": round(seconds, 4), "cached": cached}
    return {**found, **ours, "thumbnail": record.get("thumbnail"), "against": None}


def _options(planned: Planned, options: Record) -> Record:
    job = planned.part.job
    return options | ({"job_path": str(job)} if "job_path" in options and job is not None else {})


def failed(planned: Planned, error: Gcode2KrlError) -> Record:
    """Return the record of a part of which nothing is known but why."""
    order = planned.task.order
    options = order.options() | ({"report": planned.task.page} if planned.task.page else {})
    found = input_of(order.part)
    return record_of("translate", _NOT_KNOWN, error.issues, exit_code=2, input=found, options=options)


def why_failed(failure: str) -> Issue:
    """Return the finding for a part that cost its workers their lives, or that the program failed at."""
    if failure.startswith("the worker") or failure == "MemoryError":
        remedy = "give it more memory, or fewer --processes; if neither helps, report it with the part"
        return Issue("error", "worker-died", 0, f"tried twice: {failure}", remedy)
    return Issue("error", "internal-error", 0, failure, "report it with the part")
