"""One part, from G-code to the bytes of its files: what a worker carries out, on this machine or another."""

import hashlib
import os
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gcode2krl.batch.thumbnail import thumbnail_of
from gcode2krl.translation import Attempt, Order, carry_out

Record = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """A part as a worker gets it; where the files go is not the worker's business."""

    order: Order
    page: str = ""
    """The name of the page to write, empty for none."""


@dataclass(frozen=True)
class Made:
    """What a worker made of a part."""

    record: Record
    """Its ``files`` are names without a folder."""
    files: dict[str, bytes]


def make(task: Task) -> Made:
    """Translate a part in a folder of its own and return its record and files."""
    with tempfile.TemporaryDirectory(prefix="gcode2krl-", ignore_cleanup_errors=True) as folder:
        place = Path(folder)
        page = place / task.page if task.page else None
        attempt = carry_out(replace(task.order, output=place, report=page))
        files = {file.name: file.read_bytes() for file in _files_of(attempt)}
        return Made(_record_of(attempt, files, place), files)


def _files_of(attempt: Attempt) -> list[Path]:
    written = list(attempt.written.files) if attempt.written is not None else []
    return [*written, attempt.page] if attempt.page is not None else written


def _record_of(attempt: Attempt, files: dict[str, bytes], place: Path) -> Record:
    """Return the record with names in the place of paths, and the path of the part seen from above."""
    record: Record = dict(attempt.record)
    record["files"] = list(files)
    record["sha256"] = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    record["options"] = {
        name: Path(value).name if name == "report" else value for name, value in record["options"].items()
    }
    record["issues"] = [
        issue | {"message": issue["message"].replace(f"{place}{os.sep}", "")} for issue in record["issues"]
    ]
    record["thumbnail"] = thumbnail_of(attempt.toolpath) if attempt.toolpath is not None else None
    return record
