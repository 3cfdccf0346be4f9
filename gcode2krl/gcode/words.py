"""Bytes to words: a compiled scanner that turns a piece of G-code text into columns.

A word is (letter, value, line). Things that are not words travel in the same stream so that their order is
kept: ``/`` (block delete), ``%`` (tape mark), ``(`` (a message comment; value = its number), ``!`` (something
cannot be read; value = number of the finding, ``extra`` = what was found) and a small letter (a word whose
value cannot be read). A line has at most one ``!`` of its characters; the words around it are still read, so
that later mistakes in the line are found too.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcode2krl import ascii_codes as ch
from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.gcode import findings as f

LINE_LIMIT = 4096
"""Longest line that is read, in bytes; a part program has none that long."""
MARK = ch.EXCLAMATION
"""Stands in the column of letters where something cannot be read."""
UNREAD_NUMBER = ch.CASE_BIT
"""Added to a letter whose value cannot be read: the small letter."""

_NOTHING, _LINE_NUMBER = -1, 0
"""Kinds of an item that makes no word: a comment; a line or program number. Other kinds are letters."""
_LETTER_BEFORE = -1
"""Instead of a letter: the one of the word before in the line has lost its value."""
_MOST_DIGITS, _MOST_DECIMALS = 15, 18
_TEN_TO = 10.0 ** np.arange(_MOST_DECIMALS + 1)


class Words(NamedTuple):
    """Columns of the words of a piece of text, and the spans of its message comments."""

    letter: NDArray[np.uint8]
    value: Floats
    extra: Floats
    line: Ints32
    message_span: Ints
    """(k, 2) start and end byte of each message comment."""
    most_decimals: int
    """Largest number of decimals behind X, Y or Z."""


def scan(text: NDArray[np.uint8], first_line: int) -> Words:
    """Scan whole lines of text, uint8 (b,); ``first_line`` is the file line of the first."""
    room = 2 * len(text) + 2  # a byte makes at most two words; pages never touched cost nothing
    letters = np.empty(room, dtype=np.uint8)
    values = np.empty(len(letters))
    lines = np.empty(len(letters), dtype=np.int32)
    extras = np.zeros(1024)  # only the first findings are ever shown
    spans = np.empty((int(np.count_nonzero(text == ch.PAREN_OPEN)), 2), dtype=np.int64)
    count, messages, decimals = _scan(text, first_line, letters, values, lines, extras, spans)
    return Words(letters[:count], values[:count], extras, lines[:count], spans[:messages], decimals)


@njit(cache=True)
def _blank(c):
    return c in (ch.SPACE, ch.TAB, ch.RETURN)


@njit(cache=True)
def _is_nothing(c):
    return _blank(c) or c == ch.END_OF_TAPE


@njit(cache=True)
def _is_digit(c):
    return c >= ch.DIGIT_0 and c <= ch.DIGIT_9


@njit(cache=True)
def _is_sign(c):
    return c == ch.MINUS or c == ch.PLUS


@njit(cache=True)
def _is_letter(c):
    """Tell whether a byte is a letter, small or capital."""
    return (c | ch.CASE_BIT) >= ch.SMALL_A and (c | ch.CASE_BIT) <= ch.SMALL_Z


@njit(cache=True)
def _is_message(text, i, end):
    """Tell whether a comment's content begins with MSG, as ``(MSG, …)`` does."""
    while i < end and (text[i] == ch.SPACE or text[i] == ch.TAB):
        i += 1
    if i + 3 > end:
        return False
    m, s, g = text[i] | ch.CASE_BIT, text[i + 1] | ch.CASE_BIT, text[i + 2] | ch.CASE_BIT
    return m == ch.SMALL_M and s == ch.SMALL_S and g == ch.SMALL_G


@njit(cache=True)
def _is_function(text, i):
    """Tell whether a function with its argument stands at ``i``, as in ``XABS[#1]``."""
    letters = 0
    while i < len(text) and _is_letter(text[i]):
        letters += 1
        i += 1
    return letters > 1 and i < len(text) and text[i] == ch.BRACKET_OPEN


