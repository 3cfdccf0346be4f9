"""Speed along a chain of moves, as the planner has it before the last moving average.

The programmed speeds become pieces of constant acceleration: ramps of slope a (the first average of the law),
constant speed, standstill. The second average, of length k, is applied when the motion is sampled. Both laws
of the controller model differ only where a move is too short to reach its speed: ``averages`` lets the ramps
up and down overlap (their sum), ``trapezoid`` accelerates with a until it must brake.
"""

import math
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.compiled.core import BOOLS, FLOAT, FLOATS, INT, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import contiguous

UNLIMITED = -1
"""Number of moves in view if the look-ahead model is off."""

_vertex_speeds = core_function("krc4_vertex_speeds", FLOATS, FLOATS, BOOLS, FLOATS, FLOAT, INT, OUT_FLOATS)
_margins = core_function(
    "krc4_margins", FLOATS, FLOATS, BOOLS, FLOATS, FLOAT, OUT_FLOATS, OUT_FLOATS, OUT_FLOATS, OUT_FLOATS
)
_reachable = core_function("krc4_reachable", FLOATS, OUT_FLOATS, FLOATS)
_pieces = core_function(
    "krc4_pieces",
    *(FLOATS, FLOATS, BOOLS, FLOATS, FLOATS, FLOATS, FLOATS, FLOATS, FLOAT, INT),
    *(OUT_FLOATS, OUT_FLOATS),
    returns=INT,
)
_move_ends = core_function("krc4_move_ends", FLOATS, FLOATS, FLOATS, FLOATS, FLOATS, OUT_FLOATS)


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
    by_other_law_s: float = math.nan
    """How long it would last by the other law, where both were asked for."""


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
    *,
    pieces: bool = True,
    both_laws: bool = False,
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
    pieces : False where only ``total_s`` is wanted: the columns are empty.
    both_laws : True where ``by_other_law_s`` is wanted, too.
    """
    if len(length_mm) == 0:
        standstill = np.zeros(1)
        return Profile(standstill, standstill, standstill, standstill, standstill, np.zeros(0), 0.0)
    length_mm, speed_mm_s, blend_mm, wait_s = map(contiguous, (length_mm, speed_mm_s, blend_mm, wait_s))
    acceleration = np.ascontiguousarray(np.broadcast_to(np.asarray(a_mm_s2, dtype=float), length_mm.shape))
    bound = np.empty(len(length_mm) + 1)
    _vertex_speeds(length_mm, speed_mm_s, stop, acceleration, k_s, moves_in_view, bound)
    last = _run_ends(speed_mm_s, acceleration, bound)
    first = np.concatenate([[0], last[:-1] + 1])
    length, run_stop = np.add.reduceat(length_mm, first), stop[last]
    vertex, top = np.concatenate([[0.0], bound[last + 1]]), speed_mm_s[first]
    head, tail = np.zeros((2, len(length)))
    _margins(length, blend_mm[last], run_stop, vertex.copy(), k_s, vertex, head, tail, top)
    run_acceleration = acceleration[first]
    _reachable(length - head - tail, vertex, run_acceleration)
    table, total_s = np.empty((5, 6 * len(length) + 2 if pieces else 0)), np.empty(1)
    runs = length, top, run_stop, wait_s[last], vertex, head, tail, run_acceleration, k_s
    by_other_s = np.full(1, np.nan)
    if both_laws:
        _pieces(*runs, not averages, np.empty((5, 0)), by_other_s)
    used = _pieces(*runs, averages, table, total_s)
    t, s, v, a, i = (column[:used] for column in table)
    move_end = np.empty(len(length_mm) if pieces else 0)
    if pieces:
        _move_ends(np.cumsum(length_mm), t, s, v, a, move_end)
    return Profile(t, s, v, a, i, move_end, float(total_s[0]), float(by_other_s[0]))


def _run_ends(speed_mm_s: Floats, a_mm_s2: Floats, bound_mm_s: Floats) -> Ints:
    """Return the last move of each run: moves of one speed whose inner vertices do not slow it down.

    Such a run is one programmed rectangle to the law, however many moves it has.
    """
    held_back = bound_mm_s[1:] < speed_mm_s
    held_back[:-1] |= (speed_mm_s[1:] != speed_mm_s[:-1]) | (a_mm_s2[1:] != a_mm_s2[:-1])
    held_back[-1] = True
    return np.flatnonzero(held_back)
