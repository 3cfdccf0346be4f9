"""Where the external axes stand along a program: one place for all of it, one for each pass, or moving along.

A station is a place of E1 to E6. It changes on the clearance plane only, where nothing is cut: one station
for the whole program is the first choice, one for each pass the second. Of good places those count where the
robot bends least, then those that are near. Where a pass is longer than the arm reaches, the axis moves
along, as little and as evenly as the reach allows (the shortest line through the corridor of places from
which the arm reaches).
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints

Quality = Callable[[Ints, Floats], Floats]
"""Rows (r,) of the targets and E1 to E6 (6,) to the quality (r, 8) of each branch there: 1 = far from limits,
singularities and obstacles, 0 = at one, below 0 = hits something, -1 = impossible."""

Bending = Callable[[Ints, Floats], Floats]
"""Rows (r,) of the targets and E1 to E6 (6,) to how far each branch (r, 8) bends under a load, NaN where
impossible."""

GOOD = 0.3
"""Quality (1 = 30 degrees from limits and singularities) from which a place is as good as any better one."""
LEAST = 0.05
"""Quality below which a place is not taken."""
STEPS = 49
"""Places that are tried on an axis, so that a rail of 5 m has one every 100 mm."""
_REACHED = -0.99
"""Quality above which a place is reached, if only to hit something: that is a finding of its own."""
_NEARLY = 0.7
"""Share of the best quality with which an axis that moves along is content."""
_MOST_PLACES = 1000
_MOST_ROWS, _FEWEST_ROWS = 300, 3
_ROWS_A_PASS = 24
_MOST_POSES = 500_000
"""Poses that are judged for passes, some 20 us each; with more passes fewer rows of each are judged, and all
axes but the widest stay."""
_HITS_COST = 50.0
"""What a place costs at which something is hit, or nearly out of reach."""
_AS_STIFF = 0.05
"""Places that bend by so much more than the stiffest one count as equally stiff."""
_BENDS = 0.5
"""What a place costs at which the robot bends twice as far as at the best one for that pass; at most that."""
_ROWS_THAT_BEND, _ROWS_A_PASS_THAT_BEND = 24, 3
_MOVES = 0.5
"""What a way over the whole range between two passes costs, against a place of no quality at all."""
_STARTS = 0.05
"""What any way between two passes costs, so that there are few."""
_WHOLE = 5.0
"""Places that are farther from each other are whole numbers, where the limits are."""
_DECIMALS = 3
"""Those of the program's text."""


@dataclass(frozen=True)
class Range:
    """A free axis: its column in E1 to E6, and its limits."""

    column: int
    low: float
    high: float

    def places(self, steps: int) -> Floats:
        """Return places evenly over the range."""
        step = (self.high - self.low) / max(steps - 1, 1)
        places = np.round(np.linspace(self.low, self.high, steps), 0 if step > _WHOLE else _DECIMALS)
        return np.clip(places, self.low, self.high)


def plan_stations(
    position_mm: Floats,
    is_free: Bools,
    quality: Quality,
    ranges: list[Range],
    start: Floats,
    bending: Bending | None = None,
) -> Floats:
    """Return E1 to E6 (p, 6) at targets, one row in memory where they stay.

    Parameters
    ----------
    position_mm : (p, 3)
    is_free : (p,) True where the motion to the target is on the clearance plane, or a PTP.
    quality : of rows at a place.
    ranges : the axes that may be put somewhere else.
    start : (6,) where all axes are that may not, and that others are preferred to be near.
    bending : of rows at a place; None where stiffness does not count.
    """
    if not ranges:
        return np.broadcast_to(start, (len(position_mm), 6))
    places = _places(ranges, start)
    rows = _spread(np.arange(len(position_mm)), position_mm, _MOST_ROWS)
    table = np.stack([quality(rows, place) for place in places])  # (places, rows, branches)
    worst = table.min(axis=1).max(axis=1)
    if worst.max() >= LEAST:
        bent = _bent(bending, _spread(rows, position_mm, _ROWS_THAT_BEND), places, worst)
        return np.broadcast_to(places[_best(worst, bent, places, ranges, start)], (len(position_mm), 6))
    passes = np.cumsum(is_free, dtype=np.int64)
    if len(places) * (int(passes[-1]) + 1) * _FEWEST_ROWS > _MOST_POSES:
        places = places[_with_others_best(table, places, ranges)]
    return _by_pass(position_mm, passes, quality, bending, places, ranges)


