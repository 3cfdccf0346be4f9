"""A program that has the marks of another control than that of the dialect: read in that one's dialect too.

The advice to choose a dialect is given for marks alone (`origin`), and says what the other reading found.
Where both read the program and mean the same, nothing is said.
"""

from collections.abc import Callable, Iterator

import numpy as np

from gcode2krl.errors import Issue, NotUnderstoodError
from gcode2krl.gcode.origin import Mark
from gcode2krl.tables import Toolpath

Reread = Callable[[str], Toolpath]
"""Reads the program in a dialect; raises `NotUnderstoodError`."""
_SAME_MM, _SAME = 1e-6, 1e-9
_COUNTS = {"consequences", "more"}
_POINTLESS = "decimal-point"
_TAKEN_ALIKE = "a dwell counted twice, or a part of its unit"
"""A Haas takes G4 P0.5 for half a second, as LinuxCNC does; no Fanuc takes it."""


def with_other_control(
    error: NotUnderstoodError, mark: Mark | None, dialect: str, reread: Reread
) -> NotUnderstoodError:
    """Return the findings of a refused program; one sentence stands for those that another dialect ends."""
    if mark is None or dialect in mark.control.dialects:
        return error
    other, remaining = _read_as(mark, reread)
    still = {(issue.code, issue.line) for issue in remaining}
    refusals = [issue for issue in error.issues if issue.severity == "error"]
    kept = [issue for issue in refusals if (issue.code, issue.line) in still]
    ended = len(refusals) - len(kept)
    if not ended:
        return error
    what = f"{_said(mark)}; it was read as {dialect}"
    listed = "; 1 finding of that reading is" if ended == 1 else f"; {ended} findings of that reading are"
    first = Issue(
        "error", "other-dialect", mark.line, what + listed + " not listed", _remedy(other, remaining)
    )
    notes = [issue for issue in error.issues if issue.severity != "error" and issue.code not in _COUNTS]
    return NotUnderstoodError([first, *kept, *notes], error.source)


def doubts_of_control(toolpath: Toolpath, mark: Mark | None, dialect: str, reread: Reread) -> Iterator[Issue]:
    """Yield a warning where a program is read, and the control whose marks it has means something else."""
    if mark is None or dialect in mark.control.dialects:
        return
    other, refused = _read_as(mark, reread)
    remaining = tuple(issue for issue in refused if _TAKEN_ALIKE not in issue.message)
    if refused and not remaining:
        return
    if remaining and all(issue.code == _POINTLESS for issue in remaining):
        first = remaining[0]
        what = f"{_said(mark)}, where {first.message.partition(': ')[0]}; it is read as {dialect} reads it"
        yield Issue("warning", _POINTLESS, first.line, what, _points_remedy(dialect))
        return
    difference = _first_refusal(remaining) if remaining else _difference(toolpath, reread(other))
    if difference is None:
        return
    line, what = difference
    remedy = f"--dialect {other}, and {remaining[0].remedy}" if remaining else _remedy(other, remaining)
    yield Issue(
        "warning",
        "other-dialect",
        line,
        f"{_said(mark)}, which does not mean here what {dialect} does: {what}",
        f"{remedy}; or --allow other-dialect, if the control that runs it reads as {dialect} does",
    )


def _read_as(mark: Mark, reread: Reread) -> tuple[str, tuple[Issue, ...]]:
    """Return the dialect for a mark, and the errors that remain in it.

    Of a Fanuc that is the one that asks for points, unless numbers without a point are all that it refuses
    and another takes them as they stand: then its refusals are those.
    """
    dialect = mark.control.dialects[0]
    remaining = _errors(dialect, reread)
    if any(issue.code == _POINTLESS for issue in remaining) and len(mark.control.dialects) > 1:
        calculator = mark.control.dialects[1]
        errors = _errors(calculator, reread)
        return calculator, errors or tuple(issue for issue in remaining if issue.code == _POINTLESS)
    return dialect, remaining


def _errors(dialect: str, reread: Reread) -> tuple[Issue, ...]:
    try:
        reread(dialect)
    except NotUnderstoodError as error:
        return tuple(issue for issue in error.issues if issue.severity == "error")
    return ()


def _said(mark: Mark) -> str:
    return f"{mark.text} (line {mark.line}) is a mark of {mark.control.title}"


def _remedy(dialect: str, remaining: tuple[Issue, ...]) -> str:
    if remaining and all(issue.code == _POINTLESS for issue in remaining):
        return (
            "--dialect fanuc-calculator where X100 is 100 mm on this control, fanuc-increments where it is "
            "0.1 mm"
        )
    if not remaining:
        return f"--dialect {dialect} reads it"
    line, what = _first_refusal(remaining)
    return f"--dialect {dialect}; what it then refuses stands in line {line}: {what}"


def _points_remedy(dialect: str) -> str:
    return (
        "let the post write points; --dialect fanuc-increments where X100 is 0.1 mm on this control "
        f"(--dialect {dialect} takes it for 100 mm)"
    )


def _first_refusal(remaining: tuple[Issue, ...]) -> tuple[int, str]:
    first = next((issue for issue in remaining if issue.line), remaining[0])
    return first.line, first.message


def _difference(here: Toolpath, there: Toolpath) -> tuple[int, str] | None:
    """Return line and sentence of the first row in which two readings differ, None where none does."""
    rows = min(len(here.position_mm), len(there.position_mm))
    a, b = slice(0, rows), slice(0, rows)
    columns = {
        "the tool goes elsewhere": np.any(
            np.abs(here.position_mm[a] - there.position_mm[b]) > _SAME_MM, axis=1
        ),
        "the move is another": here.rapid[a] != there.rapid[b],
        "the feed is another": ~np.isclose(here.feed_mm_s[a], there.feed_mm_s[b], rtol=_SAME),
        "the dwell is another": ~np.isclose(here.dwell_s[a], there.dwell_s[b], rtol=_SAME),
        "the spindle turns otherwise": ~np.isclose(here.spindle_rad_s[a], there.spindle_rad_s[b], rtol=_SAME),
        "the tool is another": here.tool[a] != there.tool[b],
    }
    places = {what: int(np.argmax(differs)) for what, differs in columns.items() if np.any(differs)}
    if places:
        what = min(places, key=lambda each: places[each])
        row = places[what]
        return int(here.source_line[row]), what + _figures(what, here, there, row)
    if len(here.position_mm) == len(there.position_mm):
        return None
    longer = here if len(here.position_mm) > rows else there
    return int(longer.source_line[rows]), "the moves from here on are others"


def _figures(what: str, here: Toolpath, there: Toolpath, row: int) -> str:
    if "dwell" in what:
        return f" ({there.dwell_s[row]:g} s there, {here.dwell_s[row]:g} s here)"
    if "elsewhere" not in what:
        return ""
    texts = (
        " ".join(f"{letter}{value:g}" for letter, value in zip("XYZ", path.position_mm[row], strict=True))
        for path in (there, here)
    )
    return " ({} there, {} here)".format(*texts)
