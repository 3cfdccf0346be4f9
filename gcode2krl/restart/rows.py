"""A Toolpath that begins at a later G-code line: which row that is, and what is in force there.

Nothing here asks the material; `restart.material` does, and says where the way down may begin.
"""

from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats, Ints
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.tables import Event, Restart, Toolpath
from gcode2krl.units import S_PER_MIN

ENTRY_MM_S = 1000.0 / S_PER_MIN
"""Fastest way down into a cut: assumed, slow enough to be stopped by hand."""
_M7, _M8 = 7, 8
_STOPS = (0, 1)
"""M0 and M1 wait for a person: a restart waits anyway."""


def begun_row(toolpath: Toolpath, line: int) -> int:
    """Return the row (of the Toolpath) that is the first of a G-code line.

    Raises `NotUnderstoodError` where the line moves nothing, stands behind the last that does, within a tool
    change, or runs more than once.
    """
    rows = _moving(toolpath)
    on_line = rows[toolpath.source_line[rows] == line]
    if not len(on_line):
        raise _without_motion(toolpath, rows, line)
    runs = 1 + np.count_nonzero(np.diff(on_line) > 1)
    if runs > 1:
        sentence = f"line {line} runs {runs} times: which run is meant is not known"
        raise _refused(toolpath, line, sentence, "begin at a line that runs once")
    row = int(on_line[0])
    if not _is_ready(toolpath, row):
        raise _refused(toolpath, line, _why_not(toolpath, row), _next_ready(toolpath, rows, row))
    return row


def _is_ready(toolpath: Toolpath, row: int) -> bool:
    """Tell whether a program can begin at a row: it leads to a position, and no tool change is pending."""
    return bool(toolpath.is_position()[row]) and pending_change(toolpath, row) is None


def _why_not(toolpath: Toolpath, row: int) -> str:
    line, change = int(toolpath.source_line[row]), pending_change(toolpath, row)
    if change is None:
        return f"line {line} leads to no position: not all of X, Y and Z are programmed there"
    of_change = f"the change to T{change.values['tool']} of line {change.values['line']}"
    return f"line {line} stands within {of_change}: its length or its position is not programmed yet"


def _next_ready(toolpath: Toolpath, rows: Ints, row: int) -> str:
    """Return the remedy that names the next line behind a row at which a program can begin."""
    lines = toolpath.source_line
    behind = (r for r in rows[rows > row].tolist() if lines[r] != lines[row] and _is_ready(toolpath, r))
    first = next(behind, None)
    if first is None:
        return "no line behind it can be one"
    return f"--from-line {int(lines[first])} is the next that has a motion of its own"


def pending_change(toolpath: Toolpath, row: int) -> Event | None:
    """Return the tool change that is not over at a row: tool in, but no position or not its length yet."""
    changes = [event for event in toolpath.events if event.kind == "tool" and event.row < row]
    if not changes:
        return None
    last = changes[-1]
    between = slice(last.row + 1, row + 1)
    if not toolpath.is_position()[between].any():
        return last
    tool = int(last.values["tool"])
    offset = toolpath.length_offset_tool
    takes_later = bool(((toolpath.tool[row:] == tool) & (offset[row:] == tool)).any())
    takes = bool((offset[between] == tool).any()) or not toolpath.rapid[between].all()
    return last if takes_later and not takes else None


def row_before(toolpath: Toolpath, row: int) -> int | None:
    """Return the first row of the G-code line whose move leads to a row, None where a tool was changed."""
    if not starts_at_known(toolpath, row):
        return None
    before = row - 1
    while before > 1 and toolpath.source_line[before - 1] == toolpath.source_line[row - 1]:
        before -= 1
    return before


def starts_at_known(toolpath: Toolpath, row: int) -> bool:
    """Tell whether the tool of a row stands, in front of it, at a position that a robot may be sent to."""
    changed = any(event.kind == "tool" and event.row == row - 1 for event in toolpath.events)  # another tip
    known = toolpath.is_position()[row - 1] and not toolpath.machine[row - 1]
    return row > 1 and bool(known) and not changed


def approached_row(toolpath: Toolpath, row: int) -> int:
    """Return the row whose end is the first position in the work: of a feed move its start, else its end."""
    return row - 1 if not toolpath.rapid[row] and starts_at_known(toolpath, row) else row


def begun_at(toolpath: Toolpath, row: int, restart: Restart, way_mm: Floats) -> Toolpath:
    """Return a Toolpath that goes on from a row, with what is in force there.

    Parameters
    ----------
    way_mm : (k, 3) the way to the first position, from above: rapids, but where it ends at the start of a
        feed move the last piece at that move's feed, `ENTRY_MM_S` at most.
    """
    count, is_start = len(way_mm), approached_row(toolpath, row) != row
    columns: dict[str, NDArray[Any]] = {}
    for spec in fields(toolpath):
        if "tail" in spec.metadata:
            columns[spec.name] = _begun(getattr(toolpath, spec.name), row, count)
    way = slice(1, count + 1)
    columns["position_mm"][way] = way_mm
    columns["rapid"][way], columns["feed_mm_s"][way] = True, np.inf
    if is_start:
        columns["rapid"][count], columns["feed_mm_s"][count] = False, min(toolpath.feed_mm_s[row], ENTRY_MM_S)
    if columns["axis"].strides[0]:
        columns["axis"][way] = toolpath.axis[approached_row(toolpath, row)]
    columns["known"][0], columns["known"][way] = False, True
    columns["exact_stop"][way], columns["tolerance_mm"][way] = True, np.nan
    columns["dwell_s"][: count + 1], columns["arc"][way], columns["machine"][way] = 0.0, -1, False
    in_force, left_out = _in_force(toolpath, row, 1 if count else 0)
    events = (e._replace(row=e.row - row + count + 1) for e in toolpath.events if e.row >= row)
    return Toolpath(
        **columns,
        events=(*in_force, *events),
        issues=(*toolpath.issues, *left_out),
        source=toolpath.source,
        restart=replace(restart, way_rows=count),
    )


