"""Where the external axes stand along a program: one place for all of it, one for each pass, or moving along.

A station is a place of E1 to E6. It changes on the clearance plane only, where nothing is cut: one station
for the whole program is the first choice, one for each pass the second. Of good places those count where the
robot bends least, then those that are near.

Where a pass is longer than the arm reaches, the axis moves along. Among the places from which the arm
reaches, the track is chosen along which it bends least, as far as that is worth the way of the axis. Around
the track a corridor is left in which the arm bends hardly more, and through that the axis goes
(`pose.along`).

Most places are out of question by a few rows of the program, so these are judged first; then places are
judged by all rows, the most promising first, until no other can be better. Of more places that are equally
good by a few rows, as with two axes, those near the start and others spread over the ranges are looked at.
"""

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.pose.along import knots_through
from gcode2krl.pose.path import cheapest_track, spread, way_mm
from gcode2krl.pose.quality import Judge, Quality, stacked

PlaceJudge = Judge[Floats]
"""Judges rows (r,) of the path with E1 to E6 at (r, 6)."""

GOOD = 0.3
"""Margin (1 = 30 degrees from limits and singularities) from which a place is as good as any better one."""
LEAST = 0.05
"""Margin below which a place is not taken."""
STEPS = 49
"""Places that are tried on an axis, so that a rail of 5 m has one every 100 mm."""
_MOST_PLACES = 1000
_AT_ONCE = 20_000
"""Rows at places that are judged in one call."""
MOST_THAT_BEND = 100_000
"""Rows at places whose bending is found, 5 to 50 us each."""
_POOR_COST, _HITS_COST, _OUT_OF_REACH_COST = 50.0, 50.9, 1e3
"""What a place costs that is hardly reached, at which something is hit, and that is out of reach; the first
two less what margin there is. A hit is taken before a pass is given up: it is a finding of its own."""
_BENDS = 0.5
"""What a place costs at which the robot bends twice as far as at the best one there; at most that."""
_MOVES = 0.5
"""What a way over the whole range between two passes costs, against a place of no margin at all."""
_STARTS = 0.05
"""What any way between two passes costs, so that there are few."""
_WHOLE = 5.0
"""Places that are farther from each other are whole numbers, where the limits are."""
DECIMALS = 3
"""Those of the program's text."""
_ROWS = (12, 60, 300)
"""Rows by which one place for all is judged, one after the other."""
_NEAREST = 12
_AS_STIFF = 0.05
"""Places that bend by so much more than the stiffest one count as equally stiff."""
_FEWEST_ROWS_THAT_BEND, _ROWS_THAT_BEND = 3, 24
_SCATTER = 0.6180339887
"""Multiples of the golden section, without their whole part, are spread evenly however many are taken."""
_FEWEST_ROWS, _ROWS_A_PASS, _ROWS_OF_ALL = 3, 24, 60
_MOST_POSES = 500_000
"""Poses that are judged for passes, some 20 us each; with more passes fewer rows of each are judged, and all
axes but the widest stay."""
_ROWS_A_PASS_THAT_BEND = 3
_FEWEST_THAT_BEND = 3
_NEARLY = 0.5
"""Share of the margin on the track with which the corridor is content."""
_SOFTER = 0.1
"""In the corridor the arm bends at most by so much more than at the stiffest place of a row."""


@dataclass(frozen=True)
class Range:
    """A free axis: its column in E1 to E6, and its limits."""

    column: int
    low: float
    high: float

    @property
    def share(self) -> float:
        """Return the share of the range that a millimetre or degree is, 0 where there is no range."""
        return 1.0 / (self.high - self.low) if self.high > self.low else 0.0

    def places(self, steps: int) -> Floats:
        """Return places evenly over the range."""
        step = (self.high - self.low) / max(steps - 1, 1)
        places = np.round(np.linspace(self.low, self.high, steps), 0 if step > _WHOLE else DECIMALS)
        return np.clip(places, self.low, self.high)


