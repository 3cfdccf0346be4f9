"""Clocks and time laws: known offsets and delays come back, and what is no clock is not taken for one."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Applied, library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.compare.clocks import (
    coarse_offset,
    fitted_offset,
    late_s,
    refined,
    residual_by_place,
    retimed,
    timing_share,
    timing_sizes,
    with_coarse_clocks,
    with_controller_clocks,
    with_table_clock,
)
from gcode2krl.gap.compare.links import PATH
from gcode2krl.gap.compare.trace import Context
from gcode2krl.runs import Tracker
from tests.gap.constructed import controller, joint_rates, joints, motion, noise, pair, table, trace

# Clocks: known offsets come back, and what is no clock is not taken for one

LONG = motion(40.0)
STAMPS_S = np.arange(0.3, 36.0, 0.02)


def late(offset_s, sigma_rad=0.0):
    """Return a run's path whose samples are older than their stamps."""
    one = trace(np.zeros((500, 6)), "path")
    moved = replace(one, time_s=one.time_s - offset_s).nominal
    return replace(one, measured=moved + noise(500, 1, sigma_rad, 6) if sigma_rad else moved)


def run(offset_s=0.0, stretch=1.0, **more):
    """Return a run of the long motion with its table's clock off, or at another pace."""
    q = joints((STAMPS_S - offset_s) / stretch)
    return pair(LONG, controller=controller(STAMPS_S, q_cmd_rad=q), **more)


@pytest.mark.parametrize("offset_s", [0.0, 1e-3, -0.02, 0.3])
def test_an_offset_comes_back(offset_s):
    found, deviation = fitted_offset(late(offset_s))
    assert found == pytest.approx(offset_s, abs=2e-4)
    assert deviation < 1e-3


def test_its_deviation_is_that_of_least_squares():
    found, deviation = fitted_offset(late(2e-3, 1e-4))
    rate = trace(np.zeros((500, 6)), "path").rate
    expected = 1e-4 / np.sqrt(np.sum((rate - rate.mean(axis=0)) ** 2))
    assert deviation == pytest.approx(expected, rel=0.1)
    assert abs(found - 2e-3) < 4.0 * deviation


def test_a_zero_of_each_component_is_no_clock():
    one = late(5e-3)
    shifted = replace(one, measured=one.measured + np.arange(6) * 0.01)
    assert fitted_offset(shifted)[0] == pytest.approx(5e-3, abs=1e-4)


def test_what_does_not_move_has_no_clock():
    assert fitted_offset(trace(noise(500, 2), "servo")) == (0.0, np.inf)


@pytest.mark.parametrize("offset_s", [2.0, -1.5, 0.2])
def test_large_offsets_are_found_by_how_the_motion_follows(offset_s):
    made = run(offset_s)
    assert coarse_offset(made, made.run.controller) == pytest.approx(offset_s, abs=0.03)
    assert with_coarse_clocks(made).clock_s["controller"] == pytest.approx(offset_s, abs=0.03)


def test_a_trackers_clock_is_found_by_its_own_motion():
    tip = joints(STAMPS_S - 1.0)[:, :3]
    lengths = replace(LONG, position_mm=LONG.q_cmd_rad[:, :3])
    made = pair(lengths, tracker=table(Tracker, STAMPS_S, position_mm=tip))
    assert with_coarse_clocks(made).clock_s == {"tracker": pytest.approx(1.0, abs=0.03)}


def test_small_offsets_are_left_to_the_effect_and_another_time_law_is_no_clock():
    for made in (run(), run(0.01), run(stretch=1.03)):
        assert coarse_offset(made, made.run.controller) == 0.0
    assert with_coarse_clocks(replace(run(2.0), from_log=True)).clock_s == {}


def test_no_commanded_joints_no_clock():
    made = pair(LONG, controller=controller(STAMPS_S))
    assert coarse_offset(made, made.run.controller) == 0.0


def test_a_tables_clock_is_set_by_its_link():
    made = with_table_clock(run(0.015), PATH)
    assert made.clock_s["controller"] == pytest.approx(0.015, abs=1e-4)
    (left,) = PATH.traces([made])
    assert np.abs(left.residual).max() < 2e-6
    bare = pair(LONG)
    assert with_table_clock(bare, PATH) is bare


def context(*pairs):
    return Context(tuple(pairs), len(pairs), {}, Mismatch())


