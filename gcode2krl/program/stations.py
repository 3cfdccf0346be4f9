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
from gcode2krl.program.moving_along import moved_along
from gcode2krl.program.places import (
    AS_STIFF,
    GOOD,
    LEAST,
    REACHED,
    Bending,
    Quality,
    Range,
    cheapest_track,
    cost_of_bending,
    cost_of_moves,
    cost_of_places,
    tried_places,
    with_others_best,
)

_MOST_ROWS, _FEWEST_ROWS = 300, 3
_ROWS_A_PASS = 24
_MOST_POSES = 500_000
"""Poses that are judged for passes, some 20 us each; with more passes fewer rows of each are judged, and all
axes but the widest stay."""
_ROWS_THAT_BEND, _ROWS_A_PASS_THAT_BEND = 24, 3
_DECIMALS = 3
"""Those of the program's text."""


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
    places = tried_places(ranges, start)
    rows = _spread(np.arange(len(position_mm)), position_mm, _MOST_ROWS)
    table = np.stack([quality(rows, place) for place in places])  # (places, rows, branches)
    worst = table.min(axis=1).max(axis=1)
    if worst.max() >= LEAST:
        bent = _bent(bending, _spread(rows, position_mm, _ROWS_THAT_BEND), places, worst)
        return np.broadcast_to(places[_best(worst, bent, places, ranges, start)], (len(position_mm), 6))
    passes = np.cumsum(is_free, dtype=np.int64)
    if len(places) * (int(passes[-1]) + 1) * _FEWEST_ROWS > _MOST_POSES:
        places = places[with_others_best(table, places, ranges)]
    return _by_pass(position_mm, passes, quality, bending, places, ranges)


def _best(worst: Floats, bent: Floats, places: Floats, ranges: list[Range], start: Floats) -> int:
    """Return the place of the best quality; of those that are good, the stiffest; of those, the nearest."""
    far = np.zeros(len(places))
    for axis in ranges:
        far += axis.share * np.abs(places[:, axis.column] - start[axis.column])
    quality = np.minimum(np.round(worst, 2), GOOD)
    candidates = np.flatnonzero(quality == quality.max())
    stiff = candidates[bent[candidates] <= (1.0 + AS_STIFF) * bent[candidates].min()]
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
    has_station = worst[:, :, branch].max(axis=1) > REACHED
    here = None if bending is None else lambda rows, place: bending(rows, place)[:, branch]
    for number in np.flatnonzero(~has_station).tolist():
        run, own = runs[number], table[:, ends[number] : ends[number + 1], branch]
        external[run] = moved_along(position_mm, run, judged[number], own, here, places, ranges)
    ways = [
        None if known else (external[run[0]], external[run[-1]])
        for known, run in zip(has_station, runs, strict=True)
    ]
    own = worst[:, :, branch]
    cost = cost_of_places(own)
    if bending is not None:
        cost = cost + cost_of_bending(_bent_in_passes(bending, judged, branch, own, places))
    for run, way, place in zip(runs, ways, _track(cost, ways, places, ranges), strict=True):
        if way is None:
            external[run] = places[place]
    return np.asarray(np.round(external, _DECIMALS) + 0.0)


def _branch(worst: Floats, table: Floats, ends: Ints) -> int:
    """Return the branch with the most passes that have a place, then the most rows that have one."""
    with_station = (worst.max(axis=1) > REACHED).sum(axis=0)
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

    def moves(number: int) -> Floats:
        before, here = ways[number - 1], ways[number]
        leaves = places if before is None else np.broadcast_to(before[1], places.shape)
        enters = places if here is None else np.broadcast_to(here[0], places.shape)
        return cost_of_moves(leaves, enters, ranges)

    return cheapest_track(cost, moves)


def _bent_in_passes(
    bending: Bending, judged: list[Ints], branch: int, worst: Floats, places: Floats
) -> Floats:
    """Return how far passes bend (n, k) at places of the quality (n, k), inf where that is too poor."""
    bent = np.full(worst.shape, np.inf)
    rows = [run[np.linspace(0, len(run) - 1, _ROWS_A_PASS_THAT_BEND).astype(np.int64)] for run in judged]
    for place in np.flatnonzero((worst >= LEAST).any(axis=0)).tolist():
        each = bending(np.concatenate(rows), places[place])[:, branch].reshape(len(rows), -1)
        bent[:, place] = np.sqrt(np.mean(each**2, axis=1))
    return np.where((worst >= LEAST) & np.isfinite(bent), bent, np.inf)


def _spread(rows: Ints, position_mm: Floats, most: int) -> Ints:
    """Return at most so many rows spread over a run, its outermost points among them where there is room."""
    if len(rows) <= most:
        return rows
    extremes = [op(position_mm[rows, k]) for k in range(3) for op in (np.argmin, np.argmax)]
    evenly = np.linspace(0, len(rows) - 1, max(most - len(extremes), 2)).astype(np.int64)
    chosen = np.unique(np.concatenate([evenly, extremes]))
    picked = np.linspace(0, len(chosen) - 1, min(most, len(chosen))).astype(np.int64)
    return np.asarray(rows[chosen[picked]])
