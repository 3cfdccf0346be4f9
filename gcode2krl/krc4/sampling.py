"""From the planned pieces to samples: the last moving average, corners, positions and their derivatives.

Three passes over the samples: the time law (rows independent), the move (rows in order, because rounding
must not move a standstill back before a corner), and the place in space (rows independent again).
"""

import math
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.core import FLOAT, FLOATS, INT, INTS, OUT_BOOLS, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.compiled.inputs import contiguous
from gcode2krl.krc4.profile import Profile

_law = core_function("krc4_law", *[FLOATS] * 6, FLOAT, INT, INT, *[OUT_FLOATS] * 4)
_find_moves = core_function("krc4_moves", FLOATS, FLOATS, OUT_INTS)
_savings = core_function("krc4_savings", *[FLOATS] * 4, INT, INT, OUT_FLOATS, OUT_FLOATS)
_place = core_function("krc4_place", INTS, *[FLOATS] * 7, *[OUT_FLOATS] * 7, OUT_BOOLS)


class Samples(NamedTuple):
    """The path and its time law at m sample times."""

    position_mm: Floats
    """(m, 3) inside a corner on the parabola."""
    speed_mm_s: Floats
    acceleration_mm_s2: Floats
    jerk_mm_s3: Floats
    path_mm: Floats
    """(m,) arc length along the blended path."""
    move: Ints
    part: Floats
    """(m,) fraction of the move that is done."""
    corner: Bools
    """(m,) True inside an approximated corner."""
    direction: Floats
    """(m, 3) unit tangent of the path; zero in a turn on the spot."""


def count_samples(profile: Profile, dt_s: float) -> int:
    """Return how many samples a motion has, the last one at or after its end."""
    return math.ceil(profile.total_s / dt_s - 1e-9) + 1


def sample(
    time_s: Floats,
    profile: Profile,
    start_mm: Floats,
    end_mm: Floats,
    length_mm: Floats,
    blend_mm: Floats,
    k_s: float,
) -> Samples:
    """Return the motion at rising times (m,) along moves (n,); ``blend_mm`` belongs to the end of each."""
    return Sampler(profile, start_mm, end_mm, length_mm, blend_mm, k_s).at(time_s)


class Sampler:
    """Moves (n,) with their time law; ``blend_mm`` belongs to the end of each."""

    def __init__(
        self,
        profile: Profile,
        start_mm: Floats,
        end_mm: Floats,
        length_mm: Floats,
        blend_mm: Floats,
        k_s: float,
    ) -> None:
        """Take the moves and the pieces of their law."""
        self._profile, self._k_s = profile, k_s
        columns = (start_mm, end_mm, length_mm, blend_mm)
        self._moves = _Moves(*(contiguous(column) for column in columns))
        self._begins = _sums(length_mm)
        self._way, self._saved = _way_to_moves(self._moves)

    def at(self, time_s: Floats, first_move: int = 0) -> Samples:
        """Return the motion at rising times (m,), none of them in a move before ``first_move``."""
        count, profile, k_s = len(time_s), self._profile, self._k_s
        move = np.empty(count, dtype=np.int64)
        law = tuple(np.empty((4, count)))  # speed, acceleration, jerk and path
        part, corner, position = np.empty(count), np.empty(count, dtype=np.bool_), np.empty((count, 3))
        direction = np.empty((count, 3))

        def law_of(start: int, end: int) -> None:
            ends = [time_s[start], time_s[start] - k_s]
            first = np.maximum(np.searchsorted(profile.time_s, ends, side="right") - 1, 0)
            figures = (row[start:end] for row in law)
            _law(time_s[start:end], *profile[:5], k_s, int(first[0]), int(first[1]), *figures)

        def place(start: int, end: int) -> None:
            written = (row[start:end] for row in (*law, position, direction, part, corner))
            _place(move[start:end], *self._moves, self._begins, self._way, self._saved, *written)

        in_chunks(law_of, chunk_borders(count))
        _find_moves(law[3], self._begins[first_move:], move)
        move += first_move
        in_chunks(place, chunk_borders(count))
        speed, acceleration, jerk, path = law
        return Samples(position, speed, acceleration, jerk, path, move, part, corner, direction)


class _Moves(NamedTuple):
    """The moves (n) as the core sees them."""

    start: Floats
    end: Floats
    length: Floats
    blend: Floats


def _sums(values: Floats) -> Floats:
    """Return the sum (n + 1,) of the values before each, and of all."""
    sums = np.zeros(len(values) + 1)
    np.cumsum(values, out=sums[1:])
    return sums


def _way_to_moves(moves: _Moves) -> tuple[Floats, Floats]:
    """Return the length of all moves before each move, and how much their corners shorten it, (n + 1,)."""
    count = len(moves.length)
    size, saving = np.zeros(count + 1), np.zeros(count + 1)
    in_chunks(lambda start, end: _savings(*moves, start, end, size[1:], saving[1:]), chunk_borders(count))
    return np.cumsum(size, out=size), np.cumsum(saving, out=saving)
