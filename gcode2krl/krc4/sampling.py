"""From the planned pieces to samples: the last moving average, corners, positions and their derivatives."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcode2krl.krc4.profile import Profile

Floats = NDArray[np.float64]


def sample_times(profile: Profile, dt_s: float) -> Floats:
    """Return the sample times (m,) in s, the last one at or behind the end of the motion."""
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
) -> tuple[Floats, Floats, NDArray[np.int64], Floats]:
    """Return positions (m, 3), figures (m, 4) = speed, acceleration, jerk, arc length, move (m,), part (m,).

    ``part`` is the share of the move that is done; inside a corner the position lies on
    the parabola. ``blend_mm`` (n,) belongs to the end of each move.
    """
    position, figures = np.empty((len(time_s), 3)), np.empty((len(time_s), 4))
    move, part = np.empty(len(time_s), dtype=np.int64), np.empty(len(time_s))
    pieces = (
        profile.time_s,
        profile.path_mm,
        profile.speed_mm_s,
        profile.acceleration_mm_s2,
        profile.integral_mm_s,
    )
    _sample(time_s, pieces, start_mm, end_mm, length_mm, blend_mm, k_s, position, figures, move, part)
    return position, figures, move, part


@njit(cache=True)
def arc_length(tau, uu, uw, ww):
    """Length of the parabola's share tau, in units of 2·d: the integral of |(1 - t)·u + t·w| from 0 to tau.

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


@njit(cache=True)
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


@njit(cache=True)
def _sample(time, pieces, start, end, length, blend, k, position, figures, move, part):
    count = len(length)
    now, then = 0, 0
    i = 0
    begin = 0.0  # planned path at the start of move i
    travelled = 0.0  # the same in space: a reorientation on the spot has none
    saved = 0.0  # how much shorter the corners behind are than their lines
    u, w = np.zeros(3), np.zeros(3)
    first, second = np.zeros(3), np.zeros(3)
    for row in range(len(time)):
        now, s, v, a, area = _at(pieces, now, time[row])
        jerk = 0.0
        if k > 0.0:
            then, s_old, v_old, a_old, area_old = _at(pieces, then, time[row] - k)
            jerk = (a - a_old) / k
            a = (v - v_old) / k
            v = (s - s_old) / k
            s = (area - area_old) / k
        while i < count - 1 and s >= begin + length[i]:
            travelled += math.sqrt(_product(start, end, i, i))
            if blend[i] > 0.0:  # leaving the move behind leaves its corner's middle behind
                saved += _saving(start, end, length, blend, i)
            begin += length[i]
            i += 1
        inside = min(max(s - begin, 0.0), length[i])
        d_end = blend[i]
        d_start = blend[i - 1] if i > 0 else 0.0
        for c in range(3):
            u[c] = (end[i, c] - start[i, c]) / length[i] if length[i] > 0.0 else 0.0
            second[c] = 0.0
        share = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
        way = travelled + inside * share - saved
        if d_end > 0.0 and inside > length[i] - d_end:
            j, tau, d = i, (inside - length[i] + d_end) / (2.0 * d_end), d_end
            way = travelled + length[i] * share - saved - _short_of_vertex(start, end, length, blend, j, tau)
        elif d_start > 0.0 and inside < d_start:
            j, tau, d = i - 1, (inside + d_start) / (2.0 * d_start), d_start
            before = saved - _saving(start, end, length, blend, j)
            way = travelled - before - _short_of_vertex(start, end, length, blend, j, tau)
        else:
            j, tau, d = -1, 0.0, 0.0
        if j < 0:
            for c in range(3):
                position[row, c] = start[i, c] + u[c] * inside
                first[c] = u[c]
            if inside == length[i]:
                position[row] = end[i]
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
        figures[row, 0], figures[row, 1] = math.sqrt(speed2), math.sqrt(acceleration2)
        figures[row, 2], figures[row, 3] = math.sqrt(jerk2), way
        move[row] = i
        part[row] = inside / length[i] if length[i] > 0.0 else 1.0


@njit(cache=True)
def _product(start, end, i, j):
    """Return the product of two moves as vectors."""
    dot = 0.0
    for c in range(3):
        dot += (end[i, c] - start[i, c]) * (end[j, c] - start[j, c])
    return dot


@njit(cache=True)
def _short_of_vertex(start, end, length, blend, i, tau):
    """Return how far the path at share tau of the corner behind move i is short of the corner's vertex."""
    uu = _product(start, end, i, i) / length[i] ** 2
    ww = _product(start, end, i + 1, i + 1) / length[i + 1] ** 2
    uw = _product(start, end, i, i + 1) / (length[i] * length[i + 1])
    return blend[i] * (math.sqrt(uu) - 2.0 * arc_length(tau, uu, uw, ww))


@njit(cache=True)
def _saving(start, end, length, blend, i):
    """Return how much shorter the corner behind move i is than its two lines."""
    join = blend[i] * math.sqrt(_product(start, end, i + 1, i + 1)) / length[i + 1]
    return join + _short_of_vertex(start, end, length, blend, i, 1.0)
