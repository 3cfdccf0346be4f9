"""Where external axes stand: nowhere else than needed, and as evenly as the reach allows."""

import numpy as np
import pytest

from gcode2krl.pose.along import following_deg, knots_through, taut
from gcode2krl.pose.path import spread
from gcode2krl.pose.quality import Quality
from gcode2krl.pose.stations import (
    GOOD,
    LEAST,
    MOST_THAT_BEND,
    Range,
    best_place,
    cost_of_places,
    plan_stations,
    quality_table,
    tried_places,
)
from tests.pose.judging import judge_by

REACH_MM = 1000.0


def reached(position):
    """A robot on a rail along x: 1 where it stands beside the tool, 0 where the tool is out of reach."""

    def quality(rows, place):
        off = np.abs(position[rows, 0] - place[:, 0]) / REACH_MM
        return np.tile(np.where(off < 1.0, 1.0 - off, -1.0)[:, None], (1, 8))

    return quality


def planned(x, is_free, low=-5000.0, high=15000.0, start=0.0, bending=None):
    position = np.zeros((len(x), 3))
    position[:, 0] = x
    at = np.zeros(6)
    at[0] = start
    free, axis = np.array(is_free), Range(0, low, high)
    return plan_stations(position, free, judge_by(reached(position), bending), [axis], at)[:, 0], position


def softer_away_from(x, side_mm):
    """A robot that stands stiffest ``side_mm`` beside the tool; 500 mm off it bends twice as far."""

    def bending(rows, place):
        off = np.abs(np.asarray(x)[rows] + side_mm - place[:, 0]) / 500.0
        return np.tile((1.0 + off)[:, None], (1, 8))

    return bending


def test_worse_places_cost_more():
    """Out of reach, a hit, a nearer hit, hardly reached, reached, good."""
    reachable = np.array([[False, True, True, True, True, True]])
    collides = np.array([[False, True, True, False, False, False]])
    cost = cost_of_places(Quality(reachable, collides, np.array([[0.0, 0.1, 0.4, 0.04, 0.1, GOOD]])))
    assert (np.diff(cost[0]) < 0.0).all()
    assert cost[0, -1] == 0.0


PASS = [True] + [False] * 19


@pytest.mark.parametrize(
    ("x", "limits", "start", "side_mm", "low", "high"),
    [
        (np.linspace(0.0, 900.0, 20), (-5000.0, 15000.0), 0.0, None, -50.0, 950.0),  # one is enough
        (np.full(20, 400.0), (-5000.0, 15000.0), 900.0, None, 650.0, 1150.0),  # the nearest to where it is
        (np.full(20, 400.0), (0.0, 1500.0), 900.0, -300.0, 65.0, 135.0),  # the stiffest first, 5 % apart
        (np.full(20, 400.0), (0.0, 1500.0), 0.0, 950.0, 1035.0, 1100.0),  # stiff, but hardly reached
    ],
)
def test_of_good_places_the_stiffest_then_the_nearest(x, limits, start, side_mm, low, high):
    """Places of the last two are 31 mm apart; the margin is good up to 700 mm off."""
    bending = None if side_mm is None else softer_away_from(x, side_mm)
    external, _ = planned(x, PASS, *limits, start=start, bending=bending)
    assert len(np.unique(external)) == 1
    assert low <= external[0] <= high


def test_an_axis_without_room_stays():
    with np.errstate(all="raise"):
        external, _ = planned(np.linspace(0.0, 900.0, 20), PASS, 300.0, 300.0, start=300.0)
        along, _ = planned(np.linspace(0.0, 5000.0, 20), PASS, 300.0, 300.0, start=300.0)
    assert (external == 300.0).all()
    assert (along == 300.0).all()


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("count", [1, 2])
def test_no_place_is_better_than_the_one_that_is_taken(count, seed):
    """Beside it all places judged by all rows that count; a thin obstacle is seen by few of them."""
    random = np.random.default_rng(seed)
    x, middle = random.uniform(-500.0, 500.0, 400), random.uniform(0.0, 4000.0, count)
    spoilt, width = random.integers(0, 400, 5), random.uniform(300.0, 1500.0)
    spoilt_at = random.uniform(0.0, 4000.0, 5)
    judged = []

    def quality(rows, place):
        judged.append(len(rows))
        off = np.abs(place[:, :count] - middle - x[rows, None] * 0.2).max(axis=1) / width
        for row, at in zip(spoilt, spoilt_at, strict=True):
            off = np.where((rows == row) & (np.abs(place[:, 0] - at) < 300.0), 2.0, off)
        return np.tile(np.maximum(0.6 - off, -1.0)[:, None], (1, 8))

    position, start = np.column_stack([x, np.zeros((400, 2))]), np.full(6, 1500.0)
    ranges = [Range(axis, 0.0, 4000.0) for axis in range(count)]
    places = tried_places(ranges, start)
    found = best_place(position, judge_by(quality), places, ranges, start)
    assert sum(judged) <= len(places) * 12 + 5 * 49 * 360
    rows = np.unique(np.concatenate([spread(np.arange(400), position, most) for most in (12, 60, 300)]))
    worst = quality_table(judge_by(quality), rows, places).free_margin().min(axis=0).max(axis=1)
    if worst.max() < LEAST:
        assert found is None
        return
    assert round(min(worst[found], GOOD), 2) == round(min(worst.max(), GOOD), 2)
    near = np.abs(places - start).sum(axis=1)
    if count == 1:
        assert near[found] == near[np.minimum(worst.round(2), GOOD) == min(worst.max().round(2), GOOD)].min()


