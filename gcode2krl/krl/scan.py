"""KRL text to columns: a compiled scanner for the motion lines, everything else by its line.

It knows nothing of the writer: it reads any spacing, any order of components, upper and lower case.
"""

from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl import krl_words as w
from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.compiled.chunks import in_chunks
from gcode2krl.compiled.core import BYTES, INT, OUT_BYTES, OUT_FLOATS, OUT_INTS, OUT_INTS32, core_function

CHUNK_BYTES = 1 << 20
"""Bytes that a thread scans at a time, and whole lines more."""
_SEARCHED_BYTES = 4096

_count = core_function("krl_count", BYTES, INT, INT, OUT_INTS)
_external = core_function("krl_external", BYTES, INT, INT, OUT_FLOATS)
_scan = core_function(
    "krl_scan",
    *(BYTES, INT, INT, INT),
    *(OUT_BYTES, OUT_BYTES, OUT_INTS32, OUT_FLOATS, OUT_INTS, OUT_FLOATS, OUT_INTS),
)


class Scanned(NamedTuple):
    """A row per statement (k); motions (m of them) and all others have their numbers apart, in this order."""

    kind: NDArray[np.int8]
    blend: NDArray[np.int8]
    """(k,) 1 for ``C_DIS`` and for a wait marked ``; dwell``, else 0, -1 where the line is malformed."""
    line: Ints32
    pose: Floats
    """(m, 8) components X, Y, Z, A, B, C, S, T of a motion, or A1 to A6, NaN where absent."""
    span: Ints
    """(k - m, 2) first and last byte of a statement that is no motion."""
    value: Floats
    """(k - m, 8) its numbers; a lone one stands in column 0. The columns of a trigger are named in
    `krl_words`; any other trigger is `KIND_OTHER`."""
    too_long: int
    """First line that is too long, 0 = none."""
    not_ascii: int
    """First line with a character that is not ASCII, 0 = none."""
    open_folds: int
    """``;FOLD`` less ``;ENDFOLD``."""
    external: Floats
    """(m, 6) E1 to E6 of a motion, NaN where absent; (0, 6) where no motion has any."""


def scan_krl(text: bytes | NDArray[np.uint8], chunk_bytes: int = CHUNK_BYTES) -> Scanned:
    """Scan a KRL file; comments, blank lines and ``&`` lines are left out."""
    data = np.frombuffer(text, dtype=np.uint8)
    borders = _borders(data, chunk_bytes)

    def counted(start: int, end: int) -> Ints:
        lines_statements_motions = np.empty(3, dtype=np.int64)
        _count(data, start, end, lines_statements_motions)
        return lines_statements_motions

    before = list(accumulate(in_chunks(counted, borders), initial=np.zeros(3, dtype=np.int64)))
    begins = dict(zip(borders, (counts.tolist() for counts in before), strict=True))
    _, count, motions = begins[borders[-1]]
    kind, blend = np.empty(count, dtype=np.int8), np.empty(count, dtype=np.int8)
    line, pose = np.empty(count, dtype=np.int32), np.empty((motions, w.STATEMENT_COLUMNS))
    span = np.empty((count - motions, 2), dtype=np.int64)
    value = np.empty((count - motions, w.STATEMENT_COLUMNS))
    kinds, blends = kind.view(np.uint8), blend.view(np.uint8)

    def scanned(start: int, end: int) -> Ints:
        (lines, first, motion), (_, behind, last_motion) = begins[start], begins[end]
        rows, linear, others = (
            slice(first, behind),
            slice(motion, last_motion),
            slice(first - motion, behind - last_motion),
        )
        counts = np.zeros(4, dtype=np.int64)
        columns = kinds[rows], blends[rows], line[rows], pose[linear], span[others], value[others]
        _scan(data, start, end, lines, *columns, counts)
        return counts

    too_long, not_ascii, folds, carried = np.transpose(in_chunks(scanned, borders)).tolist()
    external = np.empty((motions if sum(carried) else 0, w.EXTERNAL_COLUMNS))
    if len(external):
        in_chunks(lambda a, b: _external(data, a, b, external[begins[a][2] : begins[b][2]]), borders)
    firsts = _first(too_long), _first(not_ascii)
    return Scanned(kind, blend, line, pose, span, value, *firsts, sum(folds), external)


def _borders(data: NDArray[np.uint8], chunk_bytes: int) -> list[int]:
    """Return where chunks of whole lines begin, and the end."""
    borders = [0]
    while len(data) - borders[-1] > chunk_bytes:
        behind = _behind_line(data, borders[-1] + chunk_bytes - 1)
        if behind == len(data):
            break
        borders.append(behind)
    return [*borders, len(data)]


def _behind_line(data: NDArray[np.uint8], at: int) -> int:
    """Return where the line that a byte belongs to has ended."""
    for start in range(at, len(data), _SEARCHED_BYTES):
        ends = np.flatnonzero(data[start : start + _SEARCHED_BYTES] == ord("\n"))
        if len(ends):
            return start + int(ends[0]) + 1
    return len(data)


def _first(lines: list[int]) -> int:
    """Return the first line that is one, 0 without any."""
    return next((line for line in lines if line), 0)
