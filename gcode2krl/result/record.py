"""The record of a command, made from plain values; its keys are explained in ``docs/record.md``."""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from gcode2krl.errors import Issue
from gcode2krl.version import __version__

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
