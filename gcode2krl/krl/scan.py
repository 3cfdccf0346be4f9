"""KRL text to columns: a compiled scanner for the motion lines, everything else by its line.

It knows nothing of the writer: it reads any spacing, any order of components, upper and lower case.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

LIN, PTP, VEL_CP, APO_CDIS, WAIT_SEC, OTHER, PTP_AXES, TRIGGER = 0, 1, 2, 3, 4, 5, 6, 7
ASSIGNS, CALLS = 1, 2
"""What a trigger does, in ``blend``: write one number to a variable, or call with four and ``PRIO=-1``."""
DISTANCE, DELAY, WRITTEN, NAME = 0, 1, 2, 6
"""Columns of a trigger: distance, delay, the numbers it writes, first byte and length of the name."""
KEYS = ("X", "Y", "Z", "A", "B", "C", "S", "T")
"""Columns of a Cartesian target; of ``PTP_AXES`` the first six are A1 to A6."""
LONGEST_LINE = 471
"""Characters in a line of KRL, as KUKA's documentation is remembered."""
MALFORMED = -1


class Scanned(NamedTuple):
    """A row per statement."""

    kind: NDArray[np.int8]
    line: NDArray[np.int32]
    span: NDArray[np.int64]
    """(k, 2) first and last byte of the statement."""
    value: NDArray[np.float64]
    """(k, 8) components by `KEYS`, NaN where absent; a lone number stands in column 0. Of a trigger see
    above; other triggers than those two are ``OTHER``."""
    blend: NDArray[np.int8]
    """(k,) 1 for ``C_DIS`` and for a wait marked ``; dwell``, else 0, -1 where the line is malformed."""
    too_long: int
    """First line that is too long, 0 = none."""
    not_ascii: int
    """First line with a character that is not ASCII, 0 = none."""
    open_folds: int
    """``;FOLD`` less ``;ENDFOLD``."""


def scan_krl(text: bytes) -> Scanned:
    """Scan a KRL file; comments, blank lines and ``&`` lines are left out."""
    data = np.frombuffer(text, dtype=np.uint8)
    most = text.count(b"\n") + 2
    kind, blend = np.empty(most, dtype=np.int8), np.empty(most, dtype=np.int8)
    line, span = np.empty(most, dtype=np.int32), np.empty((most, 2), dtype=np.int64)
    value = np.empty((most, len(KEYS)))
    count, too_long, not_ascii, folds = _scan(data, kind, line, span, value, blend)
    rows = slice(count)
    return Scanned(kind[rows], line[rows], span[rows], value[rows], blend[rows], too_long, not_ascii, folds)


_LIN_WORD, _PTP_WORD, _VEL_WORD, _CDIS_WORD, _WAIT_WORD, _BLEND_WORD = (
    np.frombuffer(word, dtype=np.uint8).copy()
    for word in (b"LIN", b"PTP", b"$VEL.CP", b"$APO.CDIS", b"WAIT", b"C_DIS")
)


_TRIGGER_WORDS = tuple(
    np.frombuffer(word, dtype=np.uint8).copy()
    for word in (b"TRIGGER", b"WHEN", b"DISTANCE", b"=", b"DELAY", b"=", b"DO")
)
_PRIO_WORDS = tuple(np.frombuffer(word, dtype=np.uint8).copy() for word in (b"PRIO", b"="))
_SEC_WORD = np.frombuffer(b"SEC", dtype=np.uint8).copy()
_DWELL_WORD = np.frombuffer(b"DWELL", dtype=np.uint8).copy()
_FOLD_WORD = np.frombuffer(b";FOLD", dtype=np.uint8).copy()
_ENDFOLD_WORD = np.frombuffer(b";ENDFOLD", dtype=np.uint8).copy()


@njit(cache=True)
def _starts(data, at, end, word):
    if at + len(word) > end:
        return False
    for k in range(len(word)):
        c = data[at + k]
        if c >= 97 and c <= 122:
            c -= 32
        if c != word[k]:
            return False
    return True


@njit(cache=True)
def _blank(data, at, end):
    while at < end and (data[at] == 32 or data[at] == 9):
        at += 1
    return at


@njit(cache=True)
def _number(data, at, end):
    """Return (position behind the number, value); NaN where there is none."""
    sign = 1.0
    if at < end and (data[at] == 45 or data[at] == 43):
        if data[at] == 45:
            sign = -1.0
        at += 1
    mantissa = 0.0
    scale = 1.0
    digits = 0
    point = False
    while at < end:
        c = data[at]
        if c >= 48 and c <= 57:
            mantissa = mantissa * 10.0 + (c - 48)
            if point:
                scale *= 10.0
            digits += 1
        elif c == 46 and not point:
            point = True
        else:
            break
        at += 1
    if digits == 0 or digits > 15:
        return at, np.nan
    return at, sign * mantissa / scale


@njit(cache=True)
def _components(data, at, end, value):
    """Read ``{X 1.0,Y 2.0,…}`` into value; return (position behind the brace or -1, components as bits)."""
    found = 0
    if at >= end or data[at] != 123:
        return -1, found
    at += 1
    while True:
        at = _blank(data, at, end)
        if at >= end:
            return -1, found
        letter = data[at] - 32 if data[at] >= 97 else data[at]
        at += 1
        column = -1
        if letter >= 88 and letter <= 90:
            column = letter - 88
        elif letter >= 65 and letter <= 67:
            column = 3 + letter - 65
            if letter == 65 and at < end and data[at] >= 49 and data[at] <= 54:
                column = 8 + data[at] - 49  # A1 to A6: columns 0 to 5, bits 8 to 13
                at += 1
        elif letter == 83:
            column = 6
        elif letter == 84:
            column = 7
        if column < 0 or at >= end or (data[at] != 32 and data[at] != 9):
            return -1, found
        at = _blank(data, at, end)
        at, number = _number(data, at, end)
        if np.isnan(number) or found & (1 << column):
            return -1, found
        found |= 1 << column
        value[column - 8 if column >= 8 else column] = number
        at = _blank(data, at, end)
        if at < end and data[at] == 44:
            at += 1
        elif at < end and data[at] == 125:
            return at + 1, found
        else:
            return -1, found


