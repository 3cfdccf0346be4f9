"""The files about a whole batch in its output folder, and what an earlier batch left there."""

import contextlib
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from gcode2krl.batch.written import contents, records_of
from gcode2krl.errors import input_error
from gcode2krl.files import write_together

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
