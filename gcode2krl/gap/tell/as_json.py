"""The JSON object of a diagnosis (docs/diagnose.md): the typed result, field by field."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from gcode2krl.errors import Issue
from gcode2krl.gap.choose.intervals import Interval

SCHEMA = "gcode2krl/gap/1"
_NAMES = {"source": "from"}
"""Names of the contract that Python keeps for itself."""
_LEFT_OUT_WHERE_NONE = frozenset({"offset_deg", "words", "rivals", "behind_nats", "moment"})
"""Keys that only some links and causes have; others are null where nothing is known."""


def gap_object(gap: Any) -> dict[str, Any]:
    """Return the object of a `Gap`, its keys in the order of the contract; what is not finite is None."""
    return {
        "schema": SCHEMA,
        "verdict": gap.verdict,
        "gap": plain(gap.gap),
        "at_part": plain(gap.at_part),
        "links": plain(gap.links),
        "where": plain(gap.where),
        "events": plain(gap.events),
        "causes": plain(gap.causes),
        "unexplained": _unexplained(gap.unexplained),
        "not_examined": plain(gap.not_examined),
        "observable": plain(gap.observable),
        "next_run": _next_run(gap.next_run),
        "runs": list(gap.runs),
        "notes": list(gap.notes),
        "issues": [_issue(issue) for issue in gap.issues],
    }


def _unexplained(unexplained: Any) -> dict[str, Any]:
    """Return what is left; a moment is ``t_s`` as in events, and ``at_time_s`` as it was first called."""
    told: dict[str, Any] = plain(unexplained)
    for each in told["depends_on"]:
        each["t_s"] = each["at_time_s"]
    return told


def _next_run(run: Any) -> dict[str, Any] | None:
    """Return the next run with its pairs of answers as lists; None where nothing is left to part."""
    if run is None:
        return None
    return {
        "program": run.program,
        "minutes": plain(run.minutes),
        "separates": [[each.first, each.second, plain(each.odds)] for each in run.separates],
        "expect": [{"if": each.answer, "then": each.shows} for each in run.expect],
    }


def plain(value: Any) -> Any:
    """Return a result without dataclasses and numpy types: dicts, lists, numbers, texts, None."""
    if isinstance(value, Interval):
        value = value._asdict()
    if is_dataclass(value):
        value = {_NAMES.get(name, name): each for name, each in _items(value) if not _is_left_out(name, each)}
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(each) for each in value]
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


def _items(result: Any) -> list[tuple[str, Any]]:
    return [(entry.name, getattr(result, entry.name)) for entry in fields(result)]


def _is_left_out(name: str, value: Any) -> bool:
    return value is None and name in _LEFT_OUT_WHERE_NONE


def _issue(issue: Issue) -> dict[str, Any]:
    return {
        "severity": issue.severity,
        "code": issue.code,
        "line": issue.line,
        "message": issue.message,
        "remedy": issue.remedy,
    }
