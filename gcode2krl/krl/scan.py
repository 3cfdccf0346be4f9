"""KRL text to columns: a compiled scanner for the motion lines, everything else by its line.

It knows nothing of the writer: it reads any spacing, any order of components, upper and lower case.
"""

from collections.abc import Iterator
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcode2krl import ascii_codes as ch
from gcode2krl import krl_words as w
from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.compiled.chunks import in_chunks

DISTANCE, DELAY, WRITTEN, NAME = 0, 1, 2, 6
"""Columns of a trigger: distance, delay, the numbers it writes, first byte and length of the name."""
NUMBERS = 4
"""Numbers that a trigger writes when it calls."""
COLUMNS = len(w.POSE_KEYS) + len(w.STATUS_TURN)
CHUNK_BYTES = 1 << 20
"""Bytes of a chunk, to the end of the line."""
_MOST_DIGITS = 15
_AXIS_BITS = COLUMNS
"""Components A1 to A6 have the bits from here on, the others those of their columns."""
_CARTESIAN = (1 << COLUMNS) - 1


class Scanned(NamedTuple):
    """A row per statement."""

    kind: NDArray[np.int8]
    line: Ints32
    span: Ints
    """(k, 2) first and last byte of the statement."""
    value: Floats
    """(k, 8) components X, Y, Z, A, B, C, S, T, or A1 to A6, NaN where absent; a lone number stands in
    column 0. The columns of a trigger are named above; any other trigger is `KIND_OTHER`."""
    blend: NDArray[np.int8]
    """(k,) 1 for ``C_DIS`` and for a wait marked ``; dwell``, else 0, -1 where the line is malformed."""
    too_long: int
    """First line that is too long, 0 = none."""
    not_ascii: int
    """First line with a character that is not ASCII, 0 = none."""
    open_folds: int
    """``;FOLD`` less ``;ENDFOLD``."""


class _Part(NamedTuple):
    """What the scan of a chunk returns; places are those in the whole text."""

    rows: slice
    too_long: int
    not_ascii: int
    folds: int


def scan_krl(text: bytes) -> Scanned:
    """Scan a KRL file; comments, blank lines and ``&`` lines are left out."""
    data = np.frombuffer(text, dtype=np.uint8)
    borders = _borders(text)
    lines_before = dict(zip(borders, accumulate(_lines_of(text, borders), initial=0), strict=True))
    most = lines_before[borders[-1]] + 1
    kind, blend = np.empty(most, dtype=np.int8), np.empty(most, dtype=np.int8)
    line, span = np.empty(most, dtype=np.int32), np.empty((most, 2), dtype=np.int64)
    value = np.empty((most, COLUMNS))
    columns = kind, line, span, value, blend

    def scan(start: int, end: int) -> _Part:
        first = lines_before[start]
        own = [column[first : lines_before[end] + (end == len(text))] for column in columns]
        count, too_long, not_ascii, folds = _scan(data[start:end], *own)
        rows = slice(first, first + count)
        line[rows] += first
        span[rows] += start
        value[rows, NAME][kind[rows] == w.KIND_TRIGGER] += start
        return _Part(rows, too_long and first + too_long, not_ascii and first + not_ascii, folds)

    parts = in_chunks(scan, borders)
    rows = _moved_together(columns, [part.rows for part in parts])
    return Scanned(
        kind[rows],
        line[rows],
        span[rows],
        value[rows],
        blend[rows],
        too_long=next((part.too_long for part in parts if part.too_long), 0),
        not_ascii=next((part.not_ascii for part in parts if part.not_ascii), 0),
        open_folds=sum(part.folds for part in parts),
    )


def _borders(text: bytes) -> list[int]:
    """Return the borders of chunks of whole lines."""
    borders = [0]
    while borders[-1] < len(text):
        line_end = text.find(b"\n", borders[-1] + CHUNK_BYTES)
        borders.append(line_end + 1 if line_end >= 0 else len(text))
    return borders


def _lines_of(text: bytes, borders: list[int]) -> Iterator[int]:
    """Yield the line ends in each chunk."""
    return (text.count(b"\n", start, end) for start, end in pairwise(borders))


