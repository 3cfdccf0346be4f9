"""The record of a command, made from plain values; its keys are explained in ``docs/record.md``."""

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.errors import Issue
from gcode2krl.version import __version__

if TYPE_CHECKING:
    from gcode2krl.cell import Cell


_FILES_OF_A_CELL = ("mesh", "calibration")
"""Keys of a cell that name a file, whose content counts and not its place."""


def input_of(path: str | Path) -> dict[str, Any] | None:
    """Return file, SHA-256 and size of an input, None where it cannot be read.

    The hash of a folder is that of the lines ``<sha256>  <name>``, one a file, sorted by name: what
    ``sha256sum`` prints of them.
    """
    place = Path(path)
    try:
        if not place.is_dir():
            return {"file": str(path), "sha256": sha256_of(place), "size_bytes": place.stat().st_size}
        files = sorted((file.relative_to(place).as_posix(), file) for file in _files_below(place))
        lines = "".join(f"{sha256_of(file)}  {name}\n" for name, file in files)
        size_bytes = sum(file.stat().st_size for _, file in files)
    except (OSError, ValueError):
        return None
    return {"file": str(path), "sha256": _of_text(lines), "size_bytes": size_bytes}


def cell_of(cell: "Cell", path: str | Path | None) -> dict[str, Any]:
    """Return name, file and SHA-256 of a resolved cell: with its base, its models and its job.

    The hash is that of its values as JSON with sorted keys; a file that it names counts by its content.
    """
    values = _with_contents(cell.model_dump(mode="json"))
    text = json.dumps(values, sort_keys=True, separators=(",", ":"))
    file = None if path is None else str(path)
    return {"name": cell.name, "file": file, "sha256": _of_text(text)}


def hashes_of(files: Iterable[str | Path]) -> dict[str, str | None]:
    """Return file → SHA-256, None where a file cannot be read."""
    return {str(file): (input_of(file) or {}).get("sha256") for file in files}


def sha256_of(file: Path) -> str:
    """Return the SHA-256 of a file's content."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _of_text(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def _files_below(folder: Path) -> Iterator[Path]:
    return (file for file in folder.rglob("*") if file.is_file())


def _with_contents(value: Any) -> Any:
    """Return the values of a cell with the hash of each file in the place of its name."""
    if isinstance(value, list):
        return [_with_contents(entry) for entry in value]
    if not isinstance(value, dict):
        return value
    return {
        key: _content(entry) if key in _FILES_OF_A_CELL and isinstance(entry, str) else _with_contents(entry)
        for key, entry in value.items()
    }


def _content(name: str) -> str:
    content = input_of(name)
    return name if content is None else f"sha256:{content['sha256']}"


SCHEMA = "gcode2krl/result/1"
_COUNTED = {"error": "errors", "warning": "warnings", "note": "notes"}


def record_of(
    command: str,
    figures: Mapping[str, Any],
    issues: Iterable[Issue] = (),
    *,
    exit_code: int = 0,
    input: Mapping[str, Any] | None = None,
    cell: Mapping[str, Any] | None = None,
    options: Mapping[str, Any] | None = None,
    files: Mapping[str, str | None] | None = None,
    issues_file: str | None = None,
) -> dict[str, Any]:
    """Return the record: what went in, the exit code, the files, the figures, the findings.

    ``figures`` are the command's own keys, with their units in their names; ``input`` is made by
    `hashes.input_of`, ``cell`` by `hashes.cell_of`, ``files`` (name → SHA-256) by `hashes.hashes_of`.
    ``issues_file`` is the file that the findings are about if not the input: a cell, a job.
    """
    all_issues = tuple(issues)
    severities = Counter[str](issue.severity for issue in all_issues)
    hashes = dict(files or {})
    return {
        "schema": SCHEMA,
        "command": command,
        "version": __version__,
        "input": input,
        "cell": cell,
        "options": dict(options or {}),
        "exit_code": exit_code,
        "counts": {plural: severities[severity] for severity, plural in _COUNTED.items()},
        "files": list(hashes),
        "sha256": {name: content for name, content in hashes.items() if content is not None},
        **figures,
        "issues": issue_dicts(all_issues, issues_file),
    }


def issue_dicts(issues: Iterable[Issue], file: str | None = None) -> list[dict[str, Any]]:
    """Return findings as the objects of a record; ``file`` is what they are about if not the input."""
    return [_issue_dict(issue, issue.file or file) for issue in issues]


def _issue_dict(issue: Issue, file: str | None) -> dict[str, Any]:
    return {
        "severity": issue.severity,
        "code": issue.code,
        "line": issue.file_line or issue.line,
        **({"column": issue.column} if issue.column else {}),
        "message": issue.message,
        "remedy": issue.advice(),
        **({} if file is None else {"file": file}),
    }
