"""From the planned pieces to samples: the last moving average, corners, positions and their derivatives.

Three passes over the samples: the time law (rows independent), the move (rows in order, because rounding
must not move a standstill back before a corner), and the place in space (rows independent again).
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.inputs import contiguous
from gcode2krl.krc4.profile import Profile


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


def sample_times(profile: Profile, dt_s: float) -> Floats:
    """Return the sample times (m,) in s, the last one at or after the end of the motion."""
    count = math.ceil(profile.total_s / dt_s - 1e-9) + 1
    return np.arange(count, dtype=np.float64) * dt_s


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
    count = len(time_s)
    moves = _Moves(*(contiguous(column) for column in (start_mm, end_mm, length_mm, blend_mm)))
    move, begins = np.empty(count, dtype=np.int64), _sums(length_mm)
    law = tuple(np.empty((4, count)))  # speed, acceleration, jerk and path
    part, corner, position = np.empty(count), np.empty(count, dtype=np.bool_), np.empty((count, 3))
    direction = np.empty((count, 3))
    pieces = profile[:5]

    def law_of(start: int, end: int) -> None:
        ends = [time_s[start], time_s[start] - k_s]
        first = np.maximum(np.searchsorted(profile.time_s, ends, side="right") - 1, 0)
        _law(time_s[start:end], pieces, k_s, first[0], first[1], tuple(row[start:end] for row in law))

    def place(start: int, end: int) -> None:
        rows = slice(start, end)
        figures = tuple(row[rows] for row in law)
        places = position[rows], direction[rows]
        _place(move[rows], moves, begins, way, saved, figures, places, part[rows], corner[rows])

    in_chunks(law_of, chunk_borders(count))
    _moves(law[3], begins, move)
    way, saved = _way_to_moves(moves)
    in_chunks(place, chunk_borders(count))
    speed, acceleration, jerk, path = law
    return Samples(position, speed, acceleration, jerk, path, move, part, corner, direction)


class _Moves(NamedTuple):
    """The moves (n) as the kernels see them."""

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
    in_chunks(lambda start, end: _savings(moves, start, end, size[1:], saving[1:]), chunk_borders(count))
    return np.cumsum(size, out=size), np.cumsum(saving, out=saving)


@njit(cache=True, nogil=True)
def arc_length(tau, uu, uw, ww):
    """Length of the parabola up to tau, in units of 2·d: the integral of |(1 - t)·u + t·w| from 0 to tau.

    ``uu``, ``uw``, ``ww`` are the products of the tangents u before and w after the corner.
    """
    bend = uu - 2.0 * uw + ww
    if bend < 1e-12 * (uu + ww):
        return math.sqrt(uu) * tau
    middle = (uw - uu) / bend  # the square of the length is bend·((t + middle)² + q2)
    q2 = max(uu / bend - middle * middle, 1e-300)
    q = math.sqrt(q2)
    x0, x1 = middle, tau + middle
    r0, r1 = math.sqrt(x0 * x0 + q2), math.sqrt(x1 * x1 + q2)
    value = 0.5 * (x1 * r1 - x0 * r0 + q2 * (math.asinh(x1 / q) - math.asinh(x0 / q)))
    return math.sqrt(bend) * value


@njit(cache=True, nogil=True)
def _at(pieces, at, t):
    """Return (piece, path, speed, acceleration, integral) at a time; before the start everything is 0."""
    time, path, speed, acceleration, integral = pieces
    if t <= 0.0:
        return 0, 0.0, 0.0, 0.0, 0.0
    last = len(time) - 1
    while at < last and time[at + 1] <= t:
        at += 1
    dt = t - time[at]
    s = path[at] + speed[at] * dt + 0.5 * acceleration[at] * dt * dt
    area = integral[at] + path[at] * dt + 0.5 * speed[at] * dt * dt + acceleration[at] * dt**3 / 6.0
    return at, s, speed[at] + acceleration[at] * dt, acceleration[at], area


@njit(cache=True, nogil=True)
def _law(time, pieces, k, now, then, law):
    """Write speed, acceleration, jerk, planned path; ``now`` and ``then`` are pieces not after the first."""
    for row in range(len(time)):
        now, s, v, a, area = _at(pieces, now, time[row])
        jerk = 0.0
        if k > 0.0:
            then, s_old, v_old, a_old, area_old = _at(pieces, then, time[row] - k)
            jerk = (a - a_old) / k
            a = (v - v_old) / k
            v = (s - s_old) / k
            s = (area - area_old) / k
        law[0][row], law[1][row], law[2][row], law[3][row] = v, a, jerk, s


@njit(cache=True, nogil=True)
def _moves(path, begins, move):
    """Write the move each planned path lies in; it never goes back to an earlier one."""
    i, last = 0, len(begins) - 2
    for row in range(len(path)):
        while i < last and path[row] >= begins[i + 1]:
            i += 1
        move[row] = i


@njit(cache=True, nogil=True)
def _savings(moves, first, behind, size, saving):
    """Write the length of moves in space (0 for a turn on the spot) and how much their corners shorten it."""
    start, end, length, blend = moves
    for i in range(first, behind):
        size[i] = math.sqrt(_product(start, end, i, i))
        saving[i] = 0.0
        if blend[i] > 0.0 and i + 1 < len(length):
            join = blend[i] * math.sqrt(_product(start, end, i + 1, i + 1)) / length[i + 1]
            saving[i] = join + _short_of_vertex(moves, i, 1.0)


@njit(cache=True, nogil=True)
def _place(move, moves, begins, way_to, saved_to, law, places, part, corner):
    """Write places (position, tangent), part, corner; over ``law`` the magnitudes in space and arc length."""
    position, direction = places
    start, end, length, blend = moves
    speed, acceleration, jerk_of, path = law
    u, w = np.zeros(3), np.zeros(3)
    first, second = np.zeros(3), np.zeros(3)
    for row in range(len(move)):
        i = move[row]
        v, a, jerk = speed[row], acceleration[row], jerk_of[row]
        inside = min(max(path[row] - begins[i], 0.0), length[i])
        d_end = blend[i]
        d_start = blend[i - 1] if i > 0 else 0.0
        for c in range(3):
            u[c] = (end[i, c] - start[i, c]) / length[i] if length[i] > 0.0 else 0.0
            second[c] = 0.0
        share = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
        travelled, saved = way_to[i], saved_to[i]
        way = travelled + inside * share - saved
        if d_end > 0.0 and inside > length[i] - d_end:
            j, tau, d = i, (inside - length[i] + d_end) / (2.0 * d_end), d_end
            way = travelled + length[i] * share - saved - _short_of_vertex(moves, j, tau)
        elif d_start > 0.0 and inside < d_start:
            j, tau, d = i - 1, (inside + d_start) / (2.0 * d_start), d_start
            way = travelled - saved_to[j] - _short_of_vertex(moves, j, tau)
        else:
            j, tau, d = -1, 0.0, 0.0
        if j < 0:
            for c in range(3):
                position[row, c] = start[i, c] + u[c] * inside
                first[c] = u[c]
                if inside == length[i]:
                    position[row, c] = end[i, c]
        else:
            for c in range(3):
                u[c] = (end[j, c] - start[j, c]) / length[j]
                w[c] = (end[j + 1, c] - start[j + 1, c]) / length[j + 1]
                position[row, c] = end[j, c] + d * (tau * tau * w[c] - (1.0 - tau) * (1.0 - tau) * u[c])
                first[c] = (1.0 - tau) * u[c] + tau * w[c]
                second[c] = (w[c] - u[c]) / (2.0 * d)
        speed2, acceleration2, jerk2 = 0.0, 0.0, 0.0
        for c in range(3):
            speed2 += (first[c] * v) ** 2
            acceleration2 += (first[c] * a + second[c] * v * v) ** 2
            jerk2 += (first[c] * jerk + 3.0 * second[c] * v * a) ** 2
        steep = math.sqrt(first[0] * first[0] + first[1] * first[1] + first[2] * first[2])
        for c in range(3):
            direction[row, c] = first[c] / steep if steep > 0.0 else 0.0
        speed[row], acceleration[row] = math.sqrt(speed2), math.sqrt(acceleration2)
        jerk_of[row], path[row] = math.sqrt(jerk2), way
        part[row] = inside / length[i] if length[i] > 0.0 else 1.0
        corner[row] = j >= 0


@njit(cache=True, nogil=True)
def _product(start, end, i, j):
    """Return the product of two moves as vectors."""
    dot = 0.0
    for c in range(3):
        dot += (end[i, c] - start[i, c]) * (end[j, c] - start[j, c])
    return dot


@njit(cache=True, nogil=True)
def _short_of_vertex(moves, i, tau):
    """Return how much path is left to the vertex at fraction tau of the corner after move i."""
    start, end, length, blend = moves
    uu = _product(start, end, i, i) / length[i] ** 2
    ww = _product(start, end, i + 1, i + 1) / length[i + 1] ** 2
    uw = _product(start, end, i, i + 1) / (length[i] * length[i + 1])
    return blend[i] * (math.sqrt(uu) - 2.0 * arc_length(tau, uu, uw, ww))
