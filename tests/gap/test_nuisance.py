"""Normal mismatch as columns: against small motions of points, forces of a zero, and derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import robot
from gcode2krl.effects import Applied, library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.compare.links import CLOCK
from gcode2krl.gap.components import Signatures
from gcode2krl.gap.noise.nuisance import nuisance_of
from gcode2krl.gap.posterior.gram import MOST
from tests.gap.constructed import joint_rates, motion, trace

BOUNDS = Mismatch()
LIBRARY = library()
ROOT3 = np.sqrt(3.0)
"""Standard deviation of a uniform draw: its bound over the root of three."""


def nuisance(one, known=None, **more):
    """Return the columns (k, n, c) by name."""
    given = {"library": LIBRARY if known is None else known, "mismatch": BOUNDS, "known": Signatures()}
    found = nuisance_of(one, **given, upstream=more.pop("upstream", frozenset()), **more)
    return {each.name: each for each in found}


@pytest.fixture(scope="module")
def tip():
    return trace(np.zeros((500, 3)), "mechanics")


@pytest.fixture(scope="module")
def force():
    inputs = motion()
    t = inputs.time_s
    pushed = replace(inputs, force_base_N=np.stack([200 * np.sin(t), 90 + 0 * t, 50 * np.cos(2 * t)], axis=1))
    return trace(np.zeros((500, 3)), "force", inputs=pushed)


def test_a_frame_is_a_small_shift_and_turn_of_the_points(tip):
    columns = nuisance(tip, {})["tracker frame"].columns
    points = tip.nominal
    centre, small = points.mean(axis=0), 1e-6
    for axis in range(3):
        shifted = (points + small * np.eye(3)[axis]) - points
        np.testing.assert_allclose(columns[:, :, axis].T, shifted / small * 0.04 / ROOT3, atol=1e-6)
        turned = Rotation.from_rotvec(small * np.eye(3)[axis]).apply(points - centre) + centre - points
        np.testing.assert_allclose(columns[:, :, 3 + axis].T, turned / small * 3e-5 / ROOT3, atol=1e-6)


def test_each_run_has_a_frame_a_clock_and_a_zero_of_its_own(tip, force):
    by_name = {**nuisance(tip), **nuisance(force)}
    own = {name for name, each in by_name.items() if not each.shared}
    assert own == {"tracker frame", CLOCK, "force zero", "sensor gain"}


def test_a_force_zero_is_along_the_sensors_axes_whatever_the_frame(force):
    """In the base's frame it turns with the flange; a tool is fixed to the flange, so there it stands."""
    _, rotation = robot.forward(force.inputs.q_cmd_rad, force.inputs.cell, 1)
    flange = (
        Rotation.from_quat(rotation) * Rotation.from_matrix(force.inputs.cell.tool_matrix(1)[:3, :3]).inv()
    )
    columns = nuisance(force, {})["force zero"].columns
    for axis in range(3):
        along = flange.apply(np.eye(3)[axis])
        np.testing.assert_allclose(columns[:, :, axis].T, along * 3.0 / ROOT3, atol=1e-12)
    for frame in ("sensor", "tcp"):
        fixed = nuisance(replace(force, frame=frame), {})["force zero"].columns
        covariance = np.einsum("inc,jnc->nij", fixed, fixed)
        np.testing.assert_allclose(covariance, np.tile(3.0 * np.eye(3), (500, 1, 1)), atol=1e-12)


def test_a_sensors_gain_is_a_share_of_each_component(force):
    columns = nuisance(force, {})["sensor gain"].columns
    for i in range(3):
        for j in range(3):
            expected = force.nominal[:, i] * 0.02 / ROOT3 if i == j else 0.0 * force.nominal[:, i]
            np.testing.assert_allclose(columns[i, :, j], expected)


def test_a_clock_goes_with_the_rate():
    path = trace(np.zeros((500, 6)), "path")
    columns = nuisance(path, {}, clock=1.5)[CLOCK].columns[:, :, 0].T
    inside = slice(5, -5)
    expected = -joint_rates(path.time_s) * 2e-3 / ROOT3 * 1.5
    np.testing.assert_allclose(columns[inside], expected[inside], rtol=0.01, atol=2e-6)