def plan_stations(
    position_mm: Floats,
    is_free: Bools,
    judge: PlaceJudge,
    ranges: list[Range],
    start: Floats,
    is_target: Bools | None = None,
) -> Floats:
    """Return E1 to E6 (p, 6), one row in memory where they stay.

    Parameters
    ----------
    position_mm : (p, 3)
    is_free : (p,) True where the motion to the target is on the clearance plane, or a PTP.
    ranges : the axes that may be put somewhere else.
    start : (6,) where all axes are that may not, and that others are preferred to be near.
    is_target : (p,) False at points between two targets, at which an axis cannot change its way; the first
        and the last row of a pass are targets.
    """
    if is_target is None:
        is_target = np.ones(len(position_mm), dtype=np.bool_)
    if not ranges:
        return np.broadcast_to(start, (len(position_mm), 6))
    places = tried_places(ranges, start)
    best = best_place(position_mm, judge, places, ranges, start)
    if best is not None:
        return np.broadcast_to(places[best], (len(position_mm), 6))
    passes = np.cumsum(is_free, dtype=np.int64)
    if len(places) * (int(passes[-1]) + 1) * _FEWEST_ROWS > _MOST_POSES:
        rows = spread(np.arange(len(position_mm)), position_mm, _ROWS_OF_ALL)
        places = places[with_others_best(quality_table(judge, rows, places), places, ranges)]
    return _by_pass(position_mm, is_target, passes, judge, places, ranges)


# --- places, and what they cost ---------------------------------------------------------------------------


def tried_places(ranges: list[Range], start: Floats) -> Floats:
    """Return the places (k, 6) that are tried: a grid over all free axes."""
    steps = STEPS
    while steps ** len(ranges) > _MOST_PLACES:
        steps -= 2
    grid = np.array(list(itertools.product(*(axis.places(steps) for axis in ranges))))
    places = np.tile(start, (len(grid), 1))
    places[:, [axis.column for axis in ranges]] = grid
    return places


def widest(ranges: list[Range]) -> Range:
    """Return the axis that moves where one moves along; the others only help."""
    return max(ranges, key=lambda axis: axis.high - axis.low)


def with_others_best(quality: Quality, places: Floats, ranges: list[Range]) -> Ints:
    """Return the places at which all axes but the widest are where the most rows can be reached.

    ``quality`` (rows, places, branches) is that of rows.
    """
    others = [axis.column for axis in ranges if axis is not widest(ranges)]
    choices = np.unique(places[:, others], axis=0) if others else np.zeros((1, 0))
    is_taken = quality.free_margin() >= LEAST

    def of(choice: Floats) -> Ints:
        return np.flatnonzero((places[:, others] == choice).all(axis=1))

    def reached(rows: Ints) -> int:
        return int(is_taken[:, rows].any(axis=1).sum(axis=0).max())

    return max((of(choice) for choice in choices), key=reached)