def _moved_together(columns: tuple[NDArray[Any], ...], parts: list[slice]) -> slice:
    """Close the gaps between parts of columns and return the rows that are left."""
    count = 0
    for part in parts:
        rows = slice(count, count + part.stop - part.start)
        if rows != part:
            for column in columns:
                column[rows] = column[part]
        count = rows.stop
    return slice(count)


def _bytes(word: str) -> NDArray[np.uint8]:
    return np.frombuffer(word.encode("ascii"), dtype=np.uint8).copy()


_LIN_WORD, _PTP_WORD, _BLEND_WORD = _bytes(w.LIN), _bytes(w.PTP), _bytes(w.C_DIS)
_VEL_WORD, _CDIS_WORD = _bytes(w.VEL_CP), _bytes(w.APO_CDIS)
_WAIT_WORD, _SEC_WORD, _DWELL_WORD = _bytes(w.WAIT), _bytes(w.SEC), _bytes(w.DWELL.upper())
_DISTANCE_WORDS = tuple(_bytes(word) for word in (w.TRIGGER, w.WHEN, w.DISTANCE, "="))
_DELAY_WORDS = tuple(_bytes(word) for word in (w.DELAY, "="))
_DO_WORDS = (_bytes(w.DO),)
_PRIO_WORDS = tuple(_bytes(word) for word in (w.PRIO, "="))
_FOLD_WORD, _ENDFOLD_WORD = _bytes(w.FOLD), _bytes(w.ENDFOLD)


@njit(cache=True)
def _starts(data, at, end, word):
    """Tell whether a word of capitals stands at a place, in capitals or small letters."""
    if at + len(word) > end:
        return False
    for k in range(len(word)):
        c = data[at + k]
        if c >= ch.SMALL_A and c <= ch.SMALL_Z:
            c -= ch.CASE_BIT
        if c != word[k]:
            return False
    return True


@njit(cache=True)
def _is_blank(c):
    return c == ch.SPACE or c == ch.TAB


@njit(cache=True)
def _is_digit(c):
    return c >= ch.DIGIT_0 and c <= ch.DIGIT_9


@njit(cache=True)
def _blank(data, at, end):
    """Return the place behind blanks."""
    while at < end and _is_blank(data[at]):
        at += 1
    return at


@njit(cache=True)
def _is(data, at, end, c):
    return at < end and data[at] == c


@njit(cache=True)
def _ends_here(data, at, end):
    """Tell whether nothing but a comment follows."""
    return at >= end or data[at] == ch.SEMICOLON


@njit(cache=True)
def _number(data, at, end):
    """Return (position behind the number, value); NaN where there is none."""
    sign = 1.0
    if at < end and (data[at] == ch.MINUS or data[at] == ch.PLUS):
        if data[at] == ch.MINUS:
            sign = -1.0
        at += 1
    mantissa = 0.0
    scale = 1.0
    digits = 0
    point = False
    while at < end:
        c = data[at]
        if _is_digit(c):
            mantissa = mantissa * 10.0 + (c - ch.DIGIT_0)
            if point:
                scale *= 10.0
            digits += 1
        elif c == ch.POINT and not point:
            point = True
        else:
            break
        at += 1
    if digits == 0 or digits > _MOST_DIGITS:
        return at, np.nan
    return at, sign * mantissa / scale


@njit(cache=True)
def _component(data, at, end):
    """Return (position behind the name of a component, its bit), -1 for no such component."""
    letter = data[at] - ch.CASE_BIT if data[at] >= ch.SMALL_A else data[at]
    at += 1
    if letter >= ch.LETTER_X and letter <= ch.LETTER_Z:
        return at, letter - ch.LETTER_X
    if letter == ch.LETTER_A and at < end and data[at] >= ch.DIGIT_1 and data[at] <= ch.DIGIT_6:
        return at + 1, _AXIS_BITS + data[at] - ch.DIGIT_1
    if letter >= ch.LETTER_A and letter <= ch.LETTER_C:
        return at, 3 + letter - ch.LETTER_A
    if letter == ch.LETTER_S:
        return at, 6
    return at, 7 if letter == ch.LETTER_T else -1


