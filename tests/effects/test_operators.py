"""Operators with memory against closed forms and brute-force integration."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from gcode2krl.effects.operators import delayed, lag, play, second_order, since_reversal

T = np.arange(500) * 0.012


def test_play_of_a_sine():
    x, r = np.sin(2.0 * np.pi * T), 0.2
    y = play(x, r)
    falling = (T > 0.5) & (T < 0.72)  # behind the first maximum the play has been crossed
    np.testing.assert_allclose(y[falling], np.minimum(1.0 - r, x[falling] + r), atol=1e-3)
    assert np.abs(y - x).max() <= r + 1e-15


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=40), st.floats(0, 2))
def test_play_moves_only_when_pushed(values, half_width):
    x = np.array(values)
    y = play(x, half_width)
    assert (np.abs(y - x) <= half_width + 1e-12).all()
    rests = np.diff(y) == 0.0
    pushed = np.isclose(np.abs(y - x)[1:], half_width, atol=1e-12)
    assert (rests | pushed).all()


@given(st.lists(st.floats(-5, 5), min_size=2, max_size=30), st.floats(0, 1))
def test_play_does_not_care_how_fast(values, half_width):
    """Rate independence: samples in between change nothing at the samples."""
    x = np.array(values)
    fine = np.interp(np.arange(0, len(x) - 0.75, 0.25), np.arange(len(x)), x)
    np.testing.assert_allclose(play(fine, half_width)[::4], play(x, half_width), atol=1e-12)


def test_play_without_width_is_its_input():
    x = np.sin(T)
    np.testing.assert_array_equal(play(x, 0.0), x)


@pytest.mark.parametrize("tau", [0.003, 0.02, 0.3])
def test_lag_of_a_ramp(tau):
    np.testing.assert_allclose(lag(2.0 * T, T, tau), 2.0 * (T - tau * (1.0 - np.exp(-T / tau))), atol=1e-12)


def test_lag_of_a_sine_has_its_gain_and_phase():
    tau, w = 0.05, 2.0 * np.pi
    settled = T > 1.0
    wanted = np.sin(w * T - np.arctan(w * tau)) / np.hypot(1.0, w * tau)
    np.testing.assert_allclose(lag(np.sin(w * T), T, tau)[settled], wanted[settled], atol=1e-3)


@pytest.mark.parametrize("tau", [0.0002, 0.003, 0.02, 0.3])
def test_lag_of_what_changes_from_sample_to_sample(tau):
    """Against steps a thousandth as long through the cubic of the samples and their central differences."""
    x = np.random.default_rng(5).normal(size=60)
    t = 0.004 * np.arange(len(x))
    fine_s = np.linspace(0.0, t[-1], 1000 * (len(x) - 1) + 1)
    slopes = np.gradient(x, t)
    slopes[0] = 2.0 * slopes[0] - slopes[1]  # as a parabola begins
    fine = CubicHermiteSpline(t, x, slopes)(fine_s)
    kept = np.exp(-(fine_s[1] - fine_s[0]) / tau)
    follows, y = [x[0]], x[0]
    for before, after in itertools.pairwise(fine):
        y = kept * y + (1.0 - kept) * (before + after) / 2.0
        follows.append(y)
    np.testing.assert_allclose(lag(x, t, tau), follows[::1000], atol=2e-3)


@pytest.mark.parametrize(("hz", "damping"), [(7.0, 0.03), (25.0, 0.01), (12.0, 0.3)])
def test_second_order_against_integration(hz, damping):
    rng = np.random.default_rng(3)
    t = T[:120]
    x = np.cumsum(rng.normal(size=len(t)))
    w = 2.0 * np.pi * hz

    def slope(time, state):
        return [state[1], w * w * (np.interp(time, t, x) - state[0]) - 2.0 * damping * w * state[1]]

    state, found = [x[0], 0.0], [x[0]]
    for start, end in itertools.pairwise(t):
        state = solve_ivp(slope, (start, end), state, rtol=1e-9, atol=1e-9).y[:, -1]
        found.append(state[0])
    np.testing.assert_allclose(second_order(x, t, hz, damping), found, atol=1e-5)


def test_second_order_rests_under_a_constant():
    np.testing.assert_allclose(second_order(np.full(100, 3.0), T[:100], 9.0, 0.02), 3.0, atol=1e-12)


def test_reversals_of_a_sine():
    hz = 0.37
    direction, since = since_reversal(np.sin(2.0 * np.pi * hz * T), T)
    turns = (np.arange(6) + 0.5) / (2.0 * hz)
    number = np.searchsorted(turns, T) - 1
    clear = np.abs(T[:, None] - turns).min(axis=1) > 0.012
    np.testing.assert_array_equal(direction[clear], np.where(number % 2 == 0, -1.0, 1.0)[clear])
    late = clear & (number >= 0)
    np.testing.assert_allclose(since[late], T[late] - turns[number[late]], atol=1e-3)
    assert np.isinf(since[number < 0]).all()


def test_a_rest_is_no_reversal_and_counts_to_the_turn_behind_it():
    there = np.concatenate([np.linspace(0, 1, 50), np.ones(30), np.linspace(1, 2, 50), np.full(20, 2.0)])
    q = np.concatenate([there, np.linspace(2, 1, 40)[1:]])
    t = np.arange(len(q)) * 0.01
    direction, since = since_reversal(q, t)
    leaves = len(there) - 1
    assert np.isinf(since[:leaves]).all()
    assert (direction[:leaves] == 1.0).all()
    np.testing.assert_allclose(since[leaves + 1 :], t[leaves + 1 :] - t[leaves], atol=1e-12)
    assert (direction[leaves + 1 :] == -1.0).all()


def test_noise_is_no_reversal():
    rng = np.random.default_rng(1)
    _, since = since_reversal(0.1 * T + rng.uniform(-4e-6, 4e-6, len(T)), T)
    assert np.isinf(since).all()
    direction, since = since_reversal(np.full(50, 0.3), T[:50])
    assert not direction.any()
    assert np.isinf(since).all()


@pytest.mark.parametrize("delay_s", [0.001, 0.0019, 0.0183])
def test_a_delay_bends_a_sine_less_than_a_lag_does(delay_s):
    t = np.arange(0.0, 4.0, 0.004)
    late = delayed(np.sin(2.0 * np.pi * t)[:, None], t, delay_s)[:, 0]
    exact = np.sin(2.0 * np.pi * (t - delay_s))
    assert np.abs(late - exact)[10:].max() < 2e-6
    assert np.abs(lag(np.sin(2.0 * np.pi * t), t, delay_s) - exact)[10:].max() > 1e-5


def test_what_is_delayed_rests_before():
    t = np.arange(0.0, 1.0, 0.004)
    assert delayed((3.0 + t)[:, None], t, 0.1)[:25] == pytest.approx(3.0, abs=1e-12)