def quality_table(judge: PlaceJudge, rows: Ints, places: Floats) -> Quality:
    """Return the quality (n, k, branches) of rows (n,) at places (k, 6)."""
    step = max(1, _AT_ONCE // max(len(rows), 1))
    parts = [
        judge.quality(np.tile(rows, len(some)), np.repeat(some, len(rows), axis=0))
        for some in (places[first : first + step] for first in range(0, len(places), step))
    ]
    table = Quality(*map(np.concatenate, zip(*parts, strict=True)))
    return table.map(lambda column: np.moveaxis(column.reshape(len(places), len(rows), -1), 1, 0))


def cost_of_places(worst: Quality) -> Floats:
    """Return what places cost whose quality for each pass is (n, k)."""
    poor = np.where(worst.collides, _HITS_COST, _POOR_COST) - worst.margin
    taken = worst.free_margin() >= LEAST
    not_taken = np.where(worst.reachable, poor, _OUT_OF_REACH_COST)
    return np.where(taken, 1.0 - np.minimum(worst.margin, GOOD) / GOOD, not_taken)


def bent_at(judge: PlaceJudge, branch: int, rows: Ints, places: Floats, wanted: Bools) -> Floats:
    """Return how far rows (n,) bend at places (k, 6), where wanted (n, k) and possible; inf elsewhere."""
    bent = np.full(wanted.shape, np.inf)
    row, place = np.nonzero(wanted)
    if len(row) and judge.bending_mm is not None:
        bent_mm = judge.bending_mm(rows[row], places[place])[:, branch]
        bent[row, place] = np.where(np.isnan(bent_mm), np.inf, bent_mm)
    return bent


def cost_of_bending(bent: Floats) -> Floats:
    """Return what it costs (n, k) to bend so far at places; the least of a row costs nothing.

    Where it is not known (inf) this costs nothing either: what is out of reach costs as a place.
    """
    least = np.min(bent, axis=1, keepdims=True)
    excess = np.where(np.isfinite(bent), bent, 0.0) / np.where(np.isfinite(least), least, 1.0) - 1.0
    return np.asarray(_BENDS * np.clip(excess, 0.0, 1.0))


def cost_of_ways(leaves: Floats, enters: Floats, ranges: list[Range]) -> Floats:
    """Return what the ways cost (e, l) to places from places."""
    far = np.zeros((len(enters), len(leaves)))
    for axis in ranges:
        far += axis.share * np.abs(enters[:, axis.column, None] - leaves[None, :, axis.column])
    return _MOVES * far


# --- one place for a whole program ------------------------------------------------------------------------


def best_place(
    position_mm: Floats, judge: PlaceJudge, places: Floats, ranges: list[Range], start: Floats
) -> int | None:
    """Return which place (k, 6) serves all positions (p, 3) best; None where none serves all.

    The place of the largest margin; of those that are good, the stiffest; of those, the nearest to ``start``
    (6,).
    """
    far = np.zeros(len(places))
    for axis in ranges:
        far += axis.share * np.abs(places[:, axis.column] - start[axis.column])
    margin = _margins(position_mm, judge, places, far)
    if margin.max() < LEAST:
        return None
    score = _score(margin)
    candidates = np.flatnonzero(score == score.max())
    bent = np.ones(len(candidates))
    if judge.bending_mm is not None and len(candidates) > 1:
        most = int(np.clip(MOST_THAT_BEND // len(candidates), _FEWEST_ROWS_THAT_BEND, _ROWS_THAT_BEND))
        bent = _bent(judge, spread(np.arange(len(position_mm)), position_mm, most), places[candidates])
    as_stiff = bent <= (1.0 + _AS_STIFF) * bent.min()
    order = np.lexsort((-margin[candidates], far[candidates], ~as_stiff))
    return int(candidates[order[0]])


def _margins(position_mm: Floats, judge: PlaceJudge, places: Floats, far: Floats) -> Floats:
    """Return the margin (k,) of places (k, 6) over all positions (p, 3) in their best branch.

    Those that do not serve all, or were not judged by all rows, have -1: no better one is among them. ``far``
    (k,) is how far they are from the start.
    """
    everything = np.arange(len(position_mm))
    few, *more = (spread(everything, position_mm, count) for count in _ROWS)
    bound = quality_table(judge, few, places).free_margin().min(axis=0)  # (k, branches)
    margin = np.full(len(places), -1.0)
    order = _most_promising_first(_score(bound.max(axis=1)), far)
    for first in range(0, len(order), STEPS):
        some = order[first : first + STEPS]
        if _score(bound[some].max(axis=1)).max() <= _score(margin).max():
            break
        for rows in more:
            some = some[bound[some].max(axis=1) >= LEAST]
            if len(some):
                margins = quality_table(judge, rows, places[some]).free_margin()
                bound[some] = np.minimum(bound[some], margins.min(axis=0))
        margin[some] = bound[some].max(axis=1)
    return margin


def _most_promising_first(score: Floats, far: Floats) -> Ints:
    """Return the places in the order in which they are judged by all rows."""
    best = np.flatnonzero(score == score.max())
    is_near = np.zeros(len(score), dtype=np.bool_)
    is_near[best[np.argsort(far[best], kind="stable")[:_NEAREST]]] = True
    scattered = np.arange(len(score)) * _SCATTER % 1.0
    return np.lexsort((scattered, ~is_near, -score))


def _score(margin: Floats) -> Floats:
    """Return what a margin counts: from `GOOD` on all are alike."""
    return np.asarray(np.minimum(np.round(margin, 2), GOOD))


def _bent(judge: PlaceJudge, rows: Ints, places: Floats) -> Floats:
    """Return how far the robot bends at places (k,), in root mean square over rows.

    Of the branches the stiffest counts that reaches all rows; inf where none does.
    """
    assert judge.bending_mm is not None
    bent_mm = judge.bending_mm(np.tile(rows, len(places)), np.repeat(places, len(rows), axis=0))
    square = np.mean(bent_mm.reshape(len(places), len(rows), -1) ** 2, axis=1)  # (places, branches)
    return np.asarray(np.sqrt(np.min(np.where(np.isnan(square), np.inf, square), axis=1)))


# --- a place for each pass, or moving along -----------------------------------------------------------------


class _Pass(NamedTuple):
    """What is cut between two stops on the clearance plane."""

    run: Ints
    """Its rows (r,)."""
    judged: Ints
    """Those of them (n,) that are judged."""
    quality: Quality
    """(n, k) of the judged rows at the places, in the branch of the program."""


def _by_pass(
    position_mm: Floats,
    is_target: Bools,
    numbers: Ints,
    judge: PlaceJudge,
    places: Floats,
    ranges: list[Range],
) -> Floats:
    """Return E1 to E6 (p, 6) with a station for each pass, or moving along in it.

    ``numbers`` (p,) are those of the passes.
    """
    borders = np.flatnonzero(np.diff(numbers, prepend=-1, append=numbers[-1] + 1))
    runs = [np.arange(a, b) for a, b in itertools.pairwise(borders)]
    most = int(np.clip(_MOST_POSES // (len(places) * len(runs)), _FEWEST_ROWS, _ROWS_A_PASS))
    judged = [_judged_rows(run, position_mm, is_target, most) for run in runs]
    table = quality_table(judge, np.concatenate(judged), places)  # (rows, places, branches)
    ends = [slice(a, b) for a, b in itertools.pairwise(np.cumsum([0, *map(len, judged)]))]
    worst = stacked([table.at(rows).worst(axis=0) for rows in ends])  # (passes, places, branches)
    branch = _branch(worst, table)
    worst, table = (quality.at(np.s_[:, :, branch]) for quality in (worst, table))
    moving = np.flatnonzero(~worst.reachable.any(axis=1)).tolist()
    external, ways = np.empty((len(position_mm), 6)), dict[int, tuple[Floats, Floats]]()
    passes = [_Pass(runs[k], judged[k], table.at(ends[k])) for k in moving]
    moved = _ways_along(position_mm, is_target, passes, judge, branch, places, ranges)
    for number, way in zip(moving, moved, strict=True):
        external[runs[number]], ways[number] = way, (way[0], way[-1])
    cost = cost_of_places(worst)
    if judge.bending_mm is not None:
        cost = cost + cost_of_bending(_bent_in_passes(judge, judged, branch, worst, places))
    for number, place in enumerate(_track(cost, ways, places, ranges)):
        if number not in ways:
            external[runs[number]] = places[place]
    return np.asarray(np.round(external, DECIMALS) + 0.0)


def _judged_rows(run: Ints, position_mm: Floats, is_target: Bools, most: int) -> Ints:
    """Return at most so many rows of a pass: half of them targets, at which an axis may change its way."""
    targets = run[is_target[run]]
    if len(run) <= most or len(targets) == len(run):
        return spread(run, position_mm, most)
    chosen = spread(targets, position_mm, max(most // 2, 2))
    others = spread(run[~is_target[run]], position_mm, max(most - len(chosen), 1))
    return np.union1d(chosen, others)


def _branch(worst: Quality, table: Quality) -> int:
    """Return the branch with the most passes that have a place, then the most rows that have one."""
    with_station = worst.reachable.any(axis=1).sum(axis=0)
    reached = (table.free_margin() >= LEAST).any(axis=1).sum(axis=0)
    margin = worst.free_margin().max(axis=1).clip(0.0, GOOD).sum(axis=0)
    return int(np.lexsort((-margin, -reached, -with_station))[0])


def _track(cost: Floats, ways: dict[int, tuple[Floats, Floats]], places: Floats, ranges: list[Range]) -> Ints:
    """Return the place of each pass (n,) that is cheapest over all: poor places and ways between cost.

    ``cost`` (n, k) is that of the places, ``ways`` has the first and the last place of the passes that the
    axes move along in.
    """

    def arrive(number: int, total: Floats) -> Floats:
        leaves = np.broadcast_to(ways[number - 1][1], places.shape) if number - 1 in ways else places
        enters = np.broadcast_to(ways[number][0], places.shape) if number in ways else places
        way_cost = cost_of_ways(leaves, enters, ranges)
        return np.asarray(total + np.where(way_cost > 0.0, _STARTS + way_cost, 0.0))

    return cheapest_track(cost, arrive)[1]


def _bent_in_passes(
    judge: PlaceJudge, judged: list[Ints], branch: int, worst: Quality, places: Floats
) -> Floats:
    """Return how far passes bend (n, k) at places of the quality (n, k), inf where that is too poor.

    With very many passes and places it is inf throughout: stiffness does not count then.
    """
    wanted = worst.free_margin() >= LEAST
    rows = min(MOST_THAT_BEND // max(int(wanted.sum()), 1), _ROWS_A_PASS_THAT_BEND)
    square = np.full(wanted.shape, np.inf if rows == 0 else 0.0)
    for share in np.linspace(0.0, 1.0, rows) if rows > 1 else np.full(rows, 0.5):
        row = np.array([run[int(share * (len(run) - 1))] for run in judged])
        square += bent_at(judge, branch, row, places, wanted) ** 2 / rows
    return np.asarray(np.sqrt(square))


def _ways_along(
    position_mm: Floats,
    is_target: Bools,
    passes: list[_Pass],
    judge: PlaceJudge,
    branch: int,
    places: Floats,
    ranges: list[Range],
) -> list[Floats]:
    """Return E1 to E6 (r, 6) along each pass: the axis of the widest range moves, the others help.

    It changes its way at rows (p,) that are targets. With more passes fewer of their rows count by how far
    the arm bends, and none with very many.
    """
    axis = widest(ranges)
    helped = [with_others_best(each.quality.at(np.s_[:, :, None]), places, ranges) for each in passes]
    rows = MOST_THAT_BEND // max(sum(map(len, helped)), 1)
    ways = []
    for (run, judged, quality), among in zip(passes, helped, strict=True):
        margin = quality.free_margin()[:, among]
        bent = np.full(margin.shape, np.inf)
        if rows >= _FEWEST_THAT_BEND:
            few = np.unique(np.linspace(0, len(margin) - 1, min(rows, len(margin))).astype(np.int64))
            bent[few] = bent_at(judge, branch, judged[few], places[among], margin[few] >= LEAST)
        cost = (cost_of_places(quality)[:, among] + cost_of_bending(bent)) / len(margin)
        low, high = _corridor(places[among], cost, margin, bent, axis)
        at_mm = way_mm(position_mm[run])
        external = np.tile(places[among[0]], (len(run), 1))
        knots, at_knots = knots_through(at_mm[np.searchsorted(run, judged)], low, high, is_target[judged])
        external[:, axis.column] = np.interp(at_mm, knots, at_knots)
        ways.append(external)
    return ways


def _corridor(
    places: Floats, cost: Floats, margin: Floats, bent: Floats, axis: Range
) -> tuple[Floats, Floats]:
    """Return between which places (n,) and (n,) of an axis the arm reaches the rows well and bends little.

    ``cost`` (n, k), ``margin`` (n, k), -1 where not free, and ``bent`` (n, k), inf where it does not count,
    are those of the rows at the places (k, 6).
    """
    ways = cost_of_ways(places, places, [axis])
    _, track = cheapest_track(cost, lambda _, total: total + ways)
    rows = np.arange(len(track))
    enough = np.maximum(LEAST, _NEARLY * np.minimum(margin[rows, track], GOOD))
    stiff = bent <= (1.0 + _SOFTER) * np.min(bent, axis=1, keepdims=True)
    neighbour = np.abs(np.arange(len(places)) - track[:, None]) <= 1  # so that coarse places make no stairs
    within = (margin >= enough[:, None]) & (stiff | neighbour)
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
