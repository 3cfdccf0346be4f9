"""External axes that move along a pass that is longer than the arm reaches.

Among the places from which the arm reaches, the track is chosen along which it bends least, as far as that is
worth the way of the axis. Around the track a corridor is left in which the arm bends hardly more, and through
that the axis goes the shortest way, evenly along the path.
"""

from collections.abc import Callable

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.program.places import (
    GOOD,
    LEAST,
    Range,
    cheapest_track,
    cost_of_bending,
    cost_of_places,
    cost_of_ways,
    widest,
    with_others_best,
)

BendingHere = Callable[[Ints, Floats], Floats]
"""Rows (r,) of the targets and E1 to E6 (6,) to how far the arm bends (r,), in the branch of the program."""

_NEARLY = 0.5
"""Share of the quality on the track with which the corridor is content."""
_SOFTER = 0.1
"""In the corridor the arm bends at most by so much more than at the stiffest place of a row."""


def moved_along(
    position_mm: Floats,
    run: Ints,
    judged: Ints,
    table: Floats,
    bending: BendingHere | None,
    places: Floats,
    ranges: list[Range],
) -> Floats:
    """Return E1 to E6 (r, 6) along a pass: the axis of the widest range moves, the others help.

    ``table`` (places, judged) is the quality of the judged rows. Without ``bending`` stiffness does not
    count.
    """
    own, axis = with_others_best(table[:, :, None], places, ranges), widest(ranges)
    places, quality = places[own], table[own].T
    bent = np.ones(quality.shape)
    if bending is not None:
        bent = np.stack([bending(judged, place) for place in places], axis=1)
    bent = np.where((quality >= LEAST) & np.isfinite(bent), bent, np.inf)
    low, high = _corridor(places, quality, bent, axis)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position_mm[run], axis=0), axis=1))])
    at = way[np.searchsorted(run, judged)]
    external = np.tile(places[0], (len(run), 1))
    external[:, axis.column] = np.interp(way, at, taut(at, low, high))
    return external


def _corridor(places: Floats, quality: Floats, bent: Floats, axis: Range) -> tuple[Floats, Floats]:
    """Return between which places (n,) and (n,) of an axis the arm reaches the rows well and bends little.

    ``quality`` (n, k) and ``bent`` (n, k) are those of the rows at the places (k, 6).
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
