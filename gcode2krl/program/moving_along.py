"""External axes that move along a pass that is longer than the arm reaches.

Among the places from which the arm reaches, the track is chosen along which it bends least, as far as that is
worth the way of the axis. Around the track a corridor is left in which the arm bends hardly more, and through
that the axis goes the shortest way, evenly along the path.
"""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.program.places import (
    GOOD,
    LEAST,
    MOST_THAT_BEND,
    Bending,
    Range,
    bent_at,
    cheapest_track,
    cost_of_bending,
    cost_of_places,
    cost_of_ways,
    widest,
    with_others_best,
)

_NEARLY = 0.5
"""Share of the quality on the track with which the corridor is content."""
_SOFTER = 0.1
"""In the corridor the arm bends at most by so much more than at the stiffest place of a row."""
_FEWEST_THAT_BEND = 3
_WITHIN = 1e-3
"""How far a way between targets may be from the shortest one, in mm or degrees."""
_INSIDE, _SLOWER = 1e4, 0.01
"""What leaving the corridor by 1 mm, and the largest slope over the whole way, cost beside the way itself."""


class Along(NamedTuple):
    """A pass that is longer than the arm reaches."""

    run: Ints
    """Its rows (r,)."""
    judged: Ints
    """Those of them (n,) that are judged."""
    quality: Floats
    """(n, k) of the judged rows at the places, in the branch of the program."""


def ways_along(
    position_mm: Floats,
    is_target: Bools,
    passes: list[Along],
    bending: Bending | None,
    branch: int,
    places: Floats,
    ranges: list[Range],
) -> list[Floats]:
    """Return E1 to E6 (r, 6) along each pass: the axis of the widest range moves, the others help.

    It changes its way at rows (p,) that are targets. Without ``bending`` stiffness does not count. With more
    passes fewer of their rows count by it, and none with very many.
    """
    axis = widest(ranges)
    helped = [with_others_best(each.quality[:, :, None], places, ranges) for each in passes]
    rows = MOST_THAT_BEND // max(sum(map(len, helped)), 1)
    ways = []
    for each, own in zip(passes, helped, strict=True):
        quality = each.quality[:, own]
        bent = np.full(quality.shape, np.inf)
        if bending is not None and rows >= _FEWEST_THAT_BEND:
            few = np.unique(np.linspace(0, len(quality) - 1, min(rows, len(quality))).astype(np.int64))
            bent[few] = bent_at(bending, branch, each.judged[few], places[own], quality[few] >= LEAST)
        low, high = _corridor(places[own], quality, bent, axis)
        way = _way_mm(position_mm[each.run])
        number = np.searchsorted(each.run, each.judged)
        external = np.tile(places[own[0]], (len(each.run), 1))
        knots, at_knots = _knots(way[number], low, high, is_target[each.judged])
        external[:, axis.column] = np.interp(way, knots, at_knots)
        ways.append(external)
    return ways


def _way_mm(position_mm: Floats) -> Floats:
    """Return the way (r,) from the first position to each (r, 3)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position_mm, axis=0), axis=1))])


def _knots(at: Floats, low: Floats, high: Floats, is_target: Bools) -> tuple[Floats, Floats]:
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
    none, one, off = np.zeros((rows, gaps + 1)), np.ones((rows, 1)), np.zeros((gaps, 1))
    bounds = [(None, None)] * knots + [(0.0, None)] * (gaps + 2)  # places, moves, largest slope, way off
    above = np.block(
        [
            [lines, none, -one],
            [-lines, none, -one],
            [steps, -np.eye(gaps), off, off],
            [-steps, -np.eye(gaps), off, off],
            [np.zeros((gaps, knots)), np.eye(gaps), -span, off],
        ]
    )
    most = np.concatenate([high, -low, np.zeros(3 * gaps)])
    cost = np.concatenate([np.zeros(knots), np.ones(gaps), [_SLOWER * float(at[-1] - at[0]), _INSIDE]])
    found = linprog(cost, A_ub=above, b_ub=most, bounds=bounds)
    return np.asarray(found.x[:knots])


def _corridor(places: Floats, quality: Floats, bent: Floats, axis: Range) -> tuple[Floats, Floats]:
    """Return between which places (n,) and (n,) of an axis the arm reaches the rows well and bends little.

    ``quality`` (n, k) and ``bent`` (n, k) are those of the rows at the places (k, 6); inf where it does not
    count.
    """
    cost = (cost_of_places(quality) + cost_of_bending(bent)) / len(quality)
    ways = cost_of_ways(places, places, [axis])
    track = cheapest_track(cost, lambda _: ways)
    rows = np.arange(len(track))
    enough = np.maximum(LEAST, _NEARLY * np.minimum(quality[rows, track], GOOD))
    stiff = bent <= (1.0 + _SOFTER) * np.min(bent, axis=1, keepdims=True)
    beside = np.abs(np.arange(len(places)) - track[:, None]) <= 1  # so that coarse places make no stairs
    within = (quality >= enough[:, None]) & (stiff | beside)
    within[rows, track] = True
    ends = np.array([_around(place, here) for place, here in zip(track.tolist(), within, strict=True)])
    at = places[:, axis.column]
    return at[ends[:, 0]], at[ends[:, 1]]


def _around(place: int, within: Bools) -> tuple[int, int]:
    """Return the first and the last of the places (k,) around one that are within."""
    outside = np.flatnonzero(~within)
    number = int(np.searchsorted(outside, place))
    first = int(outside[number - 1]) + 1 if number > 0 else 0
    last = int(outside[number]) - 1 if number < len(outside) else len(within) - 1
    return first, last


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
