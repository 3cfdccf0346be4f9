"""Which findings keep a program from being written, and what a person may release by hand."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from gcode2krl.errors import Issue, RefusedError, input_error

STRICTER_HERE = frozenset({"h-differs", "work-offset-unknown", "unit-doubtful", "cut-off"})
"""Warnings of reading and predicting that are errors in a program for a robot."""
NEVER_RELEASED = frozenset(
    {
        "out-of-reach",
        "undefined-position",
        "tool-unknown",
        "tool-missing",
        "no-clearance",
        "no-feed",
        "template",
        "cell-missing",
        "online-nothing",
        "online-tool",
        "online-home",
    }
)
"""Without these a program would have no meaning."""


def released(issues: Iterable[Issue], allow: Sequence[str], strict: bool = False) -> tuple[Issue, ...]:
    """Return the findings with those released by ``CODE:LINE`` turned into warnings.

    ``strict`` refuses warnings too.

    Raises
    ------
    RefusedError
        Where errors remain; it carries all findings.
    NotUnderstoodError
        Where a release has no such form, matches nothing, or may not be given.
    """
    findings = [
        replace(issue, severity="error") if issue.code in STRICTER_HERE else issue for issue in issues
    ]
    for word in allow:
        code, line = _parse(word)
        matches = [
            k
            for k, issue in enumerate(findings)
            if issue.severity == "error" and issue.code == code and issue.line == line
        ]
        if not matches:
            raise input_error("allow", f"--allow {word}: no such finding", "use CODE:LINE as printed")
        if code in NEVER_RELEASED:
            raise input_error(
                "allow", f"--allow {word}: {code} cannot be released", findings[matches[0]].remedy
            )
        for k in matches:
            found = findings[k]
            findings[k] = replace(found, severity="warning", message=f"{found.message} (released by hand)")
    refusing = ("error", "warning") if strict else ("error",)
    if any(issue.severity in refusing for issue in findings):
        raise RefusedError(sorted(findings, key=lambda issue: (issue.severity != "error", issue.line)))
    return tuple(findings)


def _parse(word: str) -> tuple[str, int]:
    code, _, line = word.rpartition(":")
    if not code or not line.isdigit():
        raise input_error(
            "allow",
            f"--allow {word}: not of the form CODE:LINE",
            "use CODE:LINE as printed, LINE 0 for the whole file",
        )
    return code, int(line)