def _places(ranges: list[Range], start: Floats) -> Floats:
    """Return the places (k, 6) that are tried: a grid over all free axes."""
    steps = STEPS
    while steps ** len(ranges) > _MOST_PLACES:
        steps -= 2
    grids = [axis.places(steps) for axis in ranges]
    places = np.tile(start, (int(np.prod([len(grid) for grid in grids])), 1))
    for axis, column in zip(ranges, np.array(list(itertools.product(*grids))).T, strict=True):
        places[:, axis.column] = column
    return places


def _best(worst: Floats, bent: Floats, places: Floats, ranges: list[Range], start: Floats) -> int:
    """Return the place of the best quality; of those that are good, the stiffest; of those, the nearest."""
    far = np.zeros(len(places))
    for axis in ranges:
        far += np.abs(places[:, axis.column] - start[axis.column]) / (axis.high - axis.low)
    quality = np.minimum(np.round(worst, 2), GOOD)
    candidates = np.flatnonzero(quality == quality.max())
    stiff = candidates[bent[candidates] <= (1.0 + _AS_STIFF) * bent[candidates].min()]
    return int(stiff[np.lexsort((-worst[stiff], far[stiff]))[0]])


def _bent(bending: Bending | None, rows: Ints, places: Floats, worst: Floats) -> Floats:
    """Return how far the robot bends (k,) at good places, in root mean square over rows; else 1 for all.

    ``worst`` (k,) is the quality of the places. Of the branches the stiffest counts that reaches all rows.
    """
    bent = np.ones(len(places))
    if bending is None or len(places) == 1:
        return bent
    for place in np.flatnonzero(worst >= min(GOOD, float(worst.max()))).tolist():
        square = np.mean(bending(rows, places[place]) ** 2, axis=0)
        bent[place] = np.sqrt(np.nanmin(square)) if np.isfinite(square).any() else np.inf
    return bent


