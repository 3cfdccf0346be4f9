"""Targets to KRL motion lines: a compiled formatter that writes the same bytes on any processor.

Values are first rounded to 1e-9 and then, as integers, to their decimals (half away from zero), so no
floating-point formatting is involved.
"""

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats, Ints, Ints32
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

BYTES_PER_TARGET = 240
NOTHING_BEFORE = (np.zeros(0, dtype=np.uint8), np.zeros(0, dtype=np.int64))

_fixed = core_function("krl_fixed", OUT_BYTES, FLOAT, INT, returns=INT)
_in_decimals = core_function("krl_in_decimals", FLOATS, INT, OUT_INTS)
_lines = core_function(
    "krl_motion_lines",
    *(FLOATS, FLOATS, FLOATS, FLOATS, INTS32, OUT_FLOATS, INT, BYTES, INTS, OUT_BYTES),
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
) -> bytes:
    """Return the KRL text (CRLF) of a run of LIN motions.

    Before a motion stand ``; line N`` (every ``comment_every`` motions), ``$VEL.CP`` and ``$APO.CDIS``, each
    only where it changes. ``state`` (3,) = speed and CDIS in force (negative = unknown) and motions since the
    last comment; it is updated. ``before`` is text to stand right before motions, and where in it that of
    each motion begins (p + 1,).
    """
    text, start = before
    buffer = np.empty(BYTES_PER_TARGET * len(position_mm) + len(text), dtype=np.uint8)
    position, abc = np.ascontiguousarray(position_mm), np.ascontiguousarray(abc_deg)
    size = _lines(position, abc, speed_m_s, cdis_mm, source_line, state, comment_every, text, start, buffer)
    return buffer[:size].tobytes()


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
