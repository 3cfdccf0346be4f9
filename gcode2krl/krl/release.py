"""Which findings keep a program from being written, and what a person may release by hand."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import PurePath

from gcode2krl.errors import Issue, RefusedError, Severity, input_error

STRICTER_HERE = frozenset(
    {
        "h-differs",
        "work-offset-unknown",
        "unit-doubtful",
        "cut-off",
        "offset-from-unknown",
        "other-dialect",
        "parameter-unset",
        "start-unnamed",
        "tool-length-differs",
        "tool-not-changed",
    }
)
"""Warnings of reading and predicting that are errors in a program for a robot."""
_RELEASE = re.compile(r"(?P<code>[a-z0-9-]+)(?::(?:(?P<file>[^\x00-\x1f:]+):)?(?P<line>[0-9]{1,9}))?")
_REMEDY = "use CODE:LINE as printed, CODE:FILE:LINE in a subprogram's file, or CODE for all of a kind"
Place = tuple[str, int]
"""Name of a subprogram's file, empty for the program's own, and the line in it; 0 is the whole file."""
NEVER_RELEASED = frozenset(
    {
        "out-of-reach",
        "undefined-position",
        "offset-from-unknown",
        "tool-unknown",
        "tool-missing",
        "tool-lies",
        "no-clearance",
        "no-feed",
        "signal-twice",
        "template",
        "cell-missing",
        "collision",
        "online-nothing",
        "online-tool",
        "online-home",
        "kss-iiqka",
    }
)
"""Without these a program would have no meaning, or the robot would break something."""


def released(issues: Iterable[Issue], allow: Sequence[str], strict: bool = False) -> tuple[Issue, ...]:
    """Return the findings with those released by hand turned into warnings.

    ``CODE:LINE`` releases the findings of a line, ``CODE:FILE:LINE`` those of a line in a subprogram's file,
    ``CODE`` all of a kind, wherever they are. ``strict`` refuses warnings too.

    Raises
    ------
    RefusedError
        Where errors remain; it carries all findings.
    NotUnderstoodError
        Where a release has no such form, matches nothing, or may not be given.
    """
    findings = with_releases(_as_written(issues), allow)
    refusing = ("error", "warning") if strict else ("error",)
    if any(issue.severity in refusing for issue in findings):
        raise RefusedError(sorted(findings, key=lambda issue: (issue.severity != "error", issue.line)))
    return tuple(findings)


def with_releases(issues: Iterable[Issue], allow: Sequence[str]) -> list[Issue]:
    """Return the findings, in their order, with those released by hand turned into warnings.

    Forms of a release and `NotUnderstoodError` as in `released`; what stays an error refuses nothing here.
    """
    findings = list(issues)
    as_written = _as_written(findings)
    for word in allow:
        matches = _matches(as_written, word)
        if not matches:
            raise input_error("allow", f"--allow {word}: no such finding", _REMEDY)
        first = as_written[matches[0]]
        if first.code in NEVER_RELEASED:
            raise input_error("allow", f"--allow {word}: {first.code} cannot be released", first.remedy)
        for k in matches:
            message = f"{as_written[k].message} (released by hand)"
            findings[k] = replace(as_written[k], severity="warning", message=message)
    return findings


def matching(issues: Iterable[Issue], allow: Sequence[str]) -> tuple[str, ...]:
    """Return the releases that match an error so far; later stages may find what the others mean."""
    as_written = _as_written(issues)
    return tuple(word for word in allow if _matches(as_written, word))


def is_refusing(issues: Iterable[Issue], allow: Iterable[str]) -> bool:
    """Tell whether an error stays that no release means."""
    findings = list(issues)
    meant = {k for word in allow for k in _matches(findings, word)}
    return any(issue.severity == "error" and k not in meant for k, issue in enumerate(findings))


def released_again(issues: Iterable[Issue], releases: Mapping[str, int | None]) -> list[Issue]:
    """Return the findings as they count for a program, with those of earlier releases turned into warnings.

    ``releases`` says for how many findings each was given, None for any number: where there are more now, a
    person has not seen them all, and none is released.
    """
    as_written = _as_written(issues)
    findings = list(as_written)
    for word, count in releases.items():
        matches = _matches(as_written, word)
        too_many = count is not None and len(matches) > count
        for k in matches:
            if as_written[k].code in NEVER_RELEASED:
                continue
            words = (
                f"released by hand were {count}, now there are {len(matches)}"
                if too_many
                else "released by hand"
            )
            severity: Severity = "error" if too_many else "warning"
            findings[k] = replace(
                as_written[k], severity=severity, message=f"{as_written[k].message} ({words})"
            )
    return findings


def header_words(issues: Iterable[Issue], allow: Sequence[str]) -> tuple[str, ...]:
    """Return what the program's header says of releases: those of a whole file with their number."""
    as_written = _as_written(issues)
    return tuple(
        word if ":" in word else f"{word} (whole file, {len(_matches(as_written, word))})" for word in allow
    )


def _as_written(issues: Iterable[Issue]) -> list[Issue]:
    """Return the findings as they count for a program for a robot."""
    return [replace(issue, severity="error") if issue.code in STRICTER_HERE else issue for issue in issues]


def _matches(findings: Sequence[Issue], word: str) -> list[int]:
    """Return the errors (rows) that a release means."""
    code, place = _parse(word)
    return [
        k
        for k, issue in enumerate(findings)
        if issue.severity == "error" and issue.code == code and place in (None, *_places(issue))
    ]


def _places(issue: Issue) -> tuple[Place, ...]:
    """Return how a release may name the place of a finding."""
    key = ("", issue.line)
    return ((PurePath(issue.file).name, issue.file_line), key) if issue.file else (key,)


def _parse(word: str) -> tuple[str, Place | None]:
    """Return code and place of a release; none means everywhere."""
    match = _RELEASE.fullmatch(word)
    if match is None:
        raise input_error("allow", f"--allow {word}: not of the form CODE:LINE or CODE", _REMEDY)
    return match["code"], None if match["line"] is None else (match["file"] or "", int(match["line"]))
