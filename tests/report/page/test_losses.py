"""Where time is lost, and the passes of a page."""

import numpy as np
import pytest

from gcode2krl.report.page.losses import (
    durations,
    lost_parts,
    lost_time,
    time_shares,
    worst_places,
    worst_windows,
)
from gcode2krl.report.page.passes import MOST_PASSES, passes_of

TIME = np.arange(0.0, 100.0 + 1e-9, 0.1)


def test_each_sample_stands_for_half_the_way_to_its_neighbours():
    assert durations(np.array([0.0, 1.0, 4.0])).tolist() == [0.5, 2.0, 1.5]


def test_half_the_feed_costs_half_of_the_time():
    """100 s at 5 mm/s are 500 mm, which take 50 s at 10 mm/s."""
    lost = lost_time(TIME, np.full(1001, 5.0), np.full(1001, 10.0))
    assert lost.sum() == pytest.approx(50.0)


def test_nothing_is_lost_on_rapids_or_above_the_feed():
    feed = np.where(TIME < 50.0, np.inf, 10.0)
    assert lost_time(TIME, np.full(1001, 11.0), feed).sum() == 0.0


def test_shares_add_up_and_are_told_apart():
    rapid, cutting = TIME < 20.0, TIME > 60.0
    speed = np.where((TIME > 30.0) & (TIME < 35.0), 0.0, 10.0)
    shares = dict(time_shares(TIME, speed, rapid, cutting))
    assert sum(shares.values()) == pytest.approx(100.0)
    assert shares["rapid"] == pytest.approx(20.0, abs=0.11)
    assert shares["standing still"] == pytest.approx(5.0, abs=0.11)
    assert shares["cutting"] == pytest.approx(40.0, abs=0.11)
    assert "at feed" in dict(time_shares(TIME, speed, rapid, None))


def test_the_window_with_the_slow_stretch_is_named_first():
    speed = np.full(1001, 10.0)
    speed[(TIME >= 40.0) & (TIME < 43.0)] = 1.0
    line = (TIME * 10).astype(np.int32) + 1
    lost = lost_time(TIME, speed, np.full(1001, 10.0))
    found = worst_windows(TIME, lost, line)
    assert 38.0 < found[0].start_s <= found[0].end_s < 44.0
    assert 380 < found[0].first_line < found[0].last_line < 450
    assert sum(window.lost_s for window in found) == pytest.approx(2.7, abs=0.1)


def test_no_window_where_hardly_anything_is_lost_or_all_is_alike():
    line = np.ones(1001, np.int32)
    assert worst_windows(TIME, np.full(1001, 1e-6), line) == []
    assert worst_windows(TIME, lost_time(TIME, np.full(1001, 5.0), np.full(1001, 10.0)), line) == []
    assert worst_windows(np.zeros(1), np.zeros(1), line[:1]) == []


def test_worst_places_lie_apart():
    values = np.zeros(1001)
    values[[100, 101, 400, 900]] = [9.0, 8.9, 5.0, 7.0]
    values[500] = np.nan
    line = (TIME / 5.0).astype(np.int32)
    found = worst_places(values, TIME, line)
    assert [place.row for place in found] == [100, 900, 400]
    assert found[0].time_s == pytest.approx(10.0)
    assert worst_places(np.full(5, np.nan), TIME[:5], line[:5]) == []


def test_lost_time_is_that_of_stops_and_that_of_the_rest():
    """A stop with ramps of 1 s, and a stretch of 1 s at half the speed that is left and reached in 0.5 s."""
    time_s = np.linspace(0.0, 10.0, 1001)
    speed = np.interp(time_s, [0, 1, 3, 4, 5, 6, 7, 7.5, 8.5, 9, 10], [0, 10, 10, 0, 0, 10, 10, 5, 5, 10, 10])
    lost_s = lost_time(time_s, speed, np.full(1001, 10.0))
    (stops, at_stops_s), (rest, elsewhere_s) = lost_parts(lost_s, speed)
    assert (stops, rest) == ("at stops", "at corners and on short moves")
    assert at_stops_s == pytest.approx(0.5 + 0.5 + 1.0 + 0.5, abs=0.02)
    assert elsewhere_s == pytest.approx(0.125 + 0.5 + 0.125, abs=0.02)
    assert at_stops_s + elsewhere_s == pytest.approx(lost_s.sum())
    assert lost_parts(np.zeros(1), np.zeros(1)) == []


def motion(*runs):
    """Samples of runs (tool, z, count), each after two rapid samples."""
    z, rapid, tool, line = [], [], [], []
    for number, (own, height, count) in enumerate(runs):
        z += [20.0, 20.0, *[height] * count]
        rapid += [True, True, *[False] * count]
        tool += [own] * (count + 2)
        line += [10 * number + 1] * 2 + [10 * number + 2] * count
    return np.array(z), np.array(rapid), np.array(tool, np.int32), np.array(line, np.int32)


def test_a_pass_lies_between_two_rapids():
    number, passes = passes_of(*motion((1, -2.0, 4), (1, -4.0, 3), (2, -4.0, 5)))
    assert number.tolist() == [-1, -1, 0, 0, 0, 0, -1, -1, 1, 1, 1, -1, -1, 2, 2, 2, 2, 2]
    assert [(one.tool, one.low_mm, one.first_line) for one in passes] == [
        (1, -2, 2),
        (1, -4, 12),
        (2, -4, 22),
    ]
    assert passes[2].name == "T2, Z -4.00 mm, lines 22-22"


def test_the_same_height_twice_stays_two_passes_while_there_are_few():
    """Else the second would hide the first."""
    _, passes = passes_of(*motion((1, -2.0, 4), (1, -2.0, 4)))
    assert len(passes) == 2


def test_a_tool_change_without_a_rapid_begins_a_pass():
    z, tool = np.zeros(6), np.array([1, 1, 1, 2, 2, 2], np.int32)
    number, _ = passes_of(z, np.zeros(6, bool), tool, np.arange(6, dtype=np.int32))
    assert number.tolist() == [0, 0, 0, 1, 1, 1]


def test_many_runs_are_joined_by_tool_and_height():
    runs = [(tool, -float(level), 3) for tool in (1, 2) for _ in range(10) for level in (1, 2, 3)]
    number, passes = passes_of(*motion(*runs))
    assert len(passes) == 6
    z, rapid, tool, _ = motion(*runs)
    for k, one in enumerate(passes):
        rows = number == k
        assert set(tool[rows]) == {one.tool}
        assert len(set(z[rows])) == 1
        assert np.count_nonzero(rows) == 30
    assert (number[rapid] == -1).all()


def test_many_heights_become_bands_without_losing_a_sample():
    runs = [(1, -0.137 * level, 2) for level in range(500)]
    number, passes = passes_of(*motion(*runs))
    assert 1 < len(passes) <= MOST_PASSES
    assert np.count_nonzero(number >= 0) == 1000
    tops = [one.high_mm for one in passes]
    assert tops == sorted(tops, reverse=True)


def test_a_motion_of_rapids_has_no_pass():
    number, passes = passes_of(np.zeros(3), np.ones(3, bool), np.ones(3, np.int32), np.ones(3, np.int32))
    assert passes == []
    assert number.tolist() == [-1, -1, -1]