@njit(cache=True)
def _trigger(data, at, end, value):
    """Read ``TRIGGER WHEN DISTANCE=0 DELAY=7 DO …`` into value; return what it does, 0 for anything else."""
    for k in range(len(_TRIGGER_WORDS)):
        if not _starts(data, at, end, _TRIGGER_WORDS[k]):
            return 0
        at = _blank(data, at + len(_TRIGGER_WORDS[k]), end)
        if k == 3 or k == 5:
            at, number = _number(data, at, end)
            value[DISTANCE if k == 3 else DELAY] = number
            if np.isnan(number):
                return 0
            at = _blank(data, at, end)
    first = at
    while at < end and data[at] != 61 and data[at] != 40 and data[at] != 59:  # = ( ;
        at += 1
    last = at
    while last > first and (data[last - 1] == 32 or data[last - 1] == 9):
        last -= 1
    value[NAME], value[NAME + 1] = first, last - first
    if at >= end or last == first or data[at] == 59:
        return 0
    calls = data[at] == 40
    for k in range(4 if calls else 1):
        at, number = _number(data, _blank(data, at + 1, end), end)
        at = _blank(data, at, end)
        value[WRITTEN + k] = number
        if np.isnan(number) or (calls and (at >= end or data[at] != (44 if k < 3 else 41))):
            return 0
    if calls:
        at = _blank(data, at + 1, end)
        for k in range(len(_PRIO_WORDS)):
            if not _starts(data, at, end, _PRIO_WORDS[k]):
                return 0
            at = _blank(data, at + len(_PRIO_WORDS[k]), end)
        at, number = _number(data, at, end)
        at = _blank(data, at, end)
        if number != -1.0:
            return 0
    if at < end and data[at] != 59:
        return 0
    return CALLS if calls else ASSIGNS


@njit(cache=True)
def _scan(data, kind, line, span, value, blend):
    n = len(data)
    at = 0
    number = 0
    count = 0
    too_long, not_ascii, folds = 0, 0, 0
    while at < n:
        number += 1
        end = at
        while end < n and data[end] != 10:
            if data[end] > 127 and not_ascii == 0:
                not_ascii = number
            end += 1
        if end - at > LONGEST_LINE + 1 and too_long == 0:
            too_long = number
        begin = _blank(data, at, end)
        at = end + 1
        while end > begin and (data[end - 1] == 13 or data[end - 1] == 32 or data[end - 1] == 9):
            end -= 1
        if begin == end or data[begin] == 59 or data[begin] == 38:
            if _starts(data, begin, end, _FOLD_WORD):
                folds += 1
            elif _starts(data, begin, end, _ENDFOLD_WORD):
                folds -= 1
            continue
        kind[count], blend[count], line[count] = OTHER, 0, number
        span[count, 0], span[count, 1] = begin, end
        value[count, :] = np.nan
        motion = -1
        if _starts(data, begin, end, _LIN_WORD):
            motion = LIN
        elif _starts(data, begin, end, _PTP_WORD):
            motion = PTP
        if motion >= 0:
            kind[count] = motion
            behind, found = _components(data, _blank(data, begin + 3, end), end, value[count])
            axes = found >= 256
            if axes and motion == PTP:
                kind[count] = PTP_AXES
            if behind < 0 or (axes and (motion == LIN or found & 255)):
                blend[count] = MALFORMED
            else:
                behind = _blank(data, behind, end)
                if _starts(data, behind, end, _BLEND_WORD):
                    blend[count] = 1
                    behind = _blank(data, behind + 5, end)
                if behind < end and data[behind] != 59:
                    blend[count] = MALFORMED
        else:
            setting = -1
            behind = begin
            if _starts(data, begin, end, _VEL_WORD):
                setting, behind = VEL_CP, begin + 7
            elif _starts(data, begin, end, _CDIS_WORD):
                setting, behind = APO_CDIS, begin + 9
            elif _starts(data, begin, end, _WAIT_WORD):
                second = _blank(data, begin + 4, end)
                if second > begin + 4 and _starts(data, second, end, _SEC_WORD):
                    setting, behind = WAIT_SEC, second + 3
            else:
                does = _trigger(data, begin, end, value[count])
                if does > 0:
                    kind[count], blend[count] = TRIGGER, does
            if setting >= 0:
                kind[count] = setting
                behind = _blank(data, behind, end)
                if setting != WAIT_SEC:
                    if behind >= end or data[behind] != 61:
                        blend[count] = MALFORMED
                    behind = _blank(data, behind + 1, end)
                behind, value[count, 0] = _number(data, behind, end)
                behind = _blank(data, behind, end)
                if np.isnan(value[count, 0]) or (behind < end and data[behind] != 59):
                    blend[count] = MALFORMED
                elif setting == WAIT_SEC and behind < end:
                    blend[count] = _starts(data, _blank(data, behind + 1, end), end, _DWELL_WORD)
        count += 1
    return count, too_long, not_ascii, folds
