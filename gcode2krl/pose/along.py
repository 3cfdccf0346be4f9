"""How an external axis moves while the tool cuts: through a corridor of places, or as a table that follows.

Through the corridor of places from which the arm reaches, the axis goes the shortest way, evenly.

A turntable may follow a five-axis program: it turns as that of a machine with a rotary table would. The robot
can tilt the tool any way, so the table need not turn. Where it does, the tool keeps to one plane through the
table's axis as seen from the robot, and the arm hardly turns: with a the tool axis in ``$BASE`` and z the
table's, the table stands at minus the azimuth of a about z, but for a constant.
"""

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.units import DEG_PER_RAD

_WITHIN = 1e-3
"""How far a way between targets may be from the shortest one, in mm or degrees."""
_INSIDE, _SLOWER = 1e4, 0.01
"""What leaving the corridor by 1 mm, and the largest slope over the whole way, cost beside the way itself."""
_UPRIGHT_SINE = 0.01
"""A tool that is tilted less points nowhere, 0.6 degrees."""


def knots_through(at: Floats, low: Floats, high: Floats, is_target: Bools) -> tuple[Floats, Floats]:
    """Return where on the way (q,), and at which place (q,), an axis may change its way: at targets.

    Between ``low`` and ``high`` (n,) at all rows, also at points between targets.
    """
    at, first = np.unique(at, return_index=True)
    low, high = np.maximum.reduceat(low, first), np.minimum.reduceat(high, first)
    knot = np.flatnonzero(np.logical_or.reduceat(is_target, first))
    line = taut(at, low, np.maximum(low, high))
    if np.abs(np.interp(at, at[knot], line[knot]) - line).max() <= _WITHIN:
        return at[knot], line[knot]
    return at[knot], _least_moved(at, low, high, knot)


def _least_moved(at: Floats, low: Floats, high: Floats, knot: Ints) -> Floats:
    """Return the places (q,) at knots between which straight lines leave the corridor (n,) least.

    Of those the ones that move least, then those that are slowest: a linear program.
    """
    from scipy.optimize import linprog

    rows, knots, gaps = len(at), len(knot), len(knot) - 1
    lines = np.array([np.interp(at, at[knot], row) for row in np.eye(knots)]).T
    steps, span = np.diff(np.eye(knots), axis=0), np.diff(at[knot])[:, None]
    none, off_way, off = np.zeros((rows, gaps + 1)), np.ones((rows, 1)), np.zeros((gaps, 1))
    bounds = [(None, None)] * knots + [(0.0, None)] * (gaps + 2)  # places, moves, largest slope, way off
    above = np.block(
        [
            [lines, none, -off_way],
            [-lines, none, -off_way],
            [steps, -np.eye(gaps), off, off],
            [-steps, -np.eye(gaps), off, off],
            [np.zeros((gaps, knots)), np.eye(gaps), -span, off],
        ]
    )
    most = np.concatenate([high, -low, np.zeros(3 * gaps)])
    cost = np.concatenate([np.zeros(knots), np.ones(gaps), [_SLOWER * float(at[-1] - at[0]), _INSIDE]])
    solution = linprog(cost, A_ub=above, b_ub=most, bounds=bounds)
    return np.asarray(solution.x[:knots])


def taut(at: Floats, low: Floats, high: Floats) -> Floats:
    """Return the shortest line (n,) over rising ``at`` (n,) that keeps between ``low`` and ``high`` (n,).

    From each knot it goes as far as it can be seen, which is where the bound that closes the view is touched.
    """
    value = np.empty(len(at))
    start, here = 0, _level(low, high)
    value[0] = here
    while start < len(at) - 1:
        steepest, flattest = np.inf, -np.inf
        by_high = by_low = start
        end = len(at)
        for k in range(start + 1, len(at)):
            span = max(at[k] - at[start], 1e-9)
            up, down = (high[k] - here) / span, (low[k] - here) / span
            if down > steepest or up < flattest:
                end = by_high if down > steepest else by_low
                slope = steepest if down > steepest else flattest
                break
            if up <= steepest:
                steepest, by_high = up, k
            if down >= flattest:
                flattest, by_low = down, k
        else:  # the end is in sight: level if that is within it, else to the bound that is in the way
            slope = min(max(0.0, flattest), steepest)
            end = by_low if slope > 0.0 else by_high if slope < 0.0 else end
        last = min(end, len(at) - 1)
        value[start + 1 : last + 1] = here + slope * (at[start + 1 : last + 1] - at[start])
        here, start = float(value[last]), last
    return value


def _level(low: Floats, high: Floats) -> float:
    """Return where a level line begins that stays between the bounds as long as it can."""
    bottom, top = -np.inf, np.inf
    for lowest, highest in zip(low, high, strict=True):
        if lowest > top:
            return float(top)
        if highest < bottom:
            return float(bottom)
        bottom, top = max(bottom, lowest), min(top, highest)
    return float((bottom + top) / 2.0)


def following_deg(tool_axis: Floats, table_axis: Floats) -> Floats:
    """Return the angles (p,) in deg of a table that keeps tilted tools in one plane, without full turns.

    Parameters
    ----------
    tool_axis : (p, 3) unit vectors in ``$BASE``.
    table_axis : (3,) unit vector in ``$BASE``; a positive angle turns the table right-handed about it.
    """
    side = np.eye(3)[int(np.argmin(np.abs(table_axis)))]
    x = np.cross(table_axis, np.cross(side, table_axis))
    x /= np.linalg.norm(x)
    y = np.cross(table_axis, x)
    across, along = tool_axis @ y, tool_axis @ x
    tilted = np.flatnonzero(np.hypot(across, along) > _UPRIGHT_SINE)
    if not len(tilted):
        return np.zeros(len(tool_axis))
    azimuth = np.unwrap(np.arctan2(across[tilted], along[tilted]))
    place = np.arange(len(tool_axis))
    turned: Floats = -np.interp(place, tilted, azimuth) * DEG_PER_RAD
    return np.asarray(turned - turned[0])
