"""A program that is not understood: would another dialect read it? Found out by really reading it so."""

import re
from collections.abc import Callable
from dataclasses import replace

from gcode2krl.errors import Issue, NotUnderstoodError
from gcode2krl.gcode.dialects import DIALECTS, not_read
from gcode2krl.tables import Toolpath

_CONVERSATIONAL = re.compile(
    rb"\A[\s%]*\d*\s*BEGIN\s+PGM\b|^\s*\d*\s*(?:L|CC|C|CR)\s+[XY][+-]\d.*\bR[0LR]\b", re.M
)
_INCOMPLETE = {"consequences", "more"}
"""Findings that say that others are not listed."""
_OF_PROGRAMS = {
    *("expression", "expression-value", "parameter-number", "parameter-undefined", "parameter-read-only"),
    *("o-word", "subprogram-missing", "calls-too-deep", "endless-loop"),
}
"""Findings with which a program that computes stops: a dialect may never have reached the lines behind."""
_OF_TEXT = {"binary-file", "empty", "gzip-damaged", "line-ends", "file-unreadable", "dialect-unknown"}

Reread = Callable[[str], Toolpath]
"""Reads the program in a dialect."""


def refuse_other_languages(head: bytes, name: str) -> None:
    """Raise `NotUnderstoodError` with one sentence where its first lines are of another language."""
    if _CONVERSATIONAL.search(head):
        raise not_read("heidenhain", name)


def with_other_dialects(error: NotUnderstoodError, dialect: str, reread: Reread) -> NotUnderstoodError:
    """Return an error whose remedies name the dialects that read what is refused."""
    if all(issue.code in _OF_TEXT for issue in error.issues):
        return error
    found = {name: _wrong(reread, name) for name in DIALECTS if name != dialect}
    whole = [name for name, wrong in found.items() if not wrong]
    left = dict.fromkeys(whole, ()) | found  # those that read the whole program come first
    issues = [_with_dialects(issue, left) for issue in error.issues]
    if whole:
        names = " or ".join(f"--dialect {name}" for name in whole)
        what = f"the whole program can be read with {names}; it was read as {dialect}"
        remedy = "choose the dialect of the control that the post writes for"
        issues.append(Issue("note", "other-dialect", 0, what, remedy))
    return NotUnderstoodError(issues, error.source)


def _wrong(reread: Reread, name: str) -> tuple[Issue, ...]:
    """Return the errors of a program in a dialect, and what would hide some."""
    try:
        issues = reread(name).issues
    except NotUnderstoodError as error:
        return tuple(i for i in error.issues if i.severity == "error" or i.code in _INCOMPLETE)
    return tuple(issue for issue in issues if issue.code == "after-end")


def _with_dialects(issue: Issue, left: dict[str, tuple[Issue, ...]]) -> Issue:
    """Return a finding whose remedy names the first dialect in which its line is read."""
    if issue.severity != "error" or not issue.line:
        return issue
    for name, wrong in left.items():
        if wrong and issue.code in _OF_PROGRAMS:
            continue
        if any(other.code in _INCOMPLETE or other.line in (0, issue.line) for other in wrong):
            continue
        if any(other.code in _OF_PROGRAMS and other.line < issue.line for other in wrong):
            continue
        return replace(issue, remedy=f"{issue.remedy}; --dialect {name} reads this")
    return issue
