"""The words of one block, sorted: values by letter, G-codes by modal group, M-codes. Compiled."""

import numpy as np
from numba import njit

from gcode2krl import ascii_codes as ch
from gcode2krl.gcode import findings as f
from gcode2krl.gcode import vocabulary as v
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
from gcode2krl.gcode.words import MARK

NOTHING, GOOD, FAULTY = 0, 1, 2
"""A block to be left out, one that is understood, one that has been reported and is only followed."""
_CODE_SLACK = 1e-6
"""A code this far from a whole number is one that a post has rounded."""


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
    good = True
    used = False
    doubt = 0
    for k in range(i, j):
        c = letter[k]
        if c == ch.SLASH:
            if block_delete:
                _pass_marks(letter, i, j, counts)
                return NOTHING, 0
        elif c == ch.PERCENT:
            _tape_mark(letter, k, j, j - i == 1, s, counts, found, at)
            return NOTHING, 0
        elif c == ch.PAREN_OPEN:
            event(s, rows, events, counts, EVENT_TEXT, at, value[k], 0.0)
        elif c == MARK:
            what = extra[counts[MARKS]] if counts[MARKS] < len(extra) else 0.0
            counts[MARKS] += 1
            report(found, counts, int(value[k]), at, what, 0.0)
            good = False
        else:
            used = True
            fine, lost = _take(c, value[k], has, word, g_in_group, m_codes, counts, found, at)
            good = good and fine
            doubt |= lost
    if has[v.WORD_E] and good:  # else it belongs to what has been reported, as in M68 E0
        report(found, counts, f.UNKNOWN_LETTER, at, v.WORD_E + ch.LETTER_A, 0.0)
        good = False
    if not _rotary(s, has, word, found, counts, at):
        good = False
    if not used and good:
        return NOTHING, 0
    return (GOOD if good else FAULTY), doubt


@njit(cache=True)
def _tape_mark(letter, k, j, alone, s, counts, found, line):
    """Take note of ``%`` at word ``k``: the second ends the program, or the first behind any block."""
    if not alone:
        report(found, counts, f.BAD_CHARACTER, line, ch.PERCENT, 0.0)
        _pass_marks(letter, k, j, counts)
        return
    s.tape_marks += 1
    if s.tape_marks == 2 or (s.tape_marks == 1 and s.blocks > 0):
        s.ended = 1
        s.end_line = line


@njit(cache=True)
def _take(c, value, has, word, g_in_group, m_codes, counts, found, line):
    """Sort one word; return (True where it is understood, what is in doubt where it is not)."""
    if c >= ch.SMALL_A:  # a word whose value cannot be read
        return False, DOUBT_OF_LETTER[c - ch.SMALL_A]
    if c == ch.LETTER_G:
        return _take_g(value, g_in_group, counts, found, line)
    if c == ch.LETTER_M:
        return _take_m(value, m_codes, counts, found, line)
    index = c - ch.LETTER_A
    repeated = has[index]
    has[index] = True
    word[index] = value
    if repeated:
        report(found, counts, f.REPEATED_WORD, line, c, 0.0)
        return False, DOUBT_OF_LETTER[index]
    return True, np.int32(0)


@njit(cache=True)
def _take_g(value, g_in_group, counts, found, line):
    """Sort a G-code; see `_take`."""
    code = round(value * v.TENFOLD)
    if code >= 0 and code <= v.LARGEST_G and value * v.TENFOLD == code:
        group = GROUP_OF_G[code]
        if group >= 0 and g_in_group[group] < 0:
            g_in_group[group] = code
            return True, np.int32(0)
    finding, lost = _odd_g_code(value, g_in_group, found, counts, line)
    return finding == f.OK, lost


