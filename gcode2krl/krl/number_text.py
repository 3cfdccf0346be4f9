"""Targets to KRL motion lines: a compiled formatter that writes the same bytes on any processor.

Values are first rounded to 1e-9 and then, as integers, to their decimals (half away from zero), so no
floating-point formatting is involved.
"""

from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcode2krl import ascii_codes as ch
from gcode2krl import krl_words as w
from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.compiled.chunks import chunk_borders, in_chunks

BYTES_PER_TARGET = 240
NOTHING_BEFORE = (np.zeros(0, dtype=np.uint8), np.zeros(0, dtype=np.int64))


def motion_lines(
    position_mm: Floats,
    abc_deg: Floats,
    speed_m_s: Floats,
    cdis_mm: Floats,
    source_line: Ints32,
    state: Floats,
    comment_every: int,
    before: tuple[NDArray[np.uint8], Ints] = NOTHING_BEFORE,
) -> bytes:
    """Return the KRL text (CRLF) of a run of LIN motions; chunks of it are written at once.

    Before a motion stand ``; line N`` (every ``comment_every`` motions), ``$VEL.CP`` and ``$APO.CDIS``, each
    only where it changes. ``state`` (3,) = speed and CDIS in force (negative = unknown) and motions since the
    last comment; it is updated. ``before`` is text to stand right before motions, and where in it that of
    each motion begins (p + 1,).
    """
    text, begins = before
    borders = chunk_borders(len(position_mm))
    in_force = {0: state.copy()}
    for start, end in pairwise(borders):
        part = slice(start, end)
        in_force[end] = _state_behind(
            speed_m_s[part], cdis_mm[part], source_line[part], in_force[start], comment_every
        )
    state[:] = in_force[borders[-1]]

    def write(start: int, end: int) -> bytes:
        part = slice(start, end)
        own = text[begins[start] : begins[end]] if len(text) else text
        buffer = np.empty(BYTES_PER_TARGET * (end - start) + len(own), dtype=np.uint8)
        size = _lines(
            position_mm[part],
            abc_deg[part],
            speed_m_s[part],
            cdis_mm[part],
            source_line[part],
            in_force[start],
            comment_every,
            own,
            begins[start : end + 1] - begins[start] if len(text) else begins,
            buffer,
        )
        return buffer[:size].tobytes()

    return b"".join(in_chunks(write, borders))


def _state_behind(
    speed_m_s: Floats, cdis_mm: Floats, source_line: Ints32, state: Floats, comment_every: int
) -> Floats:
    """Return the ``state`` of `motion_lines` behind a chunk that begins with ``state``."""
    blended = np.flatnonzero(cdis_mm > 0)
    cdis = cdis_mm[blended[-1]] if len(blended) else state[1]
    count, rows = int(state[2]), len(speed_m_s)
    first = max(comment_every - 1 - count, 0)
    if not comment_every or first >= rows:
        since = count + rows
    elif (source_line > 0).all():
        since = (rows - 1 - first) % comment_every
    else:
        since = count
        for line in source_line.tolist():
            since = 0 if since + 1 >= comment_every and line > 0 else since + 1
    return np.array([speed_m_s[-1], cdis, since])


def fixed(value: float, decimals: int) -> str:
    """Return one number with fixed decimals, by the same rule."""
    buffer = np.empty(40, dtype=np.uint8)
    size = _fixed(buffer, 0, float(value), decimals)
    return buffer[:size].tobytes().decode("ascii")


def in_decimals(values: Floats, decimals: int) -> Ints:
    """Return numbers (n,) as whole numbers of their last decimal, by the same rule; NaN is 0."""
    whole = np.empty(len(values), dtype=np.int64)
    _in_decimals(np.ascontiguousarray(values), decimals, whole)
    return whole


@njit(cache=True)
def _in_decimals(values, decimals, whole):
    unit = 1
    for _ in range(9 - decimals):
        unit *= 10
    for i in range(len(values)):
        value = values[i]
        if np.isnan(value):
            whole[i] = 0
            continue
        scaled = (np.int64(np.rint(abs(value) * 1e9)) + unit // 2) // unit
        whole[i] = -scaled if value < 0 else scaled


@njit(cache=True)
def _fixed(buffer, at, value, decimals):
    nano = np.int64(np.rint(abs(value) * 1e9))
    unit = 1
    for _ in range(9 - decimals):
        unit *= 10
    scaled = (nano + unit // 2) // unit
    if value < 0 and scaled > 0:
        buffer[at] = ch.MINUS
        at += 1
    ten = 1
    for _ in range(decimals):
        ten *= 10
    whole = scaled // ten
    rest = scaled % ten
    at = _integer(buffer, at, whole)
    if decimals > 0:
        buffer[at] = ch.POINT
        at += 1
        for _ in range(decimals):
            ten //= 10
            buffer[at] = ch.DIGIT_0 + rest // ten % 10
            at += 1
    return at


@njit(cache=True)
def _integer(buffer, at, value):
    digits = 1
    power = 10
    while power <= value:
        power *= 10
        digits += 1
    for k in range(digits):
        buffer[at + digits - 1 - k] = ch.DIGIT_0 + value % 10
        value //= 10
    return at + digits


@njit(cache=True)
def _put(buffer, at, text):
    for k in range(len(text)):
        buffer[at + k] = text[k]
    return at + len(text)


def _bytes(text: str) -> NDArray[np.uint8]:
    return np.frombuffer(text.encode("ascii"), dtype=np.uint8).copy()


_LIN, _BLEND, _EXACT = _bytes(f"{w.LIN} {{{w.POSE_KEYS[0]} "), _bytes(f"}} {w.C_DIS}\r\n"), _bytes("}\r\n")
_VEL, _CDIS, _LINE = _bytes(f"{w.VEL_CP}="), _bytes(f"{w.APO_CDIS}="), _bytes("; line ")
_KEYS = np.stack([_bytes(f",{key} ") for key in w.POSE_KEYS[1:]])
_CRLF = _bytes("\r\n")


@njit(cache=True, nogil=True)
def _lines(position, abc, speed, cdis, source_line, state, comment_every, text, start, buffer):
    at = 0
    for i in range(len(position)):
        state[2] += 1
        if comment_every > 0 and state[2] >= comment_every and source_line[i] > 0:
            at = _put(buffer, at, _LINE)
            at = _integer(buffer, at, source_line[i])
            at = _put(buffer, at, _CRLF)
            state[2] = 0
        if speed[i] != state[0]:
            state[0] = speed[i]
            at = _put(buffer, at, _VEL)
            at = _fixed(buffer, at, speed[i], 7)
            at = _put(buffer, at, _CRLF)
        if cdis[i] > 0 and cdis[i] != state[1]:
            state[1] = cdis[i]
            at = _put(buffer, at, _CDIS)
            at = _fixed(buffer, at, cdis[i], 3)
            at = _put(buffer, at, _CRLF)
        if len(text) > 0:
            at = _put(buffer, at, text[start[i] : start[i + 1]])
        at = _put(buffer, at, _LIN)
        at = _fixed(buffer, at, position[i, 0], 3)
        for k in range(5):
            at = _put(buffer, at, _KEYS[k])
            at = _fixed(buffer, at, position[i, k + 1], 3) if k < 2 else _fixed(buffer, at, abc[i, k - 2], 4)
        at = _put(buffer, at, _BLEND if cdis[i] > 0 else _EXACT)
    return at
