"""Speed along a chain of moves, as the planner has it before the last moving average.

The programmed speeds become pieces of constant acceleration: ramps of slope a (the first average of the law),
constant speed, standstill. The second average, of length k, is applied when the motion is sampled. Both laws
of the controller model differ only where a move is too short to reach its speed: ``averages`` lets the ramps
up and down overlap (their sum), ``trapezoid`` accelerates with a until it must brake.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from gcode2krl.arrays import Bools, Floats, Ints

_ROOM = 0.8
"""A move that a slow place slows down over more than this fraction of its length is slow as a whole."""
_NEARLY, _SHORT = 0.99, 4.0
"""So is a move shorter than `_SHORT` times the reach of a place that is only slightly slower: chords of an
arc differ by the micrometre they are rounded to, which must not decide their speed."""
UNLIMITED = -1
"""Number of moves in view if the look-ahead model is off."""


class Profile(NamedTuple):
    """Pieces of constant acceleration, by time."""

    time_s: Floats
    path_mm: Floats
    speed_mm_s: Floats
    acceleration_mm_s2: Floats
    integral_mm_s: Floats
    """Integral of the path over time up to the piece."""
    move_end_s: Floats
    """(n,) time at which each move ends, before the last average."""
    total_s: float


def plan_profile(
    length_mm: Floats,
    speed_mm_s: Floats,
    blend_mm: Floats,
    stop: Bools,
    wait_s: Floats,
    a_mm_s2: Floats | float,
    k_s: float,
    moves_in_view: int,
    averages: bool,
) -> Profile:
    """Plan a chain of n moves that starts and ends at rest.

    Parameters
    ----------
    length_mm, speed_mm_s : (n,) of each move.
    blend_mm : (n,) distance before and after the end of a move within which the corner is blended.
    stop : (n,) True where the end of a move is an exact stop.
    wait_s : (n,) dwell after that stop.
    a_mm_s2 : a number, or (n,) where the moves are scaled (see `Chain.scale`).
    moves_in_view : ``$ADVANCE``, or `UNLIMITED`.
    averages : the law; False = trapezoid.
    """
    if len(length_mm) == 0:
        rest = np.zeros(1)
        return Profile(rest, rest, rest, rest, rest, np.zeros(0), 0.0)
    acceleration = np.ascontiguousarray(np.broadcast_to(np.asarray(a_mm_s2, dtype=float), length_mm.shape))
    bound = _vertex_speeds(length_mm, speed_mm_s, stop, acceleration, k_s, moves_in_view)
    last = _run_ends(speed_mm_s, acceleration, bound)
    first = np.concatenate([[0], last[:-1] + 1])
    length = np.add.reduceat(length_mm, first)
    vertex = np.concatenate([[0.0], bound[last + 1]])
    head, tail, top = _margins(length, speed_mm_s[first], blend_mm[last], stop[last], vertex, k_s)
    run_acceleration = acceleration[first]
    _reachable(length - head - tail, vertex, run_acceleration)
    pieces = np.empty((5, 6 * len(length) + 2))
    used, total = _pieces(
        length, top, stop[last], wait_s[last], vertex, head, tail, run_acceleration, k_s, averages, pieces
    )
    t, s, v, a, i = (np.ascontiguousarray(column[:used]) for column in pieces)
    move_end = np.empty(len(length_mm))
    _move_ends(np.cumsum(length_mm), t, s, v, a, move_end)
    return Profile(t, s, v, a, i, move_end, total)


def _run_ends(speed_mm_s: Floats, a_mm_s2: Floats, bound_mm_s: Floats) -> Ints:
    """Return the last move of each run: moves of one speed whose inner vertices do not slow it down.

    Such a run is one programmed rectangle to the law, however many moves it has.
    """
    held_back = bound_mm_s[1:] < speed_mm_s
    held_back[:-1] |= (speed_mm_s[1:] != speed_mm_s[:-1]) | (a_mm_s2[1:] != a_mm_s2[:-1])
    held_back[-1] = True
    return np.flatnonzero(held_back)


@njit(cache=True)
def _vertex_speeds(length, speed, stop, a, k, in_view):
    """Upper bound (n + 1,) of the speed at each vertex: programmed, stops, look-ahead.

    Look-ahead (an assumption, the controller's planning is not published): at the end of a move only the next
    ``in_view`` moves are known, and a stop at their end must be possible: v·(v/a + k)/2 <= the length in
    view.
    """
    count = len(length)
    vertex = np.zeros(count + 1)
    for i in range(count - 1):
        if stop[i]:
            continue
        bound = min(speed[i], speed[i + 1])
        if in_view >= 0:
            seen = 0.0
            for j in range(i + 1, min(i + 1 + in_view, count)):
                seen += length[j]
                if stop[j]:
                    break
            ak = a[i] * k
            bound = min(bound, 0.5 * (math.sqrt(ak * ak + 8.0 * a[i] * seen) - ak))
        vertex[i + 1] = bound
    return vertex


@njit(cache=True)
def _margins(length, speed, blend, stop, vertex, k):
    """Return (head, tail, top) of each run: the lengths at the speeds of its ends, and its own top speed.

    Slowing down ends where the corner begins, speeding up begins where it ends; v·k/2 is the length over
    which the last average spreads that point. A margin longer than the run reaches into the next; ``vertex``
    is lowered there.
    """
    count = len(length)
    head, tail, top = np.zeros(count), np.zeros(count), speed.copy()
    bound = vertex.copy()
    _heads_behind_slow_places(length, blend, stop, bound, k, vertex, head, top)
    _tails_before_slow_places(length, blend, stop, bound, k, vertex, head, tail, top)
    for i in range(count):
        if top[i] <= vertex[i]:
            head[i] = 0.0
        if top[i] <= vertex[i + 1]:
            tail[i] = 0.0
        if head[i] + tail[i] > _ROOM * length[i]:
            head[i], tail[i] = 0.0, 0.0
        vertex[i] = min(vertex[i], top[i])
        vertex[i + 1] = min(vertex[i + 1], top[i])
    return head, tail, top


@njit(cache=True)
def _heads_behind_slow_places(length, blend, stop, bound, k, vertex, head, top):
    """Write what each run keeps, at its begin, of the lower speed ``bound`` of the corners before it."""
    for i in range(1, len(length)):
        way = 0.0
        for j in range(i, 0, -1):
            if stop[j - 1]:
                break
            reach = blend[j - 1] + 0.5 * bound[j] * k - way
            if bound[j] < top[i] and reach > 0.0:
                if reach > _ROOM * length[i] or _is_alike(bound[j], top[i], reach, length[i]):
                    top[i] = bound[j]
                else:
                    head[i] = max(head[i], reach)
                if reach >= length[i]:
                    vertex[i + 1] = min(vertex[i + 1], bound[j])
            way += length[j - 1]
            if way > blend[j - 1] + 0.5 * top[i] * k:
                break


@njit(cache=True)
def _tails_before_slow_places(length, blend, stop, bound, k, vertex, head, tail, top):
    """Write what each run takes on, at its end, of the lower speed ``bound`` of the corners after it."""
    count = len(length)
    for i in range(count - 2, -1, -1):
        way = 0.0
        for j in range(i, count - 1):
            if stop[j]:
                break
            reach = blend[j] + 0.5 * bound[j + 1] * k - way
            if bound[j + 1] < top[i] and reach > 0.0:
                if reach + head[i] > _ROOM * length[i] or _is_alike(bound[j + 1], top[i], reach, length[i]):
                    top[i] = bound[j + 1]
                else:
                    tail[i] = max(tail[i], reach)
                if reach >= length[i]:
                    vertex[i] = min(vertex[i], bound[j + 1])
            way += length[j + 1]
            if way > blend[j] + 0.5 * top[i] * k:
                break


@njit(cache=True)
def _is_alike(slow, fast, reach, length):
    """Tell whether a short move may run at the speed of a slow place beside it."""
    return slow > _NEARLY * fast and length < _SHORT * reach


@njit(cache=True)
def _reachable(length, vertex, a):
    """Lower the vertex speeds to those that can be reached and braked with a."""
    for i in range(len(length) - 1, -1, -1):
        vertex[i] = min(vertex[i], math.sqrt(vertex[i + 1] ** 2 + 2.0 * a[i] * max(length[i], 0.0)))
    for i in range(len(length)):
        vertex[i + 1] = min(vertex[i + 1], math.sqrt(vertex[i] ** 2 + 2.0 * a[i] * max(length[i], 0.0)))


@njit(cache=True)
def phases(length, v, u0, u1, a, averages):
    """Durations of running up, constant speed and slowing down of a move from u0 to u1 at most at v."""
    if averages:
        up, down = (v - u0) / a, (v - u1) / a
        total = (length + 0.5 * (v - u0) * up + 0.5 * (v - u1) * down) / v
        if total >= up and total >= down:
            if total >= up + down:
                return up, total - up - down, down
            return total - down, up + down - total, total - up  # the ramps overlap and add
    top = min(v, math.sqrt(0.5 * (2.0 * a * length + u0 * u0 + u1 * u1)))
    top = max(top, u0, u1)
    constant = (length - (top * top - u0 * u0) / (2.0 * a) - (top * top - u1 * u1) / (2.0 * a)) / top
    return (top - u0) / a, max(0.0, constant), (top - u1) / a


# each branch is a phase of the time law, and the pieces follow each other in one running sum
@njit(cache=True)
def _pieces(length, speed, stop, wait, vertex, head, tail, a, k, averages, out):
    """Write the pieces (time, path, speed, acceleration, integral); return how many and the total time."""
    used = 0
    t, s, area = 0.0, 0.0, 0.0
    count = len(length)
    for i in range(count):
        start = s
        u0, u1 = vertex[i], vertex[i + 1]
        main = length[i] - head[i] - tail[i]
        rise, level, fall = 0.0, 0.0, 0.0
        if main > 0.0:
            rise, level, fall = phases(main, speed[i], u0, u1, a[i], averages)
        steps = (
            (head[i] / u0 if head[i] > 0.0 else 0.0, u0, 0.0),
            (rise, u0, a[i]),
            (level, u0 + a[i] * rise, 0.0),
            (fall, u0 + a[i] * rise, -a[i]),
            (tail[i] / u1 if tail[i] > 0.0 else 0.0, u1, 0.0),
        )
        for duration, v, acceleration in steps:
            if duration <= 0.0:
                continue
            same = used > 0 and acceleration == 0.0 and out[3, used - 1] == 0.0 and out[2, used - 1] == v
            if not same:
                out[0, used], out[1, used], out[2, used], out[3, used], out[4, used] = (
                    t,
                    s,
                    v,
                    acceleration,
                    area,
                )
                used += 1
            area += s * duration + v * duration**2 / 2.0 + acceleration * duration**3 / 6.0
            s += v * duration + acceleration * duration**2 / 2.0
            t += duration
        drift = start + length[i] - s
        if abs(drift) > 1e-9:
            s = start + length[i]
        if stop[i] or i == count - 1:
            rest = k if length[i] > 0.0 else 0.0  # a standstill has nothing to smooth
            rest += wait[i] if i < count - 1 else 0.0
            if rest > 0.0:
                out[0, used], out[1, used], out[2, used], out[3, used], out[4, used] = t, s, 0.0, 0.0, area
                used += 1
                area += s * rest
                t += rest
    out[0, used], out[1, used], out[2, used], out[3, used], out[4, used] = t, s, 0.0, 0.0, area
    return used + 1, t


@njit(cache=True)
def _move_ends(path_end, time, path, speed, acceleration, move_end):
    """Write the time (n,) at which each move ends, before the last average."""
    piece, last = 0, len(time) - 1
    for i in range(len(path_end)):
        while piece < last and path[piece + 1] < path_end[i] - 1e-9:
            piece += 1
        way = max(0.0, path_end[i] - path[piece])
        v, a = speed[piece], acceleration[piece]
        faster = v + math.sqrt(max(0.0, v * v + 2.0 * a * way))
        move_end[i] = time[piece] + (2.0 * way / faster if faster > 0.0 else 0.0)
