"""External axes that move along a pass that is longer than the arm reaches.

The axis goes as little and as evenly as the reach allows: the shortest line through the corridor of places
from which the arm reaches.
"""

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.program.places import GOOD, LEAST, Range, widest, with_others_best

_NEARLY = 0.7
"""Share of the best quality with which an axis that moves along is content."""


def moved_along(
    position_mm: Floats, run: Ints, judged: Ints, table: Floats, places: Floats, ranges: list[Range]
) -> Floats:
    """Return E1 to E6 (r, 6) along a pass: the axis of the widest range moves, the others help.

    ``table`` (places, judged) is the quality of the judged rows.
    """
    own, axis = with_others_best(table[:, :, None], places, ranges), widest(ranges)
    column = places[own, axis.column]
    low, high = np.array([_corridor(column, table[own, k]) for k in range(len(judged))]).T
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position_mm[run], axis=0), axis=1))])
    at = way[np.searchsorted(run, judged)]
    external = np.tile(places[own[0]], (len(run), 1))
    external[:, axis.column] = np.interp(way, at, taut(at, low, high))
    return external


def _corridor(places: Floats, quality: Floats) -> tuple[float, float]:
    """Return the first and the last place around the best one that are good, or nearly as good as that."""
    best = int(np.argmax(np.minimum(quality, GOOD) - 1e-6 * np.abs(np.arange(len(places)) - len(places) / 2)))
    enough = max(LEAST, min(GOOD, _NEARLY * float(quality[best])))
    first = last = best
    while first > 0 and quality[first - 1] >= enough:
        first -= 1
    while last + 1 < len(places) and quality[last + 1] >= enough:
        last += 1
    return float(places[first]), float(places[last])


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