@njit(cache=True)
def _take_m(value, m_codes, counts, found, line):
    """Sort an M-code; see `_take`."""
    code = round(value)
    if abs(value - code) > _CODE_SLACK or code < 0 or code > v.LARGEST_M:
        report(found, counts, f.BAD_M, line, value, 0.0)
        return False, np.int32(0)
    if _is_unsupported_m(code):
        report(found, counts, f.UNSUPPORTED_M, line, code * v.TENFOLD, 0.0)
        return False, _doubt_of_m(code)
    count = 0
    while count < len(m_codes) and m_codes[count] >= 0:
        count += 1
    if count == len(m_codes):
        report(found, counts, f.TOO_MANY_M, line, 0.0, 0.0)
        return False, np.int32(0)
    group = _m_group(code)
    good = True
    for other in m_codes[:count]:
        if group > 0 and _m_group(other) == group:
            report(found, counts, f.SAME_GROUP_M, line, other * v.TENFOLD, code * v.TENFOLD)
            good = False
    m_codes[count] = code
    return good, np.int32(0)


@njit(cache=True)
def _is_unsupported_m(code):
    if code == v.M19 or code == v.M98 or code == v.M99:
        return True
    return code >= v.M61 and code <= v.M73


@njit(cache=True)
def _doubt_of_m(code):
    """Return what is in doubt after an M-code that is not read."""
    if code == v.M61:
        return np.int32(DOUBT_TOOL)
    if code >= v.M72:  # modal state restored, or a subprogram
        return np.int32(DOUBT_ALL)
    return np.int32(0)


@njit(cache=True)
def _pass_marks(letter, i, j, counts):
    """Use up the scanner's marks of a block that is left out."""
    for k in range(i, j):
        counts[MARKS] += letter[k] == MARK


@njit(cache=True)
def _odd_g_code(value, g_in_group, found, counts, line):
    """Look closer at a G-code that is not the first of a group; return (finding, what is then in doubt)."""
    code = round(value * v.TENFOLD)
    outside = code < 0 or code > v.LARGEST_G or abs(value * v.TENFOLD - code) > _CODE_SLACK
    if outside or GROUP_OF_G[code] == UNKNOWN_GROUP:
        report(found, counts, f.UNKNOWN_G, line, value * v.TENFOLD, 0.0)
        return f.UNKNOWN_G, DOUBT_OF_G[v.LARGEST_G]
    group = GROUP_OF_G[code]
    if group == UNSUPPORTED_GROUP:
        report(found, counts, f.UNSUPPORTED_G, line, code, 0.0)
        return f.UNSUPPORTED_G, DOUBT_OF_G[code]
    before = g_in_group[group]
    if group == v.MOTION and (before == v.G80 or (code == v.G80 and before >= 0)):
        g_in_group[group] = max(0, min(before, code))  # header lines say G0 … G80
    elif before >= 0:
        report(found, counts, f.SAME_GROUP_G, line, before, code)
        return f.SAME_GROUP_G, DOUBT_OF_GROUP[group]
    else:
        g_in_group[group] = code
    return f.OK, np.int32(0)


@njit(cache=True)
def _m_group(code):
    """Return the modal group of an M-code, 0 for none."""
    if code == v.M0 or code == v.M1 or code == v.M2 or code == v.M30 or code == v.M60:
        return v.M_STOP
    if code == v.M6:
        return v.M_TOOL_CHANGE
    if code >= v.M3 and code <= v.M5:
        return v.M_SPINDLE
    if code >= v.M7 and code <= v.M9:
        return v.M_COOLANT
    if code >= v.M48 and code <= v.M53:
        return v.M_OVERRIDE
    return 0


@njit(cache=True)
def _rotary(s, has, word, found, counts, line):
    """Rotary and secondary axes: 0 is no motion and is noted; the first other value of each is an error."""
    good = True
    for index in v.OTHER_AXES:
        if has[index] and word[index] == 0.0:
            note(s, NOTE_ROTARY, line, index + ch.LETTER_A)
        elif has[index]:
            good = False
            if s.rotary_refused & (1 << index):
                counts[CONSEQUENCES] += 1
            else:
                report(found, counts, f.ROTARY_WORD, line, index + ch.LETTER_A, word[index])
            s.rotary_refused |= 1 << index
    return good
