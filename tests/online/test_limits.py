"""No correction leaves its sum, its rate and its step, whatever correction is wanted."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcode2krl.cell.sections.online import Gains, Online
from gcode2krl.online.limits import axis_bounds, cartesian_bounds, limit_start, limited

ANY = st.floats(allow_nan=True, allow_infinity=True)


def run(wanted, own, bounds, held=None):
    held = np.zeros(len(wanted), dtype=bool) if held is None else held
    return limited(limit_start(wanted.shape[1]), wanted, held, bounds)[1]


@settings(max_examples=60, deadline=None)
@given(arrays(float, (40, 3), elements=ANY), st.floats(-3, 3), st.floats(0, 50), st.floats(0, 0.05))
def test_cartesian_corrections_stay_in_their_bounds(wanted, p, i, d):
    own = Online(gains=Gains(p=p, i_1_s=i, d_s=d))
    sent = run(wanted, own, cartesian_bounds(own))
    assert np.isfinite(sent).all()
    assert np.linalg.norm(sent, axis=1).max() <= own.most_mm * (1 + 1e-12)
    steps = np.diff(sent, axis=0, prepend=np.zeros((1, 3)))
    assert np.linalg.norm(steps, axis=1).max() <= min(own.step_mm, own.rate_mm_s * own.cycle_s) * (1 + 1e-9)


@settings(max_examples=60, deadline=None)
@given(arrays(float, (40, 6), elements=ANY))
def test_axis_corrections_stay_in_theirs(wanted):
    own = Online(mode="axis")
    bounds = axis_bounds(own)
    sent = run(wanted, own, bounds)
    assert (np.abs(sent) <= bounds.most * (1 + 1e-12)).all()
    assert (np.abs(np.diff(sent, axis=0, prepend=np.zeros((1, 6)))) <= bounds.step * (1 + 1e-9)).all()


def test_what_is_held_stays():
    own = Online()
    wanted = np.full((60, 3), 1.0)
    held = np.zeros(60, dtype=bool)
    held[5:] = True
    sent = run(wanted, own, cartesian_bounds(own), held)
    assert (sent[5:] == sent[4]).all()


def test_without_gains_the_correction_is_what_is_wanted():
    own = Online()
    wanted = np.cumsum(np.random.default_rng(1).uniform(-0.05, 0.05, (100, 3)), axis=0)
    np.testing.assert_allclose(run(wanted, own, cartesian_bounds(own)), wanted, atol=1e-12)


@pytest.mark.parametrize("p", [0.5, 0.9, 1.2])
def test_with_an_integral_a_constant_correction_is_reached_whatever_p(p):
    own = Online(gains=Gains(p=p, i_1_s=20.0))
    sent = run(np.full((1000, 3), 0.7), own, cartesian_bounds(own))
    np.testing.assert_allclose(sent[-1], 0.7, atol=1e-3)


def test_the_integral_does_not_wind_up_at_the_limit():
    own = Online(gains=Gains(p=1.0, i_1_s=10.0))
    wanted = np.concatenate([np.full((2000, 3), 50.0), np.zeros((200, 3))])
    sent = run(wanted, own, cartesian_bounds(own))
    assert np.linalg.norm(sent[1999]) == pytest.approx(own.most_mm)
    assert np.linalg.norm(sent[-1]) < own.most_mm


@pytest.mark.parametrize("key", ["axis_most_deg", "axis_rate_deg_s"])
def test_bounds_of_zero_are_refused(key):
    with pytest.raises(ValueError, match=key):
        Online(**{key: (0.0, 1.0, 1.0, 1.0, 1.0, 1.0)})