def test_each_pass_stands_where_it_is_stiff_unless_the_way_costs_more():
    x = np.concatenate([np.full(30, start) for start in (0.0, 4000.0, 4020.0)])
    is_free = np.zeros(len(x), dtype=bool)
    is_free[[0, 30, 60]] = True
    external, _ = planned(x, is_free, bending=softer_away_from(x, -500.0))
    first, second, third = external[[0, 30, 60]]
    assert abs(first + 500.0) < 450.0
    assert abs(second - 3550.0) < 450.0
    assert second == third


def test_passes_have_stations_and_nothing_moves_within_one():
    x = np.concatenate([np.linspace(start, start + 1200.0, 30) for start in (0.0, 4000.0, 8000.0)])
    is_free = np.zeros(len(x), dtype=bool)
    is_free[[0, 30, 60]] = True
    external, _ = planned(x, is_free)
    assert len(np.unique(external)) == 3
    assert set(np.flatnonzero(np.diff(external))) == {29, 59}
    assert (np.abs(x - external) < REACH_MM * (1.0 - LEAST)).all()


def test_single_free_rows_on_the_way_do_not_stop_the_rail_between():
    x = np.concatenate([np.full(10, 0.0), np.linspace(500.0, 7500.0, 8), np.full(10, 8000.0)])
    is_free = np.zeros(len(x), dtype=bool)
    is_free[[0, *range(10, 19)]] = True
    external, _ = planned(x, is_free)
    assert (np.abs(x - external) < REACH_MM).all()
    assert np.count_nonzero(np.diff(external)) <= 7


def test_a_pass_that_is_too_long_takes_the_rail_along():
    x = np.linspace(0.0, 9000.0, 400)
    external, _ = planned(x, [True] + [False] * 399)
    assert (np.abs(x - external) <= REACH_MM * (1.0 - 0.5 * GOOD)).all()  # half of what is good
    assert (np.diff(external) >= 0.0).all()
    assert external.max() - external.min() < 9000.0 - 2.0 * REACH_MM + 1100.0  # places are 417 mm apart
    assert np.ptp(np.diff(external)[100:300]) < 2.0  # evenly


@pytest.mark.parametrize("side_mm", [-500.0, 0.0, 400.0])
def test_along_a_pass_the_rail_keeps_where_the_arm_is_stiff(side_mm):
    x = np.linspace(0.0, 9000.0, 400)
    limits, free = (-2000.0, 11000.0), [True] + [False] * 399
    anywhere, _ = planned(x, free, *limits)
    stiff, _ = planned(x, free, *limits, bending=softer_away_from(x, side_mm))
    bent, bent_anywhere = (1.0 + np.abs(e - x - side_mm) / 500.0 for e in (stiff, anywhere))
    assert (
        np.median(bent) < 1.0 + 271.0 / 500.0
    )  # places are 271 mm apart, and those beside the stiffest are in
    assert np.sqrt(np.mean(bent**2)) < 0.9 * np.sqrt(np.mean(bent_anywhere**2))
    assert (np.diff(stiff) >= 0.0).all()


def test_places_of_one_quality_are_told_apart_by_stiffness_alone():
    """Two places that round to one quality, whatever the unit of the bending."""

    def quality(rows, place):
        each = np.select([place[:, 0] == 0.0, place[:, 0] == 600.0], [0.196, 0.2], 0.1)
        return np.tile(each[:, None], (1, 8))

    def station(scale):
        def bending(rows, place):
            return np.tile((scale * np.where(place[:, 0] == 0.0, 1.0, 3.0))[:, None], (1, 8))

        free, axis = np.array([True] + [False] * 4), Range(0, 0.0, 4800.0)
        return plan_stations(np.zeros((5, 3)), free, judge_by(quality, bending), [axis], np.full(6, 4800.0))[
            0, 0
        ]

    assert station(0.1) == station(10.0) == 0.0


