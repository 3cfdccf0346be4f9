"""What the compiled interpreter hands over beside rows: findings, consequences, notes and events."""

import numpy as np
from numba import njit

from gcode2krl.gcode import findings as f

EVENT = np.dtype([("row", "i8"), ("kind", "i4"), ("line", "i4"), ("a", "f8"), ("b", "f8"), ("dwell", "f8")])
FOUND = np.dtype([("number", "i4"), ("line", "i4"), ("a", "f8"), ("b", "f8"), ("c", "f8")])

ROWS, EVENTS, FINDINGS, MARKS, DROPPED, ROWS_BEFORE, CONSEQUENCES, MUTE = range(8)
"""Places in the interpreter's counts: rows in the buffer, events, findings, marks of the scanner used up,
findings that found no room, rows handed over before, findings that rest on an earlier one; ``MUTE`` is not 0
while a block is followed that has been reported already."""
COUNTS = 8


@njit(cache=True)
def report(found, counts, number, line, a, b, c=0.0):
    """Keep a finding, unless its block has been reported already."""
    if counts[MUTE]:
        return
    warning = number == f.TOOL_UNDECLARED or number == f.H_DIFFERS or number == f.OFFSET_UNKNOWN
    room = len(found) // 2 if warning else len(found)  # warnings never crowd out an error
    if counts[FINDINGS] < room:
        row = found[counts[FINDINGS]]
        row.number, row.line, row.a, row.b, row.c = number, line, a, b, c
        counts[FINDINGS] += 1
    else:
        counts[DROPPED] += 1


@njit(cache=True)
def rests_on_doubt(s, counts, doubt):
    """Tell whether what is found now rests on state in doubt; if so, count it as a consequence."""
    if s.doubt & doubt == 0:
        return False
    if not counts[MUTE]:
        counts[CONSEQUENCES] += 1
    return True


@njit(cache=True)
def report_unless(s, doubt, found, counts, number, line, a, b, c=0.0):
    """Keep a finding, unless it rests on state in doubt."""
    if not rests_on_doubt(s, counts, doubt):
        report(found, counts, number, line, a, b, c)


@njit(cache=True)
def note(s, which, line, word):
    """Count a block with something harmless; the first is kept with its line."""
    if s.note_count[which] == 0:
        s.note_line[which] = line
        s.note_word[which] = word
    s.note_count[which] += 1


@njit(cache=True)
def event(s, rows, events, counts, kind, line, a, b):
    """Keep an event at the row where the tool stands."""
    row = events[counts[EVENTS]]
    row.row, row.kind, row.line, row.a, row.b = counts[ROWS_BEFORE] + counts[ROWS] - 1, kind, line, a, b
    row.dwell = rows[counts[ROWS] - 1].dwell
    counts[EVENTS] += 1
