"""Bytes to words: a compiled scanner that turns a piece of G-code text into columns.

A word is (letter, value, line). Things that are not words travel in the same stream so that their order is
kept: ``/`` (block delete), ``%`` (tape mark), ``(`` (a message comment; value = its number), ``!`` (something
cannot be read; value = number of the finding, ``extra`` = what was found) and a small letter (a word whose
value cannot be read). A line has at most one ``!`` of its characters; the words around it are still read, so
that what follows is judged by its own faults.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcode2krl.gcode import findings as f

LINE_LIMIT = 4096
"""Longest line that is read, in bytes; anything longer is not a part program."""

_SPACE, _TAB, _RETURN, _NEWLINE, _END_OF_TAPE = 32, 9, 13, 10, 26
_TEN_TO = 10.0 ** np.arange(19)


class Words(NamedTuple):
    """Columns of the words of a piece of text, and the spans of its message comments."""

    letter: NDArray[np.uint8]
    value: NDArray[np.float64]
    extra: NDArray[np.float64]
    line: NDArray[np.int32]
    message_span: NDArray[np.int64]
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
    spans = np.empty((int(np.count_nonzero(text == ord("("))), 2), dtype=np.int64)
    count, messages, decimals = _scan(text, first_line, letters, values, lines, extras, spans)
    return Words(letters[:count], values[:count], extras, lines[:count], spans[:messages], decimals)


@njit(cache=True)
def _is_message(text, i, end):
    """Tell whether a comment's content begins with MSG, as ``(MSG, …)`` does."""
    while i < end and (text[i] == 32 or text[i] == 9):
        i += 1
    if i + 3 > end:
        return False
    return (text[i] | 32) == 109 and (text[i + 1] | 32) == 115 and (text[i + 2] | 32) == 103


@njit(cache=True)
def _is_function(text, i):
    """Tell whether a function with its argument stands at ``i``, as in ``XABS[#1]``."""
    letters = 0
    while i < len(text) and (text[i] | 32) >= 97 and (text[i] | 32) <= 122:
        letters += 1
        i += 1
    return letters > 1 and i < len(text) and text[i] == 91


@njit(cache=True)
def _blank(c):
    return c in (_SPACE, _TAB, _RETURN)


@njit(cache=True)
def _after_bracket(text, i, end):
    """Return the place behind the bracket expression that opens at ``i``."""
    depth = 0
    while i < end:
        if text[i] == 91:
            depth += 1
        elif text[i] == 93:
            depth -= 1
            if depth == 0:
                return i + 1
        i += 1
    return end


@njit(cache=True)
def _after_value(text, i, end):
    """Return the place behind a number, parameter, function or bracket expression that begins at ``i``."""
    while i < end and (_blank(text[i]) or text[i] == 35 or text[i] == 43 or text[i] == 45):  # blanks # + -
        i += 1
    if i < end and text[i] == 60:  # <name>
        while i < end and text[i] != 62:
            i += 1
        return min(i + 1, end)
    while i < end and (text[i] | 32) >= 97 and (text[i] | 32) <= 122:  # a function: its name, its argument
        i += 1
    while i < end and (text[i] == 46 or (text[i] >= 48 and text[i] <= 57)):
        i += 1
    while i < end and (
        text[i] == 91 or (text[i] == 47 and i + 1 < end and text[i + 1] == 91)
    ):  # a/[b] of ATAN
        i = _after_bracket(text, i + (text[i] == 47), end)
    return i


@njit(cache=True)
def _is_line_number(text, i, end):
    """Tell whether N is followed by digits, or digits.digits: what LinuxCNC reads as a line number."""
    before, behind, point = 0, 0, False
    for k in range(i, end):
        c = text[k]
        if c == 43 or c == 45:
            return False
        if c == 46:
            point = True
        elif not _blank(c):
            before += not point
            behind += point
    return before > 0 and (behind > 0 or not point)


@njit(cache=True)
def _previous_letter(letters, lines, count, line):
    """Return the letter of the word before in the line, 0 = none."""
    if count == 0 or lines[count - 1] != line or letters[count - 1] < 65 or letters[count - 1] > 90:
        return 0
    return letters[count - 1]


@njit(cache=True)
def _line_end(text, i):
    while i < len(text) and text[i] != _NEWLINE:
        i += 1
    return i


@njit(cache=True)
def _without_number(text, i, letter):
    """Return (finding, letter whose value is lost, place behind) of a letter with no number behind it."""
    if letter == 79:
        return f.O_WORD, letter, i
    if letter == 78:
        return f.BAD_LINE_NUMBER, 0, i
    if i < len(text) and (text[i] == 35 or text[i] == 91 or _is_function(text, i)):
        return f.EXPRESSION, letter, _after_value(text, i, _line_end(text, i))
    if i < len(text) and text[i] >= f.FIRST_FOREIGN:
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
    if i < end and text[i] == 61:
        i = _after_value(text, i + 1, end)
    return i