def _by_pass(
    position_mm: Floats,
    passes: Ints,
    quality: Quality,
    bending: Bending | None,
    places: Floats,
    ranges: list[Range],
) -> Floats:
    """Return E1 to E6 (p, 6) with a station for each pass, or moving along in it."""
    borders = np.flatnonzero(np.diff(passes, prepend=-1, append=passes[-1] + 1))
    runs = [np.arange(a, b) for a, b in itertools.pairwise(borders)]
    most = int(np.clip(_MOST_POSES // (len(places) * len(runs)), _FEWEST_ROWS, _ROWS_A_PASS))
    judged = [_spread(run, position_mm, most) for run in runs]
    rows = np.concatenate(judged)
    table = np.stack([quality(rows, place) for place in places])
    ends = np.cumsum([0, *map(len, judged)])
    worst = np.stack([table[:, a:b].min(axis=1) for a, b in itertools.pairwise(ends)])  # (passes, places, 8)
    branch = _branch(worst, table, ends)
    external = np.empty((len(position_mm), 6))
    has_station = worst[:, :, branch].max(axis=1) > _REACHED
    for number in np.flatnonzero(~has_station).tolist():
        run, own = runs[number], table[:, ends[number] : ends[number + 1], branch]
        external[run] = _along(position_mm, run, judged[number], own, places, ranges)
    ways = [
        None if known else (external[run[0]], external[run[-1]])
        for known, run in zip(has_station, runs, strict=True)
    ]
    own = worst[:, :, branch]
    cost = _cost_of_places(own) + _cost_of_bending(bending, judged, branch, own, places)
    for run, way, place in zip(runs, ways, _track(cost, ways, places, ranges), strict=True):
        if way is None:
            external[run] = places[place]
    return np.asarray(np.round(external, _DECIMALS) + 0.0)


def _branch(worst: Floats, table: Floats, ends: Ints) -> int:
    """Return the branch with the most passes that have a place, then the most rows that have one."""
    with_station = (worst.max(axis=1) > _REACHED).sum(axis=0)
    reached = (table.max(axis=0) >= LEAST).sum(axis=0)
    best = worst.max(axis=1).clip(0.0, GOOD).sum(axis=0)
    return int(np.lexsort((-best, -reached, -with_station))[0])


def _track(
    cost: Floats, ways: list[tuple[Floats, Floats] | None], places: Floats, ranges: list[Range]
) -> Ints:
    """Return the place of each pass (n,) that is cheapest over all: poor places and ways between cost.

    ``cost`` (n, k) is that of the places, ``ways`` has the first and the last place of a pass that the axes
    move along in.
    """
    total, came_from = cost[0], np.zeros(cost.shape, dtype=np.int64)
    for number in range(1, len(cost)):
        before, here = ways[number - 1], ways[number]
        leaves = places if before is None else np.broadcast_to(before[1], places.shape)
        enters = places if here is None else np.broadcast_to(here[0], places.shape)
        through = total[None, :] + _cost_of_moves(leaves, enters, ranges)
        came_from[number] = np.argmin(through, axis=1)
        total = through[np.arange(len(places)), came_from[number]] + cost[number]
    track = np.empty(len(cost), dtype=np.int64)
    track[-1] = int(np.argmin(total))
    for number in range(len(cost) - 1, 0, -1):
        track[number - 1] = came_from[number, track[number]]
    return track


def _cost_of_places(worst: Floats) -> Floats:
    """Return what places cost whose quality for each pass is (n, k)."""
    poor = np.where(worst > _REACHED, _HITS_COST - worst, 1e3)
    return np.where(worst >= LEAST, 1.0 - np.minimum(worst, GOOD) / GOOD, poor)


def _cost_of_bending(
    bending: Bending | None, judged: list[Ints], branch: int, worst: Floats, places: Floats
) -> Floats:
    """Return what it costs (n, k) that a pass bends farther at a place than at its stiffest good one."""
    cost = np.zeros(worst.shape)
    if bending is None:
        return cost
    rows = [run[np.linspace(0, len(run) - 1, _ROWS_A_PASS_THAT_BEND).astype(np.int64)] for run in judged]
    for place in np.flatnonzero((worst >= LEAST).any(axis=0)).tolist():
        bent = bending(np.concatenate(rows), places[place])[:, branch].reshape(len(rows), -1)
        cost[:, place] = np.sqrt(np.mean(bent**2, axis=1))
    cost[(worst < LEAST) | ~np.isfinite(cost)] = np.inf
    least = np.min(cost, axis=1, keepdims=True, initial=np.inf)
    excess = np.where(np.isfinite(cost), cost, 0.0) / np.where(np.isfinite(least), least, 1.0) - 1.0
    return np.asarray(_BENDS * np.clip(excess, 0.0, 1.0))


def _cost_of_moves(leaves: Floats, enters: Floats, ranges: list[Range]) -> Floats:
    """Return what it costs (e, l) to go to places from places."""
    far = np.zeros((len(enters), len(leaves)))
    for axis in ranges:
        way = np.abs(enters[:, axis.column, None] - leaves[None, :, axis.column])
        far += way / (axis.high - axis.low)
    return np.asarray(np.where(far > 0.0, _STARTS + _MOVES * far, 0.0))


def _along(
    position_mm: Floats, run: Ints, judged: Ints, table: Floats, places: Floats, ranges: list[Range]
) -> Floats:
    """Return E1 to E6 (r, 6) along a pass: the axis of the widest range moves, the others help.

    ``table`` (places, judged) is the quality of the judged rows.
    """
    own, widest = _with_others_best(table[:, :, None], places, ranges), _widest(ranges)
    column = places[own, widest.column]
    low, high = np.array([_corridor(column, table[own, k]) for k in range(len(judged))]).T
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position_mm[run], axis=0), axis=1))])
    at = way[np.searchsorted(run, judged)]
    external = np.tile(places[own[0]], (len(run), 1))
    external[:, widest.column] = np.interp(way, at, taut(at, low, high))
    return external


def _widest(ranges: list[Range]) -> Range:
    return max(ranges, key=lambda axis: axis.high - axis.low)


def _with_others_best(table: Floats, places: Floats, ranges: list[Range]) -> Ints:
    """Return the places at which all axes but the widest are where the most rows can be reached.

    ``table`` (places, rows, branches) is the quality of rows.
    """
    others = [axis.column for axis in ranges if axis is not _widest(ranges)]
    choices = np.unique(places[:, others], axis=0) if others else np.zeros((1, 0))

    def of(choice: Floats) -> Ints:
        return np.flatnonzero((places[:, others] == choice).all(axis=1))

    def reached(rows: Ints) -> int:
        return int((table[rows].max(axis=0) >= LEAST).sum(axis=0).max())

    return max((of(choice) for choice in choices), key=reached)


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


def _spread(rows: Ints, position_mm: Floats, most: int) -> Ints:
    """Return at most so many rows spread over a run, its outermost points among them where there is room."""
    if len(rows) <= most:
        return rows
    extremes = [op(position_mm[rows, k]) for k in range(3) for op in (np.argmin, np.argmax)]
    evenly = np.linspace(0, len(rows) - 1, max(most - len(extremes), 2)).astype(np.int64)
    chosen = np.unique(np.concatenate([evenly, extremes]))
    picked = np.linspace(0, len(chosen) - 1, min(most, len(chosen))).astype(np.int64)
    return np.asarray(rows[chosen[picked]])