@njit(cache=True)
def _components(data, at, end, value):
    """Read ``{X 1.0,Y 2.0,…}`` into value; return (position behind the brace or -1, components as bits)."""
    found = 0
    if not _is(data, at, end, ch.BRACE_OPEN):
        return -1, found
    at += 1
    while True:
        at = _blank(data, at, end)
        if at >= end:
            return -1, found
        at, bit = _component(data, at, end)
        if bit < 0 or at >= end or not _is_blank(data[at]):
            return -1, found
        at, number = _number(data, _blank(data, at, end), end)
        if np.isnan(number) or found & (1 << bit):
            return -1, found
        found |= 1 << bit
        value[bit - _AXIS_BITS if bit >= _AXIS_BITS else bit] = number
        at = _blank(data, at, end)
        if _is(data, at, end, ch.BRACE_CLOSE):
            return at + 1, found
        if not _is(data, at, end, ch.COMMA):
            return -1, found
        at += 1


@njit(cache=True)
def _behind(data, at, end, words):
    """Return the place behind words and the blanks after each, -1 where they do not stand there."""
    for k in range(len(words)):
        if at < 0 or not _starts(data, at, end, words[k]):
            return -1
        at = _blank(data, at + len(words[k]), end)
    return at


@njit(cache=True)
def _number_behind(data, at, end, words):
    """Return (place behind words and a number, the number), (-1, NaN) where they do not stand there."""
    at = _behind(data, at, end, words)
    if at < 0:
        return -1, np.nan
    at, number = _number(data, at, end)
    return (-1 if np.isnan(number) else _blank(data, at, end)), number


@njit(cache=True)
def _written_name(data, at, end, value):
    """Read the name that is assigned to or called; return the place of the ``=`` or ``(``, -1 without one."""
    first = at
    while at < end and data[at] not in (ch.EQUALS, ch.PAREN_OPEN, ch.SEMICOLON):
        at += 1
    last = at
    while last > first and _is_blank(data[last - 1]):
        last -= 1
    value[NAME], value[NAME + 1] = first, last - first
    return -1 if _ends_here(data, at, end) or last == first else at


@njit(cache=True)
def _arguments(data, at, end, value):
    """Read the numbers of a call from its ``(`` on; return the place behind ``)``, -1 where it is another."""
    for k in range(NUMBERS):
        at, number = _number(data, _blank(data, at + 1, end), end)
        at = _blank(data, at, end)
        value[WRITTEN + k] = number
        if np.isnan(number) or not _is(data, at, end, ch.COMMA if k < NUMBERS - 1 else ch.PAREN_CLOSE):
            return -1
    return _blank(data, at + 1, end)


@njit(cache=True)
def _trigger(data, at, end, value):
    """Read ``TRIGGER WHEN DISTANCE=0 DELAY=7 DO …`` into value; return what it does, 0 for anything else."""
    at, value[DISTANCE] = _number_behind(data, at, end, _DISTANCE_WORDS)
    at, value[DELAY] = _number_behind(data, at, end, _DELAY_WORDS)
    at = _behind(data, at, end, _DO_WORDS)
    at = _written_name(data, at, end, value) if at >= 0 else -1
    if at < 0:
        return 0
    calls = data[at] == ch.PAREN_OPEN
    if calls:
        at = _arguments(data, at, end, value)
        at, prio = _number_behind(data, at, end, _PRIO_WORDS)
        if at < 0 or prio != w.PRIO_BY_CONTROLLER:
            return 0
    else:
        at, value[WRITTEN] = _number(data, _blank(data, at + 1, end), end)
        at = _blank(data, at, end)
        if np.isnan(value[WRITTEN]):
            return 0
    if not _ends_here(data, at, end):
        return 0
    return w.CALLS if calls else w.ASSIGNS