@njit(cache=True)
def _after_comment(text, i):
    """Return (finding, place behind) of the comment ``( )`` that opens at ``i``."""
    n = len(text)
    end = i + 1
    while end < n and text[end] != 41 and text[end] != _NEWLINE and text[end] != 40:
        end += 1
    if end < n and text[end] == 41:
        return f.OK, end + 1
    if end >= n or text[end] == _NEWLINE:
        return f.COMMENT_OPEN, end
    depth = 1
    while end < n and text[end] != _NEWLINE and depth > 0:
        depth += 1 if text[end] == 40 else (-1 if text[end] == 41 else 0)
        end += 1
    return f.COMMENT_NESTED, end


@njit(cache=True, nogil=True)
def _scan(text, first_line, letters, values, lines, extras, spans):
    n = len(text)
    i = 0
    count = 0
    marks = 0
    messages = 0
    most_decimals = 0
    line = first_line
    line_start = 0
    words_in_line = 0
    marked_line = 0
    while i < n:
        c = text[i]
        if c in (_SPACE, _TAB, _RETURN, _END_OF_TAPE):
            i += 1
            continue
        if c == _NEWLINE:
            if i - line_start > LINE_LIMIT:
                letters[count], values[count], lines[count] = 33, f.LINE_TOO_LONG, line
                if marks < len(extras):
                    extras[marks] = LINE_LIMIT
                marks += 1
                count += 1
            i += 1
            line += 1
            line_start = i
            words_in_line = 0
            continue
        error = 0
        lost = 0  # letter of the word whose value cannot be read
        found = float(c)
        upper = c & 223 if c >= 97 and c <= 122 else c
        if c == 59:  # ; comment to the end of the line
            i = _line_end(text, i)
            continue
        if c == 40:  # ( comment )
            error, end = _after_comment(text, i)
            if error == f.OK:
                if _is_message(text, i + 1, end - 1) and messages < len(spans):
                    letters[count], values[count], lines[count] = 40, messages, line
                    spans[messages, 0], spans[messages, 1] = i + 1, end - 1
                    messages += 1
                    count += 1
                i = end
                continue
            i = end
        elif c == 37 or (c == 47 and words_in_line == 0):  # % and /
            letters[count], values[count], lines[count] = c, 0.0, line
            count += 1
            i += 1
            continue
        elif upper >= 65 and upper <= 90:
            letter_at = i
            i += 1
            sign = 1.0
            mantissa = 0.0
            digits = 0
            significant = 0
            decimals = 0
            point = False
            started = False
            while i < n:
                d = text[i]
                if d >= 48 and d <= 57:
                    started = True
                    digits += 1
                    if significant > 0 or d != 48:
                        significant += 1
                    if significant <= 15:
                        mantissa = mantissa * 10.0 + (d - 48)
                        if point:
                            decimals += 1
                    elif not point:
                        error = f.NUMBER_TOO_LONG
                elif d == 46 and not point:
                    point = True
                    started = True
                elif (d == 45 or d == 43) and not started:
                    started = True
                    if d == 45:
                        sign = -1.0
                elif d != _SPACE and d != _TAB:
                    break
                i += 1
            if digits == 0:
                found = float(upper)
                error, lost, i = _without_number(text, i, upper)
                if error == f.BAD_CHARACTER:
                    found = float(_character(text, i))
            elif error != 0:
                found = float(upper)
                lost = upper
            elif upper == 79:
                while i < n and _blank(text[i]):
                    i += 1
                alone = i >= n or text[i] == _NEWLINE or text[i] == 40 or text[i] == 59
                if words_in_line == 0 and alone and not point and sign > 0:
                    words_in_line += 1  # a program number, O1001, says nothing about motion
                    continue
                error = f.O_WORD
                lost = upper
            elif upper == 78:  # N: line number, no word; digits, or digits.digits, as LinuxCNC reads it
                if words_in_line > 0:
                    error = f.N_NOT_FIRST
                elif not _is_line_number(text, letter_at + 1, i):
                    error = f.BAD_LINE_NUMBER
                else:
                    words_in_line += 1
                    continue
            else:
                decimals = min(decimals, 18)
                letters[count] = upper
                values[count] = sign * mantissa / _TEN_TO[decimals]
                lines[count] = line
                count += 1
                words_in_line += 1
                if upper >= 88 and decimals > most_decimals:
                    most_decimals = decimals
                continue
        elif c == 35:  # #1 = value: an assignment; what is no assignment is a lone parameter
            error = f.EXPRESSION
            i = _after_assignment(text, i)
        elif c == 91 or c == 93 or c == 61:  # [ ] =
            error = f.EXPRESSION
            lost = _previous_letter(letters, lines, count, line)
            i += 1
        else:
            error = f.BAD_CHARACTER
            found = float(_character(text, i))
            lost = _previous_letter(letters, lines, count, line)
            i += 1
        words_in_line += 1
        if marked_line != line:
            letters[count], values[count], lines[count] = 33, error, line
            if marks < len(extras):
                extras[marks] = found
            marks += 1
            count += 1
            marked_line = line
        if lost > 0:
            letters[count], values[count], lines[count] = lost + 32, 0.0, line
            count += 1
        if error == f.O_WORD:
            i = _line_end(text, i)
    return count, messages, most_decimals
