"""Findings as a table: severity, code, line, message, remedy."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from gcode2krl.errors import Issue, told
from gcode2krl.exchange.frame import Frame
from gcode2krl.exchange.html import block, paragraph, text_table

_SEVERITIES = ("error", "warning", "note")


class Findings(Frame, Sequence[Issue]):
    """The findings of a result in their order; also a table with a row a finding.

    >>> from gcode2krl import predict
    >>> findings = predict("part.nc").findings
    >>> findings.to_polars().filter(severity="note")["code"].to_list()[0]
    'cell-not-verified'
    """

    def __init__(self, issues: Iterable[Issue]) -> None:
        """Take the findings."""
        self._issues = tuple(issues)

    @overload
    def __getitem__(self, index: int) -> Issue: ...
    @overload
    def __getitem__(self, index: slice) -> "Findings": ...
    def __getitem__(self, index: int | slice) -> "Issue | Findings":
        return Findings(self._issues[index]) if isinstance(index, slice) else self._issues[index]

    def __len__(self) -> int:
        return len(self._issues)

    def __iter__(self) -> Iterator[Issue]:
        return iter(self._issues)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return ``severity``, ``code``, ``line`` (0 = the whole file), ``message`` and ``remedy`` (n,)."""
        texts = {
            "severity": [issue.severity for issue in self],
            "code": [issue.code for issue in self],
            "message": [issue.message for issue in self],
            "remedy": [issue.advice() for issue in self],
        }
        columns = {name: np.array(values, dtype=np.str_) for name, values in texts.items()}
        line = np.array([issue.line for issue in self], dtype=np.int32)
        return {
            "severity": columns["severity"],
            "code": columns["code"],
            "line": line,
            "message": columns["message"],
            "remedy": columns["remedy"],
        }

    def facts(self) -> str:
        """Return how many findings there are of each severity: ``2 warnings, 1 note``."""
        return counted(self._issues) or "none"

    def _repr_html_(self) -> str:
        return findings_block(self._issues)


def counted(issues: Iterable[Issue], severities: Sequence[str] = _SEVERITIES) -> str:
    """Return how many findings there are of each severity, the worst first; empty where there are none."""
    counts = Counter[str](issue.severity for issue in issues)
    return ", ".join(
        f"{counts[severity]} {severity}{'' if counts[severity] == 1 else 's'}"
        for severity in severities
        if counts[severity]
    )


def findings_block(issues: Iterable[Issue]) -> str:
    """Return findings as HTML: those that a command would print, and counts of the others."""
    printed = told(issues)
    if not printed.findings:
        return block("no findings")
    rows = [
        (
            finding.first.severity,
            finding.first.line or "",
            finding.first.message,
            finding.first.advice(),
            finding.first.code,
        )
        for finding in printed.findings
    ]
    table = text_table(("", "line", "finding", "remedy", "code"), rows)
    return block("findings", table, *map(paragraph, printed.counts()))