@njit(cache=True)
def _after_bracket(text, i, end):
    """Return the place behind the bracket expression that opens at ``i``."""
    depth = 0
    while i < end:
        if text[i] == ch.BRACKET_OPEN:
            depth += 1
        elif text[i] == ch.BRACKET_CLOSE:
            depth -= 1
            if depth == 0:
                return i + 1
        i += 1
    return end


@njit(cache=True)
def _opens_bracket(text, i, end):
    """Tell whether ``[``, or the ``/[`` of ATAN, stands at ``i``."""
    if text[i] == ch.SLASH and i + 1 < end:
        return text[i + 1] == ch.BRACKET_OPEN
    return text[i] == ch.BRACKET_OPEN


@njit(cache=True)
def _precedes_value(c):
    return _blank(c) or _is_sign(c) or c == ch.HASH


@njit(cache=True)
def _after_value(text, i, end):
    """Return the place behind a number, parameter, function or bracket expression that begins at ``i``."""
    while i < end and _precedes_value(text[i]):
        i += 1
    if i < end and text[i] == ch.LESS:  # <name>
        while i < end and text[i] != ch.GREATER:
            i += 1
        return min(i + 1, end)
    while i < end and _is_letter(text[i]):  # a function: its name, its argument
        i += 1
    while i < end and (text[i] == ch.POINT or _is_digit(text[i])):
        i += 1
    while i < end and _opens_bracket(text, i, end):
        i = _after_bracket(text, i + (text[i] == ch.SLASH), end)
    return i


@njit(cache=True)
def _is_line_number(text, i, end):
    """Tell whether N is followed by digits, or digits.digits: what LinuxCNC reads as a line number."""
    before, behind, point = 0, 0, False
    for k in range(i, end):
        c = text[k]
        if _is_sign(c):
            return False
        if c == ch.POINT:
            point = True
        elif not _blank(c):
            before += not point
            behind += point
    return before > 0 and (behind > 0 or not point)


@njit(cache=True)
def _lost_letter(lost, letters, lines, count, line):
    """Return the letter whose value is lost, that of the word before for `_LETTER_BEFORE`; 0 = none."""
    if lost != _LETTER_BEFORE:
        return lost
    if count == 0 or lines[count - 1] != line:
        return 0
    letter = letters[count - 1]
    return letter if letter >= ch.LETTER_A and letter <= ch.LETTER_Z else 0


@njit(cache=True)
def _line_end(text, i):
    while i < len(text) and text[i] != ch.NEWLINE:
        i += 1
    return i


@njit(cache=True)
def _without_number(text, i, letter):
    """Return (finding, letter whose value is lost, place behind) of a letter with no number behind it."""
    if letter == ch.LETTER_O:
        return f.O_WORD, letter, _line_end(text, i)
    if letter == ch.LETTER_N:
        return f.BAD_LINE_NUMBER, 0, i
    if i < len(text) and (text[i] == ch.HASH or text[i] == ch.BRACKET_OPEN or _is_function(text, i)):
        return f.EXPRESSION, letter, _after_value(text, i, _line_end(text, i))
    if i < len(text) and text[i] >= ch.FIRST_FOREIGN:
        return f.BAD_CHARACTER, letter, i
    return f.NO_NUMBER, letter, i


@njit(cache=True)
def _character(text, i):
    """Return the code point of the UTF-8 character at ``i``, the byte itself where it is none."""
    first = text[i]
    more = 1 if first >= 0xC2 and first < 0xE0 else 2 if first >= 0xE0 and first < 0xF0 else 3
    if first < 0xC2 or first > 0xF4 or i + more >= len(text):
        return int(first)
    code = int(first) & (0x3F >> more)
    for k in range(i + 1, i + 1 + more):
        if text[k] & 0xC0 != 0x80:
            return int(first)
        code = (code << 6) | (int(text[k]) & 0x3F)
    return code


@njit(cache=True)
def _after_assignment(text, i):
    """Return the place behind ``#1 = value`` or a lone parameter."""
    end = _line_end(text, i)
    i = _after_value(text, i, end)
    while i < end and _blank(text[i]):
        i += 1
    if i < end and text[i] == ch.EQUALS:
        i = _after_value(text, i + 1, end)
    return i


