"""``findings.sarif``, SARIF 2.1.0: each finding at its line, with the help of its code.

GitHub shows the results at the lines of a pull request. It refuses a file of more than 25,000 results.
"""

import json
import posixpath
import re
from collections.abc import Iterable, Iterator
from typing import Any
from urllib.parse import quote

from gcode2krl.batch.written.part import PartResult, Record, parts_of
from gcode2krl.batch.written.words import demonstration, printable
from gcode2krl.codes import Code, all_codes
from gcode2krl.errors import Issue
from gcode2krl.version import __version__

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
MOST_RESULTS = 20_000
_BASE = "%SRCROOT%"
_RANK = ("error", "warning", "note")

_Result = tuple[int, str, int, int, str, str]
"""Rank of the severity, path, line, column (0: not known), code, sentence: by these a finding is the
same as another."""


def findings_sarif(records: Iterable[Record], root: str = "") -> bytes:
    """Return the file; ``root`` is the absolute folder in which the run began."""
    parts = parts_of(records)
    results = sorted(set(_results(parts, root)))
    kept = results[:MOST_RESULTS]
    codes = sorted({code for *_, code, _ in kept})
    run = {
        "tool": {"driver": _driver(codes)},
        "invocations": [
            {"executionSuccessful": True} | _notified(demonstration(parts), len(results) - len(kept))
        ],
        "originalUriBaseIds": {_BASE: {"description": {"text": "The folder in which gcode2krl was run."}}},
        "columnKind": "unicodeCodePoints",
        "results": [_result(one, codes.index(one[4])) for one in kept],
    }
    log = {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}
    return (json.dumps(log, indent=1) + "\n").encode("ascii")


def _results(parts: Iterable[PartResult], root: str) -> Iterator[_Result]:
    """Yield all findings; one on a cell comes once, whatever number of parts has it."""
    for part in parts:
        path = below_root(part.source, root)
        for finding in part.findings:
            issue = finding.issue
            place = below_root(finding.file, root) if finding.file else path
            rank, code = _RANK.index(issue.severity), printable(issue.code)
            yield rank, place, issue.line, issue.column, code, _sentence(issue)


def _sentence(issue: Issue) -> str:
    advice = issue.advice()
    return printable(f"{issue.message} -> {advice}" if advice else issue.message) or issue.code


def _result(result: _Result, rule: int) -> dict[str, Any]:
    rank, path, line, column, code, sentence = result
    place = {"uri": uri(path)} if is_absolute(path) else {"uri": uri(path), "uriBaseId": _BASE}
    region = {"startLine": max(line, 1)}  # GitHub refuses a result without a line
    region |= {"startColumn": column} if line and column else {}
    return {
        "ruleId": code,
        "ruleIndex": rule,
        "level": _RANK[rank],
        "message": {"text": sentence},
        "locations": [{"physicalLocation": {"artifactLocation": place, "region": region}}],
    }


def _driver(codes: Iterable[str]) -> dict[str, Any]:
    known = all_codes()
    return {
        "name": "gcode2krl",
        "version": __version__,
        "semanticVersion": __version__,
        "rules": [_rule(known[code]) if code in known else {"id": code} for code in codes],
    }


def _rule(code: Code) -> dict[str, Any]:
    """Return a finding code as a rule."""
    first = code.why.partition(". ")[0].rstrip(".")
    more = {"Example": code.example, "What to do": code.remedy, "May be released by --allow": code.allow}
    return {
        "id": code.name,
        "name": "".join(word.capitalize() for word in code.name.split("-")),
        "shortDescription": {"text": f"{first}."},
        "fullDescription": {"text": code.why},
        "help": {
            "text": "\n".join([code.why, *(f"{name}: {text}" for name, text in more.items())]),
            "markdown": "\n\n".join([code.why, *(f"**{name}:** {text}" for name, text in more.items())]),
        },
        "defaultConfiguration": {"level": code.severity.partition(",")[0]},
    }


def _notified(warning: str, left_out: int) -> dict[str, Any]:
    """Return what is to be said of the run: whose cell it was, and that findings are left out."""
    notified = [("warning", warning)] if warning else []
    if left_out:
        text = f"{left_out:,} more findings are in results.jsonl and not here, the least severe ones."
        notified.append(("note", text))
    if not notified:
        return {}
    notes = [{"level": level, "message": {"text": text}} for level, text in notified]
    return {"toolExecutionNotifications": notes}


# where a file is, as a URI ----------------------------------------------------------------------------------


_DRIVE = re.compile(r"[A-Za-z]:/")


def below_root(path: str, root: str = "") -> str:
    """Return a path with slashes, relative to an absolute folder where it is below it."""
    plain = posixpath.normpath(path.replace("\\", "/"))
    above = posixpath.normpath(root.replace("\\", "/")).rstrip("/") if root else ""
    if root and is_absolute(plain) and plain.startswith(f"{above}/"):
        return plain[len(above) + 1 :]
    return plain


def is_absolute(path: str) -> bool:
    """Tell whether a path with slashes begins at a root or a drive."""
    return path.startswith("/") or _DRIVE.match(path) is not None


def uri(path: str) -> str:
    """Return a path with slashes as a relative reference, or as a ``file:`` URI where it is absolute."""
    if not is_absolute(path):
        return quoted(path)
    drive = "" if path.startswith("/") else "/"
    return f"file://{drive}{quoted(path, safe='/:')}"


def quoted(path: str, safe: str = "/") -> str:
    """Return a path as it stands in a URI; a name that is no UTF-8 keeps its bytes."""
    try:
        return quote(path.encode("utf-8", "surrogateescape"), safe)
    except UnicodeEncodeError:
        return quote(path.encode("utf-8", "replace"), safe)