def test_controllers_that_keep_to_the_plan_have_their_clocks_set():
    offsets = [1.2e-3, -0.7e-3, 0.1e-3]
    found = with_controller_clocks(context(*(run(o, number=i) for i, o in enumerate(offsets))), PATH)
    assert found.clocks_set
    assert [one.clock_s["controller"] for one in found.pairs] == pytest.approx(offsets, abs=1e-5)


def test_an_offset_that_all_share_beyond_mismatch_is_left_to_be_found():
    offsets = [10.5e-3, 10e-3, 9.5e-3]
    found = with_controller_clocks(context(*(run(o, number=i) for i, o in enumerate(offsets))), PATH)
    assert [one.clock_s["controller"] for one in found.pairs] == pytest.approx([5e-4, 0.0, -5e-4], abs=2e-5)


def test_runs_on_another_time_law_keep_their_clocks():
    before = context(run(stretch=1.02))
    assert with_controller_clocks(before, PATH) is before


# How late a run is: along its motion, against known delays

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


# The run's own timing: samples of the plan get the times at which the run was there

INPUTS = motion()
PLAN_S = INPUTS.time_s


def timed(when, end_s, **more):
    """Return a run that is at the plan's time t at its own time ``when(t)``."""
    own = np.linspace(0.0, PLAN_S[-1], 4000)
    stamps = np.arange(0.0, end_s, 0.012)
    q = joints(np.interp(stamps, when(own), own))
    return pair(controller=controller(stamps, q_cmd_rad=q, **more))


def test_a_run_at_half_speed_takes_twice_the_time():
    found = retimed(timed(lambda t: 2.0 * t, 2.0 * PLAN_S[-1])).inputs
    np.testing.assert_allclose(found.time_s, 2.0 * PLAN_S, atol=0.02)
    np.testing.assert_array_equal(found.q_cmd_rad, INPUTS.q_cmd_rad)  # where it goes is as planned


def test_a_run_that_is_held_up_on_its_way_is_met_everywhere():
    def when(t):
        return t + 0.8 / (1.0 + np.exp(-(t - 4.0) / 0.2))

    found = retimed(timed(when, PLAN_S[-1] + 0.8))
    np.testing.assert_allclose(found.inputs.time_s, when(PLAN_S), atol=0.02)
    (path,) = PATH.traces([found])
    assert np.sqrt(np.mean(path.residual**2)) < 2e-3


def test_standing_takes_time_and_no_way():
    def when(t):
        return np.where(t < 5.0, t, t + 3.0)

    found = retimed(timed(when, PLAN_S[-1] + 3.0)).inputs
    np.testing.assert_allclose(found.time_s[PLAN_S < 4.9], PLAN_S[PLAN_S < 4.9], atol=0.02)
    np.testing.assert_allclose(found.time_s[PLAN_S > 5.1], PLAN_S[PLAN_S > 5.1] + 3.0, atol=0.02)
    assert (np.diff(found.time_s) > 0.0).all()


def test_a_path_of_another_length_is_left_alone():
    made = timed(lambda t: t, PLAN_S[-1])
    longer = replace(made.run.controller, q_cmd_rad=1.05 * made.run.controller.q_cmd_rad)
    other = replace(made, run=replace(made.run, controller=longer))
    assert retimed(other) is other
    assert retimed(pair()).inputs is INPUTS


@pytest.mark.parametrize("most_s", [1e-3, 0.02])
def test_small_delays_here_and_there_come_off_to_fractions_of_them(most_s):
    def when(t):
        return t + most_s * np.sin(1.3 * t) ** 2

    before = timed(when, PLAN_S[-1])
    found = refined(before, PATH)
    np.testing.assert_allclose(found.inputs.time_s, when(PLAN_S), atol=4e-4)
    rms = [np.sqrt(np.mean(PATH.traces([each])[0].residual ** 2)) for each in (before, found)]
    assert rms[1] < 0.3 * rms[0]


def test_what_is_late_by_more_is_no_small_delay():
    far = timed(lambda t: 1.05 * t, PLAN_S[-1] * 1.05)
    assert refined(far, PATH) is far


def test_a_run_on_time_is_left_as_it_is():
    on_time = timed(lambda t: t, PLAN_S[-1])
    assert refined(on_time, PATH) is on_time
    bare = pair()
    assert refined(bare, PATH) is bare