@njit(cache=True)
def _after_comment(text, i):
    """Return (finding, place behind) of the comment ``( )`` that opens at ``i``."""
    n = len(text)
    end = i + 1
    while end < n and text[end] not in (ch.PAREN_OPEN, ch.PAREN_CLOSE, ch.NEWLINE):
        end += 1
    if end < n and text[end] == ch.PAREN_CLOSE:
        return f.OK, end + 1
    if end >= n or text[end] == ch.NEWLINE:
        return f.COMMENT_OPEN, end
    depth = 1
    while end < n and text[end] != ch.NEWLINE and depth > 0:
        depth += 1 if text[end] == ch.PAREN_OPEN else (-1 if text[end] == ch.PAREN_CLOSE else 0)
        end += 1
    return f.COMMENT_NESTED, end


@njit(cache=True, inline="always")  # as a call it takes as long as the number itself
def _number(text, i):
    """Return (finding, value, digits, decimals, True for a plain whole number, place behind) from ``i`` on.

    Blanks inside a number mean nothing; digits beyond what a float holds are dropped behind the point.
    """
    finding = f.OK
    sign, mantissa = 1.0, 0.0
    digits, significant, decimals = 0, 0, 0
    point, started = False, False
    n = len(text)
    while i < n:
        c = text[i]
        if _is_digit(c):
            started = True
            digits += 1
            if significant > 0 or c != ch.DIGIT_0:
                significant += 1
            if significant <= _MOST_DIGITS:
                mantissa = mantissa * 10.0 + (c - ch.DIGIT_0)
                decimals += point
            elif not point:
                finding = f.NUMBER_TOO_LONG
        elif c == ch.POINT and not point:
            point, started = True, True
        elif _is_sign(c) and not started:
            started = True
            if c == ch.MINUS:
                sign = -1.0
        elif c not in (ch.SPACE, ch.TAB):
            break
        i += 1
    decimals = min(decimals, _MOST_DECIMALS)
    return finding, sign * mantissa / _TEN_TO[decimals], digits, decimals, not point and sign > 0.0, i


@njit(cache=True)
def _program_number(text, i, may_be_one):
    """Return the item of O and its number, which ends at ``i``: alone in its line it says nothing."""
    while i < len(text) and _blank(text[i]):
        i += 1
    alone = i >= len(text) or text[i] in (ch.NEWLINE, ch.PAREN_OPEN, ch.SEMICOLON)
    if may_be_one and alone:
        return _LINE_NUMBER, f.OK, 0.0, 0, i
    return MARK, f.O_WORD, float(ch.LETTER_O), ch.LETTER_O, _line_end(text, i)


@njit(cache=True)
def _is_plain(letter, finding, digits):
    """Tell whether a letter and the number behind it are a word: the bulk of a file."""
    return digits > 0 and finding == f.OK and letter != ch.LETTER_N and letter != ch.LETTER_O


@njit(cache=True)
def _odd_word(text, i, letter, finding, digits, end, first, may_be_program):
    """Return the item, see `_item`, of the letter at ``i`` that makes no plain word.

    ``finding``, ``digits`` and ``end`` are of the number behind it.
    """
    if digits == 0:
        finding, lost, behind = _without_number(text, end, letter)
        what = _character(text, end) if finding == f.BAD_CHARACTER else letter
        return MARK, finding, float(what), lost, behind
    if finding != f.OK:
        return MARK, finding, float(letter), letter, end
    if letter == ch.LETTER_O:
        return _program_number(text, end, may_be_program)
    if not first:
        return MARK, f.N_NOT_FIRST, float(letter), 0, end
    if not _is_line_number(text, i + 1, end):
        return MARK, f.BAD_LINE_NUMBER, float(letter), 0, end
    return _LINE_NUMBER, f.OK, 0.0, 0, end


@njit(cache=True)
def _comment(text, i):
    """Return the item, see `_item`, of the comment ``( )`` that opens at ``i``."""
    finding, end = _after_comment(text, i)
    if finding != f.OK:
        return MARK, finding, float(ch.PAREN_OPEN), 0, end
    return (ch.PAREN_OPEN if _is_message(text, i + 1, end - 1) else _NOTHING), f.OK, 0.0, 0, end


