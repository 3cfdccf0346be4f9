"""How late a run is: along its motion, against known delays."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Applied, library
from gcode2krl.gap.compare.clocks import late_s, residual_by_place, timing_share, timing_sizes
from tests.gap.constructed import joint_rates, joints, trace

NOMINAL = trace(np.zeros((500, 6)), "path")
RATE = joint_rates(NOMINAL.time_s)
INSIDE = slice(10, -10)


def with_residual(residual):
    return replace(NOMINAL, measured=NOMINAL.nominal + residual)


def test_late_by_a_time_is_behind_by_the_way_gone_in_it():
    delay = 3e-3 * np.sin(NOMINAL.time_s)
    one = with_residual(-delay[:, None] * RATE)
    late, moves = late_s(one, one.residual)
    assert moves.all()
    np.testing.assert_allclose(late[INSIDE], delay[INSIDE], atol=2e-5)


def test_what_stands_tells_no_time():
    planned = NOMINAL.inputs.q_cmd_rad
    halfway = np.where(NOMINAL.time_s[:, None] < 5.0, planned, planned[250])
    stopped = replace(NOMINAL.inputs, q_cmd_rad=halfway)
    late, moves = late_s(trace(np.ones((500, 6)), "path", inputs=stopped), np.ones((500, 6)))
    assert moves[10:240].all()
    assert not moves[260:].any()
    assert not late[260:].any()


def test_a_residual_along_the_motion_is_timing_and_one_across_is_none():
    assert timing_share([with_residual(2e-3 * RATE)]) == pytest.approx(1.0, abs=1e-3)
    across = np.stack([RATE[:, 1], -RATE[:, 0], *np.zeros((4, 500))], axis=1)
    assert timing_share([with_residual(2e-3 * across)]) == pytest.approx(0.0, abs=1e-3)
    along, beside = 2e-3 * RATE, 2e-3 * across
    expected = np.sum(along**2) / (np.sum(along**2) + np.sum(beside**2))
    assert timing_share([with_residual(along + beside)]) == pytest.approx(expected, abs=2e-3)
    assert timing_share([NOMINAL]) == 0.0


def test_sizes_are_rms_delays_before_and_after():
    one = replace(NOMINAL, measured=replace(NOMINAL, time_s=NOMINAL.time_s - 0.01).nominal)
    other = replace(NOMINAL, measured=replace(NOMINAL, time_s=NOMINAL.time_s - 0.03).nominal)
    late = Applied(library()["clock"], "controller", {"offset_s": 0.01, "skew": 0.0})
    before, after = timing_sizes([one, other], [late])
    assert before == pytest.approx(np.sqrt((0.01**2 + 0.03**2) / 2.0), rel=0.01)
    assert after == pytest.approx(np.sqrt(0.02**2 / 2.0), rel=0.01)
    assert timing_sizes([one], []) == (pytest.approx(0.01, rel=0.01),) * 2


def stopped(hold_s, beside_rad=0.0, at_s=4.0):
    """Return a run that stands for a while, and is beside its path by a constant in A6."""
    time_s = NOMINAL.time_s
    gone_s = np.where(time_s < at_s, time_s, np.maximum(time_s - hold_s, at_s))
    return replace(NOMINAL, measured=joints(gone_s) + beside_rad * np.eye(6)[5])


@pytest.mark.parametrize("hold_s", [0.1, 0.8])
def test_a_lateness_of_any_size_is_as_it_would_be_if_it_were_small(hold_s):
    """As much later from the stop on, where the rows end too, and beside the path what is beside it."""
    one = stopped(hold_s, beside_rad=2e-4)
    late = np.where(NOMINAL.time_s < 4.0, 0.0, hold_s)
    expected = -late[:, None] * RATE + 2e-4 * np.eye(6)[5]
    ends = NOMINAL.time_s > NOMINAL.time_s[-1] - hold_s
    away = (np.abs(NOMINAL.time_s - 4.0) > 0.05) & ~ends
    left = residual_by_place(one, ())
    np.testing.assert_allclose(left[away], expected[away], atol=1e-3)
    np.testing.assert_allclose(left[ends], -hold_s * one.rate[ends], atol=1e-2)
    assert np.abs(one.residual[away] - expected[away]).max() > 5e-3


def test_small_lateness_and_another_path_are_compared_at_the_same_time():
    soon = stopped(0.02)
    np.testing.assert_array_equal(residual_by_place(soon, ()), soon.residual)
    elsewhere = replace(NOMINAL, measured=0.3 * np.cumsum(RATE[::-1], axis=0))
    np.testing.assert_array_equal(residual_by_place(elsewhere, ()), elsewhere.residual)
    late_force = replace(stopped(0.8), link=trace(np.zeros((500, 6)), "servo").link)
    np.testing.assert_array_equal(residual_by_place(late_force, ()), late_force.residual)
