"""Bytes to words: a compiled scanner that turns a piece of G-code text into columns.

A word is (letter, value, line). Three things that are not words travel in the same stream so that their
order is kept: ``/`` (block delete), ``%`` (tape mark), ``(`` (a message comment; value = its number) and
``!`` (the line cannot be read; value = number of the finding, ``extra`` = what was found).
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
    letters = np.empty(len(text) + 2, dtype=np.uint8)  # upper bound; pages never touched cost nothing
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
        found = float(c)
        upper = c & 223 if c >= 97 and c <= 122 else c
        if c == 59:  # ; comment to the end of the line
            end = i + 1
            while end < n and text[end] != _NEWLINE:
                end += 1
            i = end
            continue
        if c == 40:  # ( comment )
            end = i + 1
            while end < n and text[end] != 41 and text[end] != _NEWLINE and text[end] != 40:
                end += 1
            if end >= n or text[end] == _NEWLINE:
                error = f.COMMENT_OPEN
            elif text[end] == 40:
                error = f.COMMENT_NESTED
            else:
                if _is_message(text, i + 1, end) and messages < len(spans):
                    letters[count], values[count], lines[count] = 40, messages, line
                    spans[messages, 0], spans[messages, 1] = i + 1, end
                    messages += 1
                    count += 1
                i = end + 1
                continue
        elif c == 37 or (c == 47 and words_in_line == 0):  # % and /
            letters[count], values[count], lines[count] = c, 0.0, line
            count += 1
            i += 1
            continue
        elif upper >= 65 and upper <= 90:
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
                error = f.NO_NUMBER
                found = float(upper)
                if upper == 79:
                    error = f.O_WORD
                elif i < n and (text[i] == 35 or text[i] == 91):
                    error = f.EXPRESSION
            elif error != 0:
                found = float(upper)
            elif upper == 79:
                while i < n and (text[i] == _SPACE or text[i] == _TAB or text[i] == _RETURN):
                    i += 1
                alone = i >= n or text[i] == _NEWLINE or text[i] == 40 or text[i] == 59
                if words_in_line == 0 and alone and not point and sign > 0:
                    words_in_line += 1  # a program number, O1001, says nothing about motion
                    continue
                error = f.O_WORD
            elif upper == 78:  # N: line number, no word
                if words_in_line > 0:
                    error = f.N_NOT_FIRST
                elif sign < 0:
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
        elif c == 35 or c == 91 or c == 93 or c == 61:  # # [ ] =
            error = f.EXPRESSION
        else:
            error = f.BAD_CHARACTER
        letters[count], values[count], lines[count] = 33, error, line
        if marks < len(extras):
            extras[marks] = found
        marks += 1
        count += 1
        while i < n and text[i] != _NEWLINE:
            i += 1
    return count, messages, most_decimals