@njit(cache=True)
def _item(text, i, first):
    """Read what stands at ``i`` and is no letter; ``first`` is True where the line has no word before.

    Returns (kind, finding, what was found, letter whose value is lost, place behind). The kind is what goes
    into the column of letters, or `_NOTHING` or `_LINE_NUMBER`.
    """
    c = text[i]
    if c == ch.SEMICOLON:
        return _NOTHING, f.OK, 0.0, 0, _line_end(text, i)
    if c == ch.PAREN_OPEN:
        return _comment(text, i)
    if c == ch.PERCENT or (c == ch.SLASH and first):
        return int(c), f.OK, 0.0, 0, i + 1
    if c == ch.HASH:  # #1 = value: an assignment; what is no assignment is a lone parameter
        return MARK, f.EXPRESSION, float(c), 0, _after_assignment(text, i)
    if c in (ch.BRACKET_OPEN, ch.BRACKET_CLOSE, ch.EQUALS):
        return MARK, f.EXPRESSION, float(c), _LETTER_BEFORE, i + 1
    return MARK, f.BAD_CHARACTER, float(_character(text, i)), _LETTER_BEFORE, i + 1


@njit(cache=True)
def _put(letters, values, lines, count, letter, value, line):
    """Write a word; return the number of words."""
    letters[count], values[count], lines[count] = letter, value, line
    return count + 1


@njit(cache=True)
def _mark(letters, values, lines, extras, count, marks, finding, found, line):
    """Write a mark, and what was found while there is room; return the numbers of words and of marks."""
    if marks < len(extras):
        extras[marks] = found
    return _put(letters, values, lines, count, MARK, finding, line), marks + 1


@njit(cache=True)
def _put_lost(letters, values, lines, count, lost, line):
    """Write a letter whose value is lost, if any; return the number of words."""
    if lost > 0:
        return _put(letters, values, lines, count, lost + UNREAD_NUMBER, 0.0, line)
    return count


@njit(cache=True, nogil=True)
def _scan(text, first_line, letters, values, lines, extras, spans):
    """Fill the columns from whole lines; return (words, messages, most decimals of X, Y, Z)."""
    count, marks, messages, most_decimals = 0, 0, 0, 0
    line, line_start, marked_line = first_line, 0, 0
    first = True
    i, n = 0, len(text)
    while i < n:
        c = text[i]
        if c == ch.NEWLINE:
            if i - line_start > LINE_LIMIT:
                count, marks = _mark(
                    letters, values, lines, extras, count, marks, f.LINE_TOO_LONG, LINE_LIMIT, line
                )
            i += 1
            line += 1
            line_start = i
            first = True
            continue
        if _is_nothing(c):
            i += 1
            continue
        start = i
        if _is_letter(c):
            letter = c & ~ch.CASE_BIT
            finding, value, digits, decimals, plain, end = _number(text, i + 1)
            if _is_plain(letter, finding, digits):
                count = _put(letters, values, lines, count, letter, value, line)
                if letter >= ch.LETTER_X:
                    most_decimals = max(most_decimals, decimals)
                i = end
                first = False
                continue
            may_be_program = first and plain
            kind, finding, found, lost, i = _odd_word(
                text, i, letter, finding, digits, end, first, may_be_program
            )
        else:
            kind, finding, found, lost, i = _item(text, i, first)
        if kind == MARK:
            lost = _lost_letter(lost, letters, lines, count, line)
            if marked_line != line:
                count, marks = _mark(letters, values, lines, extras, count, marks, finding, found, line)
            marked_line = line
            count = _put_lost(letters, values, lines, count, lost, line)
        elif kind == ch.PAREN_OPEN:
            count = _put(letters, values, lines, count, kind, messages, line)
            spans[messages, 0], spans[messages, 1] = start + 1, i - 1
            messages += 1
        elif kind > _LINE_NUMBER:
            count = _put(letters, values, lines, count, kind, 0.0, line)
        first = first and kind != MARK and kind != _LINE_NUMBER
    return count, messages, most_decimals