def test_a_clock_of_the_tip_is_the_tip_a_moment_later(tip):
    columns = nuisance(tip, {})[CLOCK].columns[:, :, 0].T
    late = replace(tip, time_s=tip.time_s - 1e-4).nominal - tip.nominal
    np.testing.assert_allclose(columns[5:-5], late[5:-5] / 1e-4 * 2e-3 / ROOT3, rtol=0.02, atol=2e-3)


def test_the_hats_of_the_time_law_add_up_to_the_clock():
    path = trace(np.zeros((500, 6)), "path")
    found = nuisance(path, {})
    assert found["time law"].columns.shape[2] == 11  # a knot each second
    np.testing.assert_allclose(
        found["time law"].columns.sum(axis=2), found[CLOCK].columns[:, :, 0], atol=1e-15
    )


def test_an_encoders_zero_is_a_constant_of_each_joint_without_a_bound_that_matters():
    columns = nuisance(trace(np.zeros((500, 2)), "gear"), {})["encoder zero"].columns
    for i in range(2):
        for j in range(2):
            assert np.ptp(columns[i, :, j]) == 0.0
            assert (columns[i, 0, j] > np.radians(100.0)) == (i == j)


def test_play_and_lag_are_those_of_the_effects_at_the_size_of_their_bound():
    servo = trace(np.zeros((500, 6)), "servo")
    lag = nuisance(servo)["servo_lag A2"].columns[:, :, 0]
    expected = -joint_rates(servo.time_s)[:, 1] * 5e-4 / ROOT3  # to first order in a lag of half a ms
    np.testing.assert_allclose(lag[1, 5:-1], expected[5:-1], rtol=0.02, atol=1e-7)
    assert not lag[[0, 2, 3, 4, 5]].any()
    gear = nuisance(trace(np.zeros((500, 6)), "gear"))
    play = gear["backlash A3"].columns[2, :, 0]
    assert np.abs(play).max() == pytest.approx(np.radians(5e-4) / 2.0 / ROOT3, rel=1e-6)
    swing = gear["transmission A1 2"].columns[0]
    np.testing.assert_allclose(
        np.hypot(*swing.T), np.full(500, np.radians(5e-4) / ROOT3), rtol=1e-9
    )  # sine and cosine


def test_any_lag_within_its_bound_is_two_columns_to_second_order():
    servo = trace(np.zeros((500, 6)), "servo")
    found = nuisance(servo)
    columns = np.concatenate(
        [found[name].columns[1] for name in ("servo_lag A2", "servo_lag A2, bent")], axis=1
    )
    late = Applied(LIBRARY["servo_lag"], "A2", {"tau_s": 2e-4})
    change = (servo.sample([late]) - servo.nominal)[:, 1]
    weights, *_ = np.linalg.lstsq(columns, change, rcond=None)
    straight, *_ = np.linalg.lstsq(columns[:, :1], change, rcond=None)
    left, more = change - columns @ weights, change - columns[:, :1] @ straight
    assert np.linalg.norm(left) < 0.1 * np.linalg.norm(more)
    assert np.abs(weights).max() < MOST


def test_a_run_may_begin_anywhere_in_a_play():
    gear = trace(np.zeros((500, 6)), "gear")
    begun = nuisance(gear)["start of play"].columns
    assert begun[2, 0, 2] == pytest.approx(BOUNDS.play_rad / 2.0 / ROOT3)
    assert not begun[2, -1, 2]  # crossed
    assert not begun[2, :, [0, 1, 3, 4, 5]].any()


def test_the_clock_of_a_table_is_the_effect_of_that_name(force):
    assert nuisance(force)[CLOCK].block.key == ("clock", "force")
    assert nuisance(trace(np.zeros((500, 6)), "gear"))[CLOCK].block.key == ("clock", "q_load")


def test_a_cutter_within_its_tolerances_is_no_swapped_tool():
    usual = LIBRARY["swapped_tool"].usual(BOUNDS, 20.0)
    assert usual == {"diameter_mm": BOUNDS.diameter_mm, "length_mm": BOUNDS.length_mm}


def test_links_that_are_not_measured_bring_their_mismatch_along(tip):
    names = set(nuisance(tip))
    upstream = set(nuisance(tip, upstream=frozenset({"servo", "gear", "path"}))) - names
    assert {name.split()[0] for name in upstream} == {"servo_lag", "backlash", "transmission", "time"}
