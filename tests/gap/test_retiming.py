"""The run's own timing: samples of the plan get the times at which the run was there."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap.compare.clocks import refined, retimed
from gcode2krl.gap.compare.links import PATH
from tests.gap.constructed import controller, joints, motion, pair

INPUTS = motion()
PLAN_S = INPUTS.time_s


def run(when, end_s, **more):
    """Return a run that is at the plan's time t at its own time ``when(t)``."""
    own = np.linspace(0.0, PLAN_S[-1], 4000)
    stamps = np.arange(0.0, end_s, 0.012)
    q = joints(np.interp(stamps, when(own), own))
    return pair(controller=controller(stamps, q_cmd_rad=q, **more))


def test_a_run_at_half_speed_takes_twice_the_time():
    found = retimed(run(lambda t: 2.0 * t, 2.0 * PLAN_S[-1])).inputs
    np.testing.assert_allclose(found.time_s, 2.0 * PLAN_S, atol=0.02)
    np.testing.assert_array_equal(found.q_cmd_rad, INPUTS.q_cmd_rad)  # where it goes is as planned


def test_a_run_that_is_held_up_on_its_way_is_met_everywhere():
    def when(t):
        return t + 0.8 / (1.0 + np.exp(-(t - 4.0) / 0.2))

    found = retimed(run(when, PLAN_S[-1] + 0.8))
    np.testing.assert_allclose(found.inputs.time_s, when(PLAN_S), atol=0.02)
    (path,) = PATH.traces([found])
    assert np.sqrt(np.mean(path.residual**2)) < 2e-3


def test_standing_takes_time_and_no_way():
    def when(t):
        return np.where(t < 5.0, t, t + 3.0)

    found = retimed(run(when, PLAN_S[-1] + 3.0)).inputs
    np.testing.assert_allclose(found.time_s[PLAN_S < 4.9], PLAN_S[PLAN_S < 4.9], atol=0.02)
    np.testing.assert_allclose(found.time_s[PLAN_S > 5.1], PLAN_S[PLAN_S > 5.1] + 3.0, atol=0.02)
    assert (np.diff(found.time_s) > 0.0).all()


def test_a_path_of_another_length_is_left_alone():
    made = run(lambda t: t, PLAN_S[-1])
    longer = replace(made.run.controller, q_cmd_rad=1.05 * made.run.controller.q_cmd_rad)
    other = replace(made, run=replace(made.run, controller=longer))
    assert retimed(other) is other
    assert retimed(pair()).inputs is INPUTS


@pytest.mark.parametrize("most_s", [1e-3, 0.02])
def test_small_delays_here_and_there_come_off_to_fractions_of_them(most_s):
    def when(t):
        return t + most_s * np.sin(1.3 * t) ** 2

    before = run(when, PLAN_S[-1])
    found = refined(before, PATH)
    np.testing.assert_allclose(found.inputs.time_s, when(PLAN_S), atol=4e-4)
    rms = [np.sqrt(np.mean(PATH.traces([each])[0].residual ** 2)) for each in (before, found)]
    assert rms[1] < 0.3 * rms[0]


def test_what_is_late_by_more_is_no_small_delay():
    far = run(lambda t: 1.05 * t, PLAN_S[-1] * 1.05)
    assert refined(far, PATH) is far


def test_a_run_on_time_is_left_as_it_is():
    on_time = run(lambda t: t, PLAN_S[-1])
    assert refined(on_time, PATH) is on_time
    bare = pair()
    assert refined(bare, PATH) is bare
