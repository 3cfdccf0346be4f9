"""The words of one block, sorted: values by letter, G-codes by modal group, M-codes. Compiled."""

import numpy as np
from numba import njit

from gcode2krl.gcode import findings as f
from gcode2krl.gcode.reporting import CONSEQUENCES, MARKS, event, note, report
from gcode2krl.gcode.state import (
    DOUBT_ALL,
    DOUBT_OF_G,
    DOUBT_OF_GROUP,
    DOUBT_OF_LETTER,
    DOUBT_TOOL,
    EVENT_TEXT,
    GROUP_OF_G,
    NOTE_ROTARY,
    UNKNOWN_GROUP,
    UNSUPPORTED_GROUP,
)

NOTHING, GOOD, FAULTY = 0, 1, 2
"""A block to be left out, one that is understood, one that has been reported and is only followed."""
OTHER_AXES = tuple(ord(c) - 65 for c in "ABCUVW")
IS_OTHER_AXIS = np.array([k in OTHER_AXES for k in range(26)])
_E = ord("E") - 65


@njit(cache=True)
def gather(words, i, j, s, rows, counts, events, found, block_delete, has, word, g_in_group, m_codes):
    """Sort words ``i`` to ``j`` into ``has``/``word``, ``g_in_group`` and ``m_codes``.

    Returns (`NOTHING`, `GOOD` or `FAULTY`, bits of what is in doubt after the block).
    """
    letter, value, extra, line = words
    at = line[i]
    has[:] = False
    g_in_group[:] = -1
    m_codes[:] = -1
    m_count = 0
    good = True
    used = False
    rotary = False
    doubt = 0
    for k in range(i, j):
        c = letter[k]
        if c == 47:  # /
            if block_delete:
                _pass_marks(letter, i, j, counts)
                return NOTHING, 0
        elif c == 37:  # %
            if j - i > 1:
                report(found, counts, f.BAD_CHARACTER, at, c, 0.0)
                _pass_marks(letter, k, j, counts)
                return NOTHING, 0
            s.tape_marks += 1
            if s.tape_marks == 2 or (s.tape_marks == 1 and s.blocks > 0):
                s.ended = 1
                s.end_line = at
            return NOTHING, 0
        elif c == 40:
            event(s, rows, events, counts, EVENT_TEXT, at, value[k], 0.0)
        elif c == 33:
            what = extra[counts[MARKS]] if counts[MARKS] < len(extra) else 0.0
            counts[MARKS] += 1
            report(found, counts, int(value[k]), at, what, 0.0)
            good = False
        elif c >= 97:  # a word whose value cannot be read
            doubt |= DOUBT_OF_LETTER[c - 97]
            good = False
            used = True
        elif c == 71:  # G
            code = round(value[k] * 10)
            used = True
            if code >= 0 and code <= 999 and value[k] * 10 == code:
                group = GROUP_OF_G[code]
                if group >= 0 and g_in_group[group] < 0:
                    g_in_group[group] = code
                    continue
            finding, lost = _odd_g_code(value[k], g_in_group, found, counts, at)
            doubt |= lost
            good = good and finding == f.OK
        elif c == 77:  # M
            code = round(value[k])
            used = True
            if abs(value[k] - code) > 1e-6 or code < 0 or code > 9999:
                report(found, counts, f.BAD_M, at, value[k], 0.0)
                good = False
            elif code == 19 or (code >= 61 and code <= 73) or code == 98 or code == 99:
                report(found, counts, f.UNSUPPORTED_M, at, code * 10, 0.0)
                if code == 61:
                    doubt |= DOUBT_TOOL
                elif code >= 72:  # modal state restored, or a subprogram
                    doubt |= DOUBT_ALL
                good = False
            elif m_count == 4:
                report(found, counts, f.TOO_MANY_M, at, 0.0, 0.0)
                good = False
            else:
                for other in m_codes[:m_count]:
                    if _m_group(other) == _m_group(code) and _m_group(code) > 0:
                        report(found, counts, f.SAME_GROUP_M, at, other * 10, code * 10)
                        good = False
                m_codes[m_count] = code
                m_count += 1
        else:
            index = c - 65
            if has[index]:
                report(found, counts, f.REPEATED_WORD, at, c, 0.0)
                doubt |= DOUBT_OF_LETTER[index]
                good = False
            has[index] = True
            word[index] = value[k]
            used = True
            rotary |= IS_OTHER_AXIS[index]
    if has[_E] and good:  # else it belongs to what has been reported, as in M68 E0
        report(found, counts, f.UNKNOWN_LETTER, at, _E + 65, 0.0)
        good = False
    if rotary and not _rotary(s, has, word, found, counts, at):
        good = False
    if not used and good:
        return NOTHING, 0
    return (GOOD if good else FAULTY), doubt


@njit(cache=True)
def _pass_marks(letter, i, j, counts):
    """Use up the scanner's marks of a block that is left out."""
    for k in range(i, j):
        counts[MARKS] += letter[k] == 33


@njit(cache=True)
def _odd_g_code(value, g_in_group, found, counts, line):
    """Look closer at a G-code that is not the first of a group; return (finding, what is then in doubt)."""
    code = round(value * 10)
    if code < 0 or code > 999 or abs(value * 10 - code) > 1e-6 or GROUP_OF_G[code] == UNKNOWN_GROUP:
        report(found, counts, f.UNKNOWN_G, line, value * 10, 0.0)
        return f.UNKNOWN_G, DOUBT_OF_G[999]
    group = GROUP_OF_G[code]
    if group == UNSUPPORTED_GROUP:
        report(found, counts, f.UNSUPPORTED_G, line, code, 0.0)
        return f.UNSUPPORTED_G, DOUBT_OF_G[code]
    before = g_in_group[group]
    if group == 1 and (before == 800 or (code == 800 and before >= 0)):
        g_in_group[group] = max(0, min(before, code))  # header lines say G0 … G80
    elif before >= 0:
        report(found, counts, f.SAME_GROUP_G, line, before, code)
        return f.SAME_GROUP_G, DOUBT_OF_GROUP[group]
    else:
        g_in_group[group] = code
    return f.OK, np.int32(0)


@njit(cache=True)
def _m_group(code):
    if code == 0 or code == 1 or code == 2 or code == 30 or code == 60:
        return 4
    if code == 6:
        return 6
    if code >= 3 and code <= 5:
        return 7
    if code >= 7 and code <= 9:
        return 8
    if code >= 48 and code <= 53:
        return 9
    return 0


@njit(cache=True)
def _rotary(s, has, word, found, counts, line):
    """Rotary and secondary axes: 0 is no motion and is noted; the first other value of each is an error."""
    good = True
    for index in OTHER_AXES:
        if has[index] and word[index] == 0.0:
            note(s, NOTE_ROTARY, line, index + 65)
        elif has[index]:
            good = False
            if s.rotary_refused & (1 << index):
                counts[CONSEQUENCES] += 1
            else:
                report(found, counts, f.ROTARY_WORD, line, index + 65, word[index])
            s.rotary_refused |= 1 << index
    return good
