"""Targets to KRL motion lines: a compiled formatter that writes the same bytes on any processor.

Values are first rounded to 1e-9 and then, as integers, to their decimals (half away from zero), so no
floating-point formatting is involved.
"""

import threading
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.core import (
    BYTES,
    FLOAT,
    FLOATS,
    INT,
    INTS,
    INTS32,
    OUT_BYTES,
    OUT_FLOATS,
    OUT_INTS,
    core_function,
)

BYTES_PER_TARGET = 360
NOTHING_BEFORE = (np.zeros(0, dtype=np.uint8), np.zeros(0, dtype=np.int64))
_OF_THREAD = threading.local()

_fixed = core_function("krl_fixed", OUT_BYTES, FLOAT, INT, returns=INT)
_in_decimals = core_function("krl_in_decimals", FLOATS, INT, OUT_INTS)
_lines = core_function(
    "krl_motion_lines",
    *(FLOATS, FLOATS, FLOATS, FLOATS, INTS32, FLOATS, INT, OUT_FLOATS, INT, BYTES, INTS, OUT_BYTES),
    returns=INT,
)


def motion_lines(
    position_mm: Floats,
    abc_deg: Floats,
    speed_m_s: Floats,
    cdis_mm: Floats,
    source_line: Ints32,
    state: Floats,
    comment_every: int,
    before: tuple[NDArray[np.uint8], Ints] = NOTHING_BEFORE,
    external: tuple[Floats, int] = (np.zeros((0, 6)), 0),
) -> list[bytes]:
    """Return the KRL text (CRLF) of a run of LIN motions in pieces of whole lines, made at once.

    Before a motion stand ``; line N`` (every ``comment_every`` motions), ``$VEL.CP`` and ``$APO.CDIS``, each
    only where it changes. ``state`` (3,) = speed and CDIS in force (negative = unknown) and motions since the
    last comment; it is updated. ``before`` is text to stand right before motions, and where in it that of
    each motion begins (p + 1,). ``external`` is E1 to E6 (p, 6), and which of them are written as bits.
    """
    text, begins = before
    borders = chunk_borders(len(position_mm))
    position, abc = np.ascontiguousarray(position_mm), np.ascontiguousarray(abc_deg)
    at_external, axes = external
    carried = np.ascontiguousarray(at_external) if axes else np.zeros((0, 6))
    in_force = {0: state.copy()}
    for start, end in pairwise(borders):
        part = slice(start, end)
        in_force[end] = _state_behind(
            speed_m_s[part], cdis_mm[part], source_line[part], in_force[start], comment_every
        )
    state[:] = in_force[borders[-1]]

    def write(start: int, end: int) -> bytes:
        part = slice(start, end)
        chunk = text[begins[start] : begins[end]] if len(text) else text
        buffer = _room(BYTES_PER_TARGET * (end - start) + len(chunk))
        size = _lines(
            position[part],
            abc[part],
            speed_m_s[part],
            cdis_mm[part],
            source_line[part],
            carried[part] if axes else carried,
            axes,
            in_force[start],
            comment_every,
            chunk,
            begins[start : end + 1] - begins[start] if len(text) else begins,
            buffer,
        )
        return buffer[:size].tobytes()

    return in_chunks(write, borders)


def _room(size: int) -> NDArray[np.uint8]:
    """Return the thread's own room for a text of so many bytes."""
    if len(getattr(_OF_THREAD, "room", ())) < size:
        _OF_THREAD.room = np.empty(size, dtype=np.uint8)
    room: NDArray[np.uint8] = _OF_THREAD.room
    return room


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
    size = _fixed(buffer, float(value), decimals)
    return buffer[:size].tobytes().decode("ascii")


def in_decimals(values: Floats, decimals: int) -> Ints:
    """Return numbers (n,) as whole numbers of their last decimal, by the same rule; NaN is 0."""
    whole = np.empty(len(values), dtype=np.int64)
    _in_decimals(np.ascontiguousarray(values), decimals, whole)
    return whole
