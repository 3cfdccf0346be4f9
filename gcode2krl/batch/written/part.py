"""A part as the output files tell it: one line of ``results.jsonl``, read with care.

A record of an earlier run may come from another version or from a killed one, so what is missing or of
another kind is unknown, never an error.
"""

import contextlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from gcode2krl.batch import VERDICTS
from gcode2krl.errors import Issue, Told, told

Record = Mapping[str, Any]
"""A line of ``results.jsonl``: a record of schema ``gcode2krl/result/1`` with ``part``, ``seconds`` …"""
_SEVERITIES = ("error", "warning", "note")
_FEWEST_POINTS = 2
_PAGE = ".html"


@dataclass(frozen=True, slots=True)
class FileIssue:
    """A finding, and the file that it is about where that is not the program: the cell's."""

    issue: Issue
    file: str = ""


@dataclass(frozen=True, slots=True)
class PartResult:
    """What became of one part; a figure that is not known is None."""

    name: str
    """Its path below the folder of parts, with slashes."""
    verdict: str
    """One of `VERDICTS`."""
    source: str = ""
    """The file as it was named when the batch was started, its name where that is not known."""
    seconds: float | None = None
    """How long its translation took."""
    cached: bool = False
    time_s: float | None = None
    force_N: float | None = None
    deflection_mm: float | None = None
    findings: tuple[FileIssue, ...] = ()
    thumbnail: tuple[tuple[float, float], ...] = ()
    """Feed moves seen from above (mm)."""
    is_demonstration: bool = False
    """Whether it was translated for the demonstration cell, as no cell was named."""
    page: str = ""
    """Its report, relative to the output folder; empty where there is none."""

    @property
    def is_written(self) -> bool:
        """Whether a program was written."""
        return self.verdict == VERDICTS[0]

    @property
    def folder(self) -> str:
        """Its folder below that of the parts; "." at the top."""
        return self.name.rpartition("/")[0] or "."

    @property
    def file(self) -> str:
        """Its name without folder."""
        return self.name.rpartition("/")[2]

    def of_severity(self, *severities: str) -> tuple[FileIssue, ...]:
        """Return the findings of these severities."""
        return tuple(finding for finding in self.findings if finding.issue.severity in severities)

    def count(self, severity: str) -> int:
        """Return how many findings have this severity."""
        return len(self.of_severity(severity))

    def reasons(self) -> tuple[FileIssue, ...]:
        """Return what kept a part from being written: its errors, or else its warnings (``--strict``)."""
        if self.is_written:
            return ()
        return self.of_severity("error") or self.of_severity("warning")


def parts_of(records: Iterable[Record]) -> list[PartResult]:
    """Return the parts of records, by name; of several records of one part the last counts."""
    last = {part.name: part for part in map(part_of, records)}
    return [last[name] for name in sorted(last)]


def part_of(record: Record) -> PartResult:
    """Return the part of a record."""
    return PartResult(
        name=name_of(record),
        verdict=_verdict(record.get("exit_code")),
        source=_source(record),
        seconds=_number(record.get("seconds")),
        cached=record.get("cached") is True,
        time_s=_number(record.get("time_s")),
        force_N=_number(record.get("max_force_N")),
        deflection_mm=_number(record.get("max_deflection_mm")),
        findings=tuple(_finding(one) for one in _list(record.get("issues")) if isinstance(one, Mapping)),
        thumbnail=_points(record.get("thumbnail")),
        is_demonstration=_is_demonstration(record.get("cell")),
        page=next((str(file) for file in _list(record.get("files")) if str(file).endswith(_PAGE)), ""),
    )


def name_of(record: Record) -> str:
    """Return the part's name in a record."""
    return str(record.get("part") or "(no name)").replace("\\", "/")


def _source(record: Record) -> str:
    read = record.get("input")
    named = read.get("file") if isinstance(read, Mapping) else None
    return str(named).replace("\\", "/") if named else name_of(record)


def _is_demonstration(cell: Any) -> bool:
    return isinstance(cell, Mapping) and cell.get("file") is None


def told_of(findings: Iterable[FileIssue]) -> list[tuple[str, Told]]:
    """Return what to print of findings, as the command line does: (file, findings), "" for the program."""
    by_file: dict[str, list[Issue]] = {}
    for finding in findings:
        by_file.setdefault(finding.file, []).append(finding.issue)
    return [(file, told(issues)) for file, issues in by_file.items()]


def lines_of(findings: Iterable[FileIssue], source: str) -> list[str]:
    """Return the lines that the command line prints of findings on a file."""
    return [line for file, one in told_of(findings) for line in one.lines(file or source)]


def _verdict(exit_code: Any) -> str:
    return VERDICTS[exit_code] if exit_code in (0, 1) else VERDICTS[2]


def _number(value: Any) -> float | None:
    """Return a finite number, None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def _list(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else []


def _finding(stated: Mapping[str, Any]) -> FileIssue:
    severity = stated.get("severity")
    line = _number(stated.get("line")) or 0.0
    issue = Issue(
        severity=severity if severity in _SEVERITIES else "error",
        code=str(stated.get("code") or "unknown"),
        line=max(int(line), 0),
        message=str(stated.get("message") or ""),
        remedy=str(stated.get("remedy") or ""),
        column=max(int(_number(stated.get("column")) or 0), 0),
    )
    return FileIssue(issue, str(stated.get("file") or "").replace("\\", "/"))


def _points(stated: Any) -> tuple[tuple[float, float], ...]:
    """Return the points of a thumbnail, none where they are not at least two pairs of numbers."""
    points = []
    for pair in _list(stated):
        numbers = [_number(value) for value in _list(pair)]
        if len(numbers) != 2 or numbers[0] is None or numbers[1] is None:
            return ()
        points.append((numbers[0], numbers[1]))
    return tuple(points) if len(points) >= _FEWEST_POINTS else ()


# results.jsonl ----------------------------------------------------------------------------------------------


def results_jsonl(records: Iterable[Record]) -> bytes:
    """Return the lines: plain ASCII, keys in alphabetical order, null for what is not a finite number.

    Of several records of one part the last counts.
    """
    last = {name_of(record): record for record in records}
    return b"".join(_line(last[name]) for name in sorted(last))


def _line(record: Record) -> bytes:
    text = json.dumps(_finite(record), sort_keys=True, allow_nan=False)
    return text.encode("ascii") + b"\n"


def records_of(content: bytes) -> list[Record]:
    """Return the records of a ``results.jsonl``; a line that is no object is left out."""
    records: list[Record] = []
    for line in content.splitlines():
        with contextlib.suppress(ValueError):
            record = json.loads(line)
            if isinstance(record, dict):
                records.append(record)
    return records


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    return [_finite(one) for one in value] if isinstance(value, list | tuple) else value