def test_an_axis_changes_its_way_at_targets_only():
    """A move of 9 m in which the arm reaches a detour of the corridor, and targets around it."""
    x = np.linspace(0.0, 9000.0, 181)
    is_target = np.zeros(181, dtype=bool)
    is_target[[0, 40, 80, 100, 140, 180]] = True
    position, start = np.column_stack([x, np.zeros((181, 2))]), np.zeros(6)
    free, axis = np.array([True] + [False] * 180), Range(0, -5000.0, 15000.0)
    external = plan_stations(position, free, judge_by(reached(position)), [axis], start, is_target)[:, 0]
    assert (np.abs(x - external) < REACH_MM).all()
    straight = np.interp(x, x[is_target], external[is_target])
    assert np.abs(straight - external).max() <= 2e-3


@pytest.mark.parametrize("seed", range(30))
def test_where_a_way_with_knots_at_targets_is_possible_it_is_found(seed):
    """Beside it a linear program tells whether lines between targets can keep within the corridor."""
    from scipy.optimize import linprog

    random = np.random.default_rng(seed)
    count = int(random.integers(8, 30))
    at = np.cumsum(random.uniform(0.1, 3.0, count))
    is_target = random.random(count) < 0.4
    is_target[[0, -1]] = True
    middle = np.interp(at, np.linspace(at[0], at[-1], 6), np.cumsum(random.normal(0.0, 3.0, 6)))
    half = random.uniform(1.0, 2.0, count)
    low, high = middle - half, middle + half
    knots, values = knots_through(at, low, high, is_target)
    line = np.interp(at, knots, values)
    assert (knots == at[is_target]).all()
    tents = np.array([np.interp(at, knots, row) for row in np.eye(len(knots))]).T
    rows = np.vstack([np.hstack([tents, -np.ones((count, 1))]), np.hstack([-tents, -np.ones((count, 1))])])
    cost, bounds = np.append(np.zeros(len(knots)), 1.0), [(None, None)] * len(knots) + [(0.0, None)]
    least = linprog(cost, A_ub=rows, b_ub=np.append(high, -low), bounds=bounds).fun
    off = max(np.max(low - line), np.max(line - high), 0.0)
    assert off <= least + 1e-3


def test_stiffness_of_very_many_passes_costs_no_more():
    x = np.concatenate([np.linspace(0.0, 5000.0, 4) for _ in range(3000)])
    is_free, asked = np.zeros(len(x), dtype=bool), []
    is_free[::4] = True

    def bending(rows, place):
        asked.append(len(rows))
        return softer_away_from(x, 0.0)(rows, place)

    external, _ = planned(x, is_free, bending=bending)
    assert sum(asked) <= 2 * MOST_THAT_BEND
    assert (np.abs(x - external) < REACH_MM).all()


@pytest.mark.parametrize("seed", range(40))
def test_a_taut_line_is_the_shortest_in_its_corridor(seed):
    """Beside it a linear program: no line between the bounds has a shorter way in e than the taut one."""
    from scipy.optimize import linprog

    random = np.random.default_rng(seed)
    count = int(random.integers(2, 25))
    at = np.cumsum(random.uniform(0.1, 3.0, count))
    middle = np.cumsum(random.normal(0.0, 2.0, count))
    half = random.uniform(0.1, 3.0, count)
    low, high = middle - half, middle + half
    line = taut(at, low, high)
    assert (line >= low - 1e-9).all()
    assert (line <= high + 1e-9).all()
    # least sum of |differences|: variables e and the differences d >= |e[k + 1] - e[k]|
    steps = np.diff(np.eye(count), axis=0)
    rows = np.block([[steps, -np.eye(count - 1)], [-steps, -np.eye(count - 1)]])
    cost = np.concatenate([np.zeros(count), np.ones(count - 1)])
    bounds = [*zip(low, high, strict=True), *[(0.0, None)] * (count - 1)]
    best = linprog(cost, A_ub=rows, b_ub=np.zeros(len(rows)), bounds=bounds).fun
    assert np.abs(np.diff(line)).sum() == pytest.approx(best, abs=1e-6)


def test_a_table_that_follows_keeps_the_tool_in_one_plane():
    azimuth = np.linspace(0.3, 0.3 + 5.0 * np.pi, 200)
    tilt = 0.4 + 0.1 * np.sin(azimuth)
    axis = np.stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)], axis=1)
    angle = np.radians(following_deg(axis, np.array([0.0, 0.0, 1.0])))
    turned = np.cos(angle) * axis[:, 0] - np.sin(angle) * axis[:, 1]
    across = np.sin(angle) * axis[:, 0] + np.cos(angle) * axis[:, 1]
    assert np.allclose(np.arctan2(across, turned), 0.3)
    assert angle[-1] == pytest.approx(-5.0 * np.pi)  # no jump of a full turn
    assert not following_deg(np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([0.0, 0.0, 1.0])).any()
