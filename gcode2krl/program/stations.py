"""Where the external axes stand along a program: one place for all of it, one for each pass, or moving along.

A station is a place of E1 to E6. It changes on the clearance plane only, where nothing is cut: one station
for the whole program is the first choice, one for each pass the second. Of good places those count where the
robot bends least, then those that are near. Where a pass is longer than the arm reaches, the axis moves
along, as little and as evenly as the reach allows (the shortest line through the corridor of places from
which the arm reaches).
"""

import itertools

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.program.judged import of_pass, spread
from gcode2krl.program.moving_along import Along, ways_along
from gcode2krl.program.one_place import best_place
from gcode2krl.program.places import (
    GOOD,
    LEAST,
    MOST_THAT_BEND,
    REACHED,
    Bending,
    Quality,
    Range,
    bent_at,
    cheapest_track,
    cost_of_bending,
    cost_of_moves,
    cost_of_places,
    quality_table,
    tried_places,
    with_others_best,
)

_FEWEST_ROWS, _ROWS_A_PASS, _ROWS_OF_ALL = 3, 24, 60
_MOST_POSES = 500_000
"""Poses that are judged for passes, some 20 us each; with more passes fewer rows of each are judged, and all
axes but the widest stay."""
_ROWS_A_PASS_THAT_BEND = 3
_DECIMALS = 3
"""Those of the program's text."""


def plan_stations(
    position_mm: Floats,
    is_free: Bools,
    quality: Quality,
    ranges: list[Range],
    start: Floats,
    bending: Bending | None = None,
    is_target: Bools | None = None,
) -> Floats:
    """Return E1 to E6 (p, 6), one row in memory where they stay.

    Parameters
    ----------
    position_mm : (p, 3)
    is_free : (p,) True where the motion to the target is on the clearance plane, or a PTP.
    quality : of rows at places.
    ranges : the axes that may be put somewhere else.
    start : (6,) where all axes are that may not, and that others are preferred to be near.
    bending : of rows at places; None where stiffness does not count.
    is_target : (p,) False at points between two targets, at which an axis cannot change its way; the first
        and the last row of a pass are targets.
    """
    if is_target is None:
        is_target = np.ones(len(position_mm), dtype=np.bool_)
    if not ranges:
        return np.broadcast_to(start, (len(position_mm), 6))
    places = tried_places(ranges, start)
    found = best_place(position_mm, quality, bending, places, ranges, start)
    if found is not None:
        return np.broadcast_to(places[found], (len(position_mm), 6))
    passes = np.cumsum(is_free, dtype=np.int64)
    if len(places) * (int(passes[-1]) + 1) * _FEWEST_ROWS > _MOST_POSES:
        rows = spread(np.arange(len(position_mm)), position_mm, _ROWS_OF_ALL)
        places = places[with_others_best(quality_table(quality, rows, places), places, ranges)]
    return _by_pass(position_mm, is_target, passes, quality, bending, places, ranges)


def _by_pass(
    position_mm: Floats,
    is_target: Bools,
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
    judged = [of_pass(run, position_mm, is_target, most) for run in runs]
    table = quality_table(quality, np.concatenate(judged), places)  # (rows, places, branches)
    ends = np.cumsum([0, *map(len, judged)])
    worst = np.stack([table[a:b].min(axis=0) for a, b in itertools.pairwise(ends)])  # (passes, places, 8)
    branch = _branch(worst, table)
    own = worst[:, :, branch]
    has_station = own.max(axis=1) > REACHED
    moving = np.flatnonzero(~has_station).tolist()
    along = [Along(runs[k], judged[k], table[ends[k] : ends[k + 1], :, branch]) for k in moving]
    external = np.empty((len(position_mm), 6))
    moved = ways_along(position_mm, is_target, along, bending, branch, places, ranges)
    for each, moves in zip(along, moved, strict=True):
        external[each.run] = moves
    ways = [
        None if known else (external[run[0]], external[run[-1]])
        for known, run in zip(has_station, runs, strict=True)
    ]
    cost = cost_of_places(own)
    if bending is not None:
        cost = cost + cost_of_bending(_bent_in_passes(bending, judged, branch, own, places))
    for run, way, place in zip(runs, ways, _track(cost, ways, places, ranges), strict=True):
        if way is None:
            external[run] = places[place]
    return np.asarray(np.round(external, _DECIMALS) + 0.0)


def _branch(worst: Floats, table: Floats) -> int:
    """Return the branch with the most passes that have a place, then the most rows that have one."""
    with_station = (worst.max(axis=1) > REACHED).sum(axis=0)
    reached = (table.max(axis=1) >= LEAST).sum(axis=0)
    best = worst.max(axis=1).clip(0.0, GOOD).sum(axis=0)
    return int(np.lexsort((-best, -reached, -with_station))[0])


def _track(
    cost: Floats, ways: list[tuple[Floats, Floats] | None], places: Floats, ranges: list[Range]
) -> Ints:
    """Return the place of each pass (n,) that is cheapest over all: poor places and ways between cost.

    ``cost`` (n, k) is that of the places, ``ways`` has the first and the last place of a pass that the axes
    move along in.
    """

    def moves(number: int) -> Floats:
        before, here = ways[number - 1], ways[number]
        leaves = places if before is None else np.broadcast_to(before[1], places.shape)
        enters = places if here is None else np.broadcast_to(here[0], places.shape)
        return cost_of_moves(leaves, enters, ranges)

    return cheapest_track(cost, moves)


def _bent_in_passes(
    bending: Bending, judged: list[Ints], branch: int, worst: Floats, places: Floats
) -> Floats:
    """Return how far passes bend (n, k) at places of the quality (n, k), inf where that is too poor.

    With very many passes and places it is inf throughout: stiffness does not count then.
    """
    wanted = worst >= LEAST
    rows = min(MOST_THAT_BEND // max(int(wanted.sum()), 1), _ROWS_A_PASS_THAT_BEND)
    square = np.full(worst.shape, np.inf if rows == 0 else 0.0)
    for share in np.linspace(0.0, 1.0, rows) if rows > 1 else np.full(rows, 0.5):
        row = np.array([run[int(share * (len(run) - 1))] for run in judged])
        square += bent_at(bending, branch, row, places, wanted) ** 2 / rows
    return np.asarray(np.sqrt(square))
