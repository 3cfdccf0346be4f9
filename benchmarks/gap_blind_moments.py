"""Whether an answer tells the moment of an event: its run, and its time to 20 ms."""

from collections.abc import Iterable, Iterator
from typing import Any

CLOSE_s = 0.02
TIMES = ("t_s", "at_s", "at_time_s")
"""Names of a moment in an answer, in a cause, its parameters or a dependence."""

Moment = tuple[str | None, float]
"""Run, None where the answer states none, and its time."""


def moment_hit(entries: Iterable[dict[str, Any]], result: dict[str, Any]) -> bool | None:
    """Tell whether a moment that the answer tells is a true one; None where the label has none.

    A moment within the event counts: from its begin to its end where it lasts.
    """
    true = [each for entry in entries for each in entry.get("moments") or ()]
    if not true:
        return None
    return any(_is_at(run, t_s, each) for run, t_s in told_moments(result) for each in true)


def _is_at(run: str | None, t_s: float, true: dict[str, Any]) -> bool:
    return run in (None, true["run"]) and abs(t_s - true["t_s"]) <= CLOSE_s + 0.5 * true.get("lasts_s", 0.0)


def told_moments(result: dict[str, Any]) -> Iterator[Moment]:
    """Yield the moments that an answer tells."""
    for cause in result["causes"]:
        yield from _moments(cause, cause.get("run"))
        yield from _moments(cause.get("parameters") or {}, cause.get("run"))
    for each in result["unexplained"].get("depends_on") or ():
        yield from _moments(each, each.get("run"))


def _moments(holder: dict[str, Any], run: str | None) -> Iterator[Moment]:
    for name in TIMES:
        value = holder.get(name)
        if isinstance(value, dict):
            value = value.get("value")
        if isinstance(value, int | float) and not isinstance(value, bool):
            yield run, float(value)
