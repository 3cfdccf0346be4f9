"""Filters and the gain of a compensation: each against figures that were found otherwise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from gcode2krl.cell.sections.online import Online
from gcode2krl.online.compensator import filter_start, filtered
from gcode2krl.online.outcome import MATTERS_MM, gain_of

SETTINGS = Online()


def run(load, settings=SETTINGS):
    return filtered(filter_start(settings), load, settings)[1:]


def test_low_pass_and_average_are_those_of_scipy_and_numpy():
    load = np.random.default_rng(1).normal(size=(400, 6))
    load[0] = 0.0  # both begin at zero
    share = 1.0 - np.exp(-2.0 * np.pi * 4.0 * 0.004)
    low = lfilter([share], [1.0, share - 1.0], load, axis=0)
    mean = np.stack([np.convolve(c, np.full(10, 0.1))[: len(c)] for c in low.T], axis=1)
    out, lost = run(load)
    np.testing.assert_allclose(out, mean, atol=1e-12)
    assert not lost.any()


def test_a_force_step_shows_to_90_percent_after_the_papers_100_to_150_ms():
    from gcode2krl.online.plant import reaction

    load = np.zeros((200, 6))
    load[50:, 0] = 500.0
    out, _ = run(load)
    time_s = 0.004 * np.arange(200)
    moved = reaction(out[:, :1], time_s, 0.012, 0.012)[:, 0]
    behind_s = time_s[np.argmax(moved > 450.0)] - time_s[50] + 0.004  # and the telegram from the sensor
    assert 0.100 <= behind_s <= 0.150


def test_the_first_sample_makes_no_transient():
    out, _ = run(np.full((5, 6), 7.0))
    np.testing.assert_allclose(out, 7.0, atol=1e-12)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_silent_sensor_holds_the_value_and_is_lost_after_20_ms(bad):
    load = np.full((40, 6), 3.0)
    load[20:, 2] = bad
    out, lost = run(load)
    np.testing.assert_allclose(out, 3.0, atol=1e-12)
    assert np.flatnonzero(lost)[0] == 20 + 5


def test_a_force_that_is_no_cut_is_lost_at_once():
    load = np.zeros((10, 6))
    load[5, 0] = 5000.0
    out, lost = run(load)
    assert lost.tolist() == [False] * 5 + [True] + [False] * 4
    assert np.abs(out).max() == 0.0


@settings(deadline=None)
@given(st.lists(st.integers(1, 30), min_size=1, max_size=8), st.integers(0, 2**32 - 1))
def test_a_stream_may_be_cut_anywhere(lengths, seed):
    load = np.random.default_rng(seed).normal(scale=100.0, size=(sum(lengths), 6))
    load[::7, 1] = np.nan
    whole, _ = run(load)
    state, parts, at = filter_start(SETTINGS), [], 0
    for length in lengths:
        state, out, _ = filtered(state, load[at : at + length], SETTINGS)
        parts.append(out)
        at += length
    assert np.array_equal(np.concatenate(parts), whole)


def test_a_case_by_hand():
    before = np.array([1.0, 1.0, 1.0, 1.0, 0.2, 9.0])
    after = np.array([0.1, 0.1, 0.1, 1.0 + 0.5 * MATTERS_MM, 0.5, 0.0])
    line = np.array([7, 7, 8, 8, 9, 9], dtype=np.int32)
    counts = np.array([True, True, True, True, True, False])
    gain = gain_of(before, after, counts, line, 0.012)
    assert gain.rms_mm == pytest.approx(np.sqrt((3 * 0.01 + (1.0 + 0.5 * MATTERS_MM) ** 2 + 0.25) / 5))
    assert gain.rms_less_percent == pytest.approx(100.0 * (1.0 - gain.rms_mm / np.sqrt(4.04 / 5)))
    assert (gain.better_share, gain.worse_share) == (0.6, 0.2)
    assert gain.worst_line == 8
    assert gain.worse == ((9, pytest.approx(0.3), pytest.approx(0.012)),)
    assert gain.as_dict()["worse"] == [
        {"line": 9, "excess_mm": pytest.approx(0.3), "time_s": pytest.approx(0.012)}
    ]


def test_the_worst_lines_stand_first_and_are_few():
    line = np.arange(1, 21, dtype=np.int32)
    gain = gain_of(np.ones(20), 1.0 + 0.02 * line, np.ones(20, dtype=bool), line, 0.004)
    assert [each.line for each in gain.worse] == [20, 19, 18, 17, 16]
    assert gain.worse_share == 1.0


def test_nothing_judged_is_no_gain():
    assert (
        gain_of(np.ones(3), np.ones(3), np.zeros(3, dtype=bool), np.zeros(3, dtype=np.int32), 0.012) is None
    )


def test_without_any_deviation_there_is_no_percentage():
    gain = gain_of(np.zeros(3), np.zeros(3), np.ones(3, dtype=bool), np.ones(3, dtype=np.int32), 0.012)
    assert gain.rms_less_percent is None
    assert gain.better_share == gain.worse_share == 0.0