def _begun(values: NDArray[Any], row: int, count: int) -> NDArray[Any]:
    """Return a column from a row on, behind row 0 and ``count`` copies of the row; a constant stays one."""
    if values.strides[0] == 0:
        return np.broadcast_to(values[0], (1 + count + len(values) - row, *values.shape[1:]))
    return np.concatenate([values[:1], np.repeat(values[row : row + 1], count, axis=0), values[row:]])


def state_words(toolpath: Toolpath) -> str:
    """Return what is in force where a Toolpath begins: ``T3, M3 S8000, M8``."""
    words = []
    for event in toolpath.events:
        if event.row > 1:
            break
        code = event.values.get("m", -1)
        if event.kind == "tool":
            words.append(f"T{event.values['tool']}")
        elif code >= 0:
            words.append(f"M{code}" + (f" S{abs(event.values['rpm']):g}" if event.kind == "spindle" else ""))
    return ", ".join(words)


def restart_record(toolpath: Toolpath) -> dict[str, Any]:
    """Return what ``--json`` says of a restart, empty where the program runs from its start."""
    restart = toolpath.restart
    if restart is None:
        return {}
    way_mm = toolpath.position_mm[1 : restart.way_rows + 1]
    record = {
        "line": restart.line,
        "begins_line": restart.begins_line,
        "in_force": state_words(toolpath),
        "way_mm": [[round(float(value), 3) for value in point] for point in way_mm],
    }
    return {"restart": record}


def _in_force(toolpath: Toolpath, row: int, above: int) -> tuple[list[Event], list[Issue]]:
    """Return the events that make what is in force before a row, and what is not repeated.

    The tool is changed at HOME, as at any start; the rest is switched at the row ``above``, over the work.
    """
    before = [event for event in toolpath.events if event.row < row]
    tool = [event._replace(row=0) for event in before if event.kind == "tool"][-1:]
    on = [*_spindle_on(before), *_coolant_on(before)]
    return [*tool, *(_at(event, above) for event in on)], list(_not_repeated(before))


def _spindle_on(before: list[Event]) -> list[Event]:
    last = [event for event in before if event.kind == "spindle"][-1:]
    return [event for event in last if event.values["rpm"] != 0.0]


def _coolant_on(before: list[Event]) -> list[Event]:
    """Return the last M7 and the last M8, each where it is still on."""
    coolant = [event for event in before if event.kind == "coolant"]
    on: list[Event] = []
    for key, code in (("mist", _M7), ("flood", _M8)):
        if coolant and coolant[-1].values[key]:
            on += [event for event in coolant if event.values["m"] == code][-1:]
    return on


def _at(event: Event, row: int) -> Event:
    return Event(row, event.kind, {key: v for key, v in event.values.items() if key != "dwell_s"})


def _not_repeated(before: list[Event]) -> Iterator[Issue]:
    lines = {event.values["m"]: event.values["line"] for event in before if event.kind == "message"}
    for code, line in lines.items():
        if code >= 0 and code not in _STOPS:
            sentence = f"M{code} of line {line}, before the restart, is not repeated"
            remedy = "do by hand what the rest needs of it"
            yield Issue("warning", "restart-not-repeated", line, sentence, remedy)


def _moving(toolpath: Toolpath) -> Ints:
    """Return the rows that move the tool in the work: not row 0, no machine moves."""
    moves = ~toolpath.machine
    moves[:1] = False
    return np.flatnonzero(moves)


def _without_motion(toolpath: Toolpath, rows: Ints, line: int) -> NotUnderstoodError:
    lines = toolpath.source_line[rows]
    if not len(rows) or line > int(lines.max()):
        last = int(lines.max(initial=0))
        sentence = f"line {line} stands behind the last line that moves the tool, {last}"
        return _refused(toolpath, line, sentence, f"--from-line {last} at most")
    on_line = toolpath.source_line == line
    what = "is a machine move (G28, G30, G53)" if toolpath.machine[on_line].any() else "moves nothing"
    first = int(np.flatnonzero(toolpath.source_line[1:] > line)[0])  # the row before the next line's
    return _refused(toolpath, line, f"line {line} {what}", _next_ready(toolpath, rows, first))


def _refused(toolpath: Toolpath, line: int, sentence: str, remedy: str) -> NotUnderstoodError:
    return input_error("restart-line", sentence, remedy, line=line, source=toolpath.source)
