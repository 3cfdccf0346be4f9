"""Passes and worst places of a motion."""

import numpy as np
import pytest

from gcode2krl.report.passes import levels_of, passes_of
from gcode2krl.report.worst_places import HALF_S, around, lost_s, worst_rows


def program(*stretches):
    """Z and tool of stretches (tool, z from, z to, samples)."""
    z_mm = np.concatenate([np.linspace(start, end, count) for _, start, end, count in stretches])
    tool = np.concatenate([np.full(count, tool, dtype=np.int32) for tool, _, _, count in stretches])
    return z_mm, tool, np.ones(len(z_mm), dtype=bool)


def assert_each_once(passes, cuts):
    assert (np.sum([each.rows for each in passes], axis=0) == cuts).all()


def test_levels_and_what_leads_down_to_them():
    z_mm, tool, cuts = program((1, 0, -5, 100), (1, -5, -5, 900), (1, -5, -10, 100), (1, -10, -10, 900))
    cuts[:20] = False
    passes = passes_of(z_mm, tool, cuts)
    assert [each.name for each in passes] == ["T1, Z -5", "T1, Z -10"]
    assert_each_once(passes, cuts)
    assert passes[0].rows[50], "the ramp belongs to the level below it"
    assert passes[1].rows[1050]


def test_tools_are_apart_in_their_order():
    z_mm, tool, cuts = program((6, -5, -5, 500), (1, -5, -5, 500), (1, -7, -7, 500))
    assert [each.name for each in passes_of(z_mm, tool, cuts)] == ["T6", "T1, Z -5", "T1, Z -7"]


def test_a_surface_has_no_levels():
    z_mm, tool, cuts = program((13, 0, -8, 1000), (13, -8, 0, 1000))
    assert levels_of(z_mm, cuts).tolist() == []
    assert [each.name for each in passes_of(z_mm, tool, cuts)] == ["T13"]


@pytest.mark.parametrize("most", [4, 8])
def test_many_levels_are_put_together(most):
    z_mm, tool, cuts = program(*((1, -0.5 * k, -0.5 * k, 50) for k in range(1, 25)), (2, -1, -1, 50))
    passes = passes_of(z_mm, tool, cuts, most)
    assert len(passes) <= most
    assert_each_once(passes, cuts)
    assert passes[0].name.startswith("T1, Z -0.5 to -")
    assert passes[-1].name == "T2"


def test_many_tools_are_put_together():
    z_mm, tool, cuts = program(*((k, -1, -1, 50) for k in range(1, 13)))
    passes = passes_of(z_mm, tool, cuts)
    assert [each.name for each in passes] == [*(f"T{k}" for k in range(1, 8)), "5 other tools"]
    assert_each_once(passes, cuts)


TIME_S = np.arange(100_000) * 0.012


def test_the_largest_first_and_apart():
    values = np.zeros(len(TIME_S))
    values[[20_000, 20_005, 60_000, 90_000, 95_000]] = [8.0, 9.0, 7.0, 5.0, 6.0]
    assert worst_rows(TIME_S, values) == [20_005, 60_000, 95_000]


def test_of_a_plateau_its_begin():
    values = np.zeros(len(TIME_S))
    values[40_000:40_500] = 3.0
    assert worst_rows(TIME_S, values, places=1) == [40_000]


def test_nothing_is_no_place():
    assert worst_rows(TIME_S, np.full(len(TIME_S), np.nan)) == []


def test_window_holds_its_samples():
    shown = TIME_S[around(TIME_S, 5000)]
    assert shown[0] == pytest.approx(60.0 - HALF_S, abs=0.012)
    assert shown[-1] == pytest.approx(60.0 + HALF_S, abs=0.025)


def test_lost_time_against_the_feed():
    speed, feed = np.full(len(TIME_S), 50.0), np.full(len(TIME_S), 50.0)
    speed[50_000:50_400] = 10.0
    rapid = np.zeros(len(TIME_S), dtype=bool)
    rapid[80_000:90_000] = True
    speed[80_000:90_000] = 1.0
    lost = lost_s(TIME_S, speed, feed, rapid)
    assert lost[50_200] == pytest.approx(0.8 * 2 * HALF_S, abs=0.02)
    assert lost[85_000] == 0.0, "a rapid has no feed to lose against"
    assert lost[10_000] == 0.0