@njit(cache=True)
def _motion(data, begin, end, value):
    """Read a LIN or PTP into value; return its kind (-1 for no motion) and its blending."""
    if _starts(data, begin, end, _LIN_WORD):
        kind = w.KIND_LIN
    elif _starts(data, begin, end, _PTP_WORD):
        kind = w.KIND_PTP
    else:
        return -1, 0
    at, found = _components(data, _blank(data, begin + 3, end), end, value)
    axes = found > _CARTESIAN
    linear = kind == w.KIND_LIN
    if axes and not linear:
        kind = w.KIND_PTP_AXES
    if at < 0 or (axes and (linear or found & _CARTESIAN)):
        return kind, w.MALFORMED
    at = _blank(data, at, end)
    blend = 0
    if _starts(data, at, end, _BLEND_WORD):
        blend = 1
        at = _blank(data, at + len(_BLEND_WORD), end)
    return kind, blend if _ends_here(data, at, end) else w.MALFORMED


@njit(cache=True)
def _setting(data, begin, end):
    """Return (kind, place behind the words) of $VEL.CP, $APO.CDIS and WAIT SEC; the kind is -1 for others."""
    if _starts(data, begin, end, _VEL_WORD):
        return w.KIND_VEL_CP, begin + len(_VEL_WORD)
    if _starts(data, begin, end, _CDIS_WORD):
        return w.KIND_APO_CDIS, begin + len(_CDIS_WORD)
    if _starts(data, begin, end, _WAIT_WORD):
        behind = begin + len(_WAIT_WORD)
        second = _blank(data, behind, end)
        if second > behind and _starts(data, second, end, _SEC_WORD):
            return w.KIND_WAIT_SEC, second + len(_SEC_WORD)
    return -1, begin


@njit(cache=True)
def _set_to(data, at, end, kind, value):
    """Read what a setting is set to into value; return its blending: 1 for a dwell, `MALFORMED`, else 0."""
    blend = 0
    at = _blank(data, at, end)
    if kind != w.KIND_WAIT_SEC:
        if not _is(data, at, end, ch.EQUALS):
            blend = w.MALFORMED
        at = _blank(data, at + 1, end)
    at, value[0] = _number(data, at, end)
    at = _blank(data, at, end)
    if np.isnan(value[0]) or not _ends_here(data, at, end):
        return w.MALFORMED
    if kind == w.KIND_WAIT_SEC and at < end:
        return int(_starts(data, _blank(data, at + 1, end), end, _DWELL_WORD))
    return blend


@njit(cache=True)
def _statement(data, begin, end, value):
    """Read a statement into value; return its kind and its blending."""
    kind, blend = _motion(data, begin, end, value)
    if kind >= 0:
        return kind, blend
    kind, at = _setting(data, begin, end)
    if kind >= 0:
        return kind, _set_to(data, at, end, kind, value)
    does = _trigger(data, begin, end, value)
    return (w.KIND_TRIGGER, does) if does > 0 else (w.KIND_OTHER, 0)


@njit(cache=True)
def _fold(data, begin, end):
    """Return 1 for a comment that opens a fold, -1 for one that closes it, else 0."""
    if _starts(data, begin, end, _FOLD_WORD):
        return 1
    return -1 if _starts(data, begin, end, _ENDFOLD_WORD) else 0


@njit(cache=True, nogil=True)
def _scan(data, kind, line, span, value, blend):
    """Fill the columns; return (statements, first line too long, first that is not ASCII, open folds)."""
    n = len(data)
    at = 0
    number = 0
    count = 0
    too_long, not_ascii, folds = 0, 0, 0
    while at < n:
        number += 1
        end = at
        while end < n and data[end] != ch.NEWLINE:
            if data[end] >= ch.FIRST_FOREIGN and not_ascii == 0:
                not_ascii = number
            end += 1
        if end - at > w.LONGEST_LINE + 1 and too_long == 0:
            too_long = number
        begin = _blank(data, at, end)
        at = end + 1
        while end > begin and (data[end - 1] == ch.RETURN or _is_blank(data[end - 1])):
            end -= 1
        if begin == end or data[begin] == ch.SEMICOLON or data[begin] == ch.AMPERSAND:
            folds += _fold(data, begin, end)
            continue
        line[count], span[count, 0], span[count, 1] = number, begin, end
        value[count, :] = np.nan
        kind[count], blend[count] = _statement(data, begin, end, value[count])
        count += 1
    return count, too_long, not_ascii, folds
