"""Splits: no row on both sides, guards between them, gaps where rows were left out."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gcode2krl.gap.compare.trace import evenly_spread, folds_of, split, with_rows
from tests.gap.constructed import motion, trace

GUARD_S = 1.0
"""Longer than an instrument remembers."""


def run(number, seconds=20.0):
    count = round(seconds / 0.02)
    return trace(np.arange(count, dtype=float)[:, None], number=number, inputs=motion(seconds))


def rows(traces):
    """Return which rows of which run some traces have."""
    return {(one.run_number, round(float(t) * 1e4)) for one in traces for t in one.time_s}


@pytest.mark.parametrize("count", [2, 3])
def test_whole_runs_are_on_one_side(count):
    runs = [run(i) for i in range(count)]
    folds = folds_of(runs)
    assert len(folds) == count
    for kept, held in folds:
        assert not rows(kept) & rows(held)
        assert rows(kept) | rows(held) == rows(runs)


@pytest.mark.parametrize("seed", range(5))
def test_no_row_of_a_single_run_is_on_both_sides_and_each_is_held_out_once(seed):
    generator = np.random.default_rng(seed)
    one = run(0)
    power = generator.gamma(0.3, 1.0, len(one.time_s))
    folds = folds_of([one], [power])
    held_rows = [rows(held) for _, held in folds]
    assert sum(len(each) for each in held_rows) == len(set.union(*held_rows)) == len(one.time_s)
    for kept, held in folds:
        assert not rows(kept) & rows(held)
        first, last = held[0].time_s[[0, -1]]
        away = np.maximum(first - kept[0].time_s, kept[0].time_s - last)
        assert away.min() > GUARD_S


def test_quarters_have_a_quarter_of_the_power_each():
    """But for a fifth that is shared out by rows, so that rows without power belong somewhere too."""
    one = run(0, 60.0)
    power = np.exp(-one.time_s / 20.0)
    share = (power / power.sum() + 0.2 / len(power)) / 1.2
    at = {round(float(t) * 1e4): each for t, each in zip(one.time_s, share, strict=True)}
    for _, held in folds_of([one], [power]):
        assert sum(at[stamp] for _, stamp in rows(held)) == pytest.approx(0.25, abs=2e-3)


def test_where_one_run_has_the_power_its_quarters_are_held_out():
    runs = [run(0), run(1)]
    folds = folds_of(runs, [np.ones(1000), 0.1 * np.ones(1000)])
    assert len(folds) == 4
    for kept, held in folds:
        assert not rows(kept) & rows(held)


def test_values_stay_with_their_stamps_and_gaps_begin_segments():
    one = run(0, 2.0)
    chosen = np.ones(100, dtype=bool)
    chosen[[0, 30, 31, 99]] = False
    found = with_rows(one, chosen)
    np.testing.assert_array_equal(found.measured, one.measured[chosen])
    np.testing.assert_array_equal(found.time_s, one.time_s[chosen])
    assert found.segments.tolist() == [[0, 29], [29, 96]]


@pytest.mark.parametrize("seed", range(10))
def test_segments_are_what_a_loop_over_rows_makes_them(seed):
    generator = np.random.default_rng(seed)
    one = run(0, 2.0)
    edges = np.sort(generator.choice(np.arange(1, 100), 3, replace=False))
    parted = replace(one, segments=np.array(list(pairwise([0, *edges, 100]))))
    chosen = generator.random(100) < 0.8
    expected, before = [], None
    for row in np.flatnonzero(chosen):
        owner = int(np.searchsorted(edges, row, side="right"))
        place = len(expected) and expected[-1][1]
        if before is None or row != before[0] + 1 or owner != before[1]:
            expected.append([place, place])
        expected[-1][1] += 1
        before = (row, owner)
    assert with_rows(parted, chosen).segments.tolist() == expected


def test_runs_that_explain_are_those_that_were_given_first():
    runs = [run(0, 2.0), run(1, 2.0), run(2, 2.0)]
    explain, held = split(runs, 2)
    assert ([one.run_number for one in explain], [one.run_number for one in held]) == ([0, 1], [2])
    # where only held-out runs have the signal they explain themselves
    explain, held = split(runs[2:], 2)
    assert ([one.run_number for one in explain], held) == ([2], [])


def test_of_long_runs_windows_all_over_the_time_are_judged():
    runs = [run(k, 4000.0) for k in range(2)]  # 400,000 values
    judged = evenly_spread(runs)
    assert sum(each.measured.size for each in judged) == pytest.approx(90_000, rel=0.02)
    for long, part in zip(runs, judged, strict=True):
        assert rows([part]) <= rows([long])
        gaps = np.diff(part.time_s, prepend=0.0, append=long.time_s[-1])
        assert gaps.max() < 9.0  # windows of 2 s, a quarter of them
        lasts = [part.time_s[last - 1] - part.time_s[first] for first, last in part.segments]
        assert min(lasts[1:-1]) > 1.9


@pytest.mark.parametrize("at_s", [1234.5, 1236.9, 2001.0])
def test_the_windows_around_a_step_are_judged(at_s):
    long = run(0, 8000.0)
    rest = np.random.default_rng(0).standard_normal((len(long.time_s), 1))
    stepped = replace(long, measured=long.nominal + rest + 1.5 * (long.time_s > at_s)[:, None])
    (judged,) = evenly_spread([stepped])
    around = np.abs(long.time_s - at_s) < 0.3
    assert set(long.time_s[around]) <= set(judged.time_s)


def test_ordinary_runs_and_poses_are_judged_whole():
    ordinary, poses = run(0, 1500.0), replace(run(0, 8000.0), still=True)
    assert evenly_spread([ordinary])[0] is ordinary
    assert evenly_spread([poses])[0] is poses
