"""What a program's own offsets do to the part: one finding for each way of setting them, and what is left."""

from collections.abc import Iterator
from typing import Any

from gcode2krl.errors import Issue, Severity
from gcode2krl.gcode.state import NOTE_LOCAL, NOTE_SHIFT, NOTE_TABLE

Record = Any
"""A numpy record; numpy does not type its fields."""

_SENTENCES: dict[int, tuple[Severity, str, str]] = {
    NOTE_LOCAL: ("note", "{code} moves the zero{by}{more}", "nothing to do if the part lies there"),
    NOTE_SHIFT: (
        "warning",
        "G92 moves the zero{by}{more}",
        "check that the part lies there; a zero of the cell stands in [work_offsets]",
    ),
    NOTE_TABLE: (
        "warning",
        "G10 sets a work offset of its own, moved{by}{more}",
        "check that the part lies there; a zero of the cell stands in [work_offsets]",
    ),
}


def zero_issues(state: Record) -> Iterator[Issue]:
    """Yield where the program moves its zero, and that a shift is in force at its end."""
    for which, (severity, sentence, remedy) in _SENTENCES.items():
        count, line = int(state["note_count"][which]), int(state["note_line"][which])
        if count:
            first = 3 * (which - NOTE_LOCAL)
            by = _by(state["moved_mm"][first : first + 3])
            more = f"; {count} blocks move it" if count > 1 else ""
            what = sentence.format(code=_code(state), by=by, more=more)
            yield Issue(severity, "program-offset", line, what, remedy)
    if any(state["shift_mm"]):
        is_trans = _code(state) == "TRANS"
        what = f"the shift{_by(state['shift_mm'])} is in force at the end"
        yield Issue(
            "note",
            "offset-left",
            int(state["shift_line"]),
            what if is_trans else f"{what}; LinuxCNC would keep it",
            f"write {'TRANS' if is_trans else 'G92.1'} before the end; here the next program begins without",
        )


def _code(state: Record) -> str:
    """Return what shifts the zero: G52, which is its number in the state, or TRANS of a Sinumerik."""
    return "G52" if state["note_word"][NOTE_LOCAL] or not state["note_count"][NOTE_LOCAL] else "TRANS"


def _by(moved_mm: Any) -> str:
    """Return a move as `` by X10 Y-5 mm``; without one only the rotation changes."""
    words = [f"{letter}{value:g}" for letter, value in zip("XYZ", moved_mm.round(4), strict=True) if value]
    return f" by {' '.join(words)} mm" if words else " by a rotation"
