"""The worst places: the largest ones, no two of them one."""

import numpy as np
import pytest

from gcode2krl.report.worst_places import HALF_S, around, lost_s, worst_rows

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
