"""Steps, springs, readings and surroundings against their closed forms."""

import numpy as np
import pytest

from tests.plant import arm
from tests.plant.effects import LIBRARY, readings, steps, structure, surroundings
from tests.plant.robot import SLOW, Run, fast, joint_torques, joints_for, to_root
from tests.plant.scene import DEGREE, GEAR_RATIO
from tests.plant.short import WORLD, driven, form, only


@pytest.fixture(scope="module")
def plain() -> Run:
    return driven({})


# steps ------------------------------------------------------------------------------------------------------


def stepped(build, target: str, number: int) -> tuple[dict, Run]:
    values, hooks = form(build, 0.3, 3, target)
    return values, driven(hooks, number)


def test_a_tip_steps_in_its_run_and_stays_in_later_ones(plain):
    values, _ = stepped(LIBRARY["step"].same, "tip", 0)
    own = int(values["run"][4:]) - 1
    way = values["size"] * np.array(values["direction"])
    for number in range(own + 3):
        _, run = stepped(LIBRARY["step"].same, "tip", number)
        moved = run.tip_mm - plain.tip_mm
        if number < own:
            assert np.abs(moved).max() == 0.0
        elif number > own:
            np.testing.assert_allclose(moved, np.broadcast_to(way, moved.shape), atol=1e-12)
        else:
            before, after = run.t_s < values["at_s"], run.t_s > values["at_s"] + values["takes_s"]
            assert np.abs(moved[before]).max() == 0.0
            np.testing.assert_allclose(moved[after], np.broadcast_to(way, moved[after].shape), atol=1e-12)
            assert before.any()
            assert after.any()
    assert 0.02 <= values["takes_s"] <= 0.06
    assert np.linalg.norm(values["direction"]) == pytest.approx(1.0)


def test_a_belt_jumps_on_the_load_side_of_one_joint(plain):
    values, run = stepped(LIBRARY["step"].same, "A2", 2)
    turned = values["size"] * values["direction"] * DEGREE
    np.testing.assert_allclose((run.q_load - plain.q_load)[:, 1], turned, atol=1e-12)
    np.testing.assert_array_equal(run.q_act, plain.q_act)
    lever = np.linalg.norm(run.tip_mm - plain.tip_mm, axis=1).mean() / abs(turned)
    axis_mm = np.array([350.0, 675.0])  # of A2, x and z in the root
    reach = np.linalg.norm(to_root(WORLD, plain.place_mm)[:, [0, 2]] - axis_mm, axis=1).mean()
    assert lever == pytest.approx(reach, rel=0.01)


def test_other_steps_end_where_the_step_ends():
    t = np.arange(0.0, 40.0, 0.001)
    for build in LIBRARY["step"].others:
        _, run = stepped(build, "tip", 2)
        _, plain_step = stepped(LIBRARY["step"].same, "tip", 2)
        assert np.linalg.norm(run.tip_mm - plain_step.tip_mm, axis=1).max() < 1e-12
    tail = steps.ramp(t, 5.0, 0.04) * (1.0 - 0.4 * np.exp(-np.maximum(t - 5.0, 0.0) / 2.0))
    assert tail[t < 5.0].max() == 0.0
    assert tail[5041] == pytest.approx(1.0 - 0.4 * np.exp(-0.041 / 2.0))
    assert tail[-1] == pytest.approx(1.0, abs=1e-6)


# springs ----------------------------------------------------------------------------------------------------


def test_a_shank_bends_as_a_cantilever(plain):
    values, run = only("cutter_bending", 0.5)
    across = plain.force_N * [1.0, 1.0, 0.0]  # the tool is upright, the base not turned
    np.testing.assert_allclose(run.tip_mm - plain.tip_mm, fast(run, across * 0.5 / 1000.0), atol=1e-9)
    second_moment = 0.7 * np.pi * 16.0**4 / 64.0
    give = values["length_mm"] ** 3 / (3.0 * 600e3 * second_moment)
    assert give == pytest.approx(0.5 / 1000.0)


def test_a_fixture_gives_way_along_its_axes(plain):
    values, run = only("fixture_compliance", 2.0)
    expected = plain.force_N * np.array(values["mm_per_kN"]) / 1000.0
    np.testing.assert_allclose(run.tip_mm - plain.tip_mm, fast(run, expected), atol=1e-9)
    assert max(values["mm_per_kN"]) <= 2.0


def test_a_pedestal_tilts_about_its_foot(plain):
    """Work of unit loads: the way along a force is the compliance times the square of its moment."""
    size = 0.05
    values, run = only("pedestal_compliance", size)
    k = int(np.argmax(np.linalg.norm(plain.force_N, axis=1)))
    force, soft = plain.force_N[k], np.array(values["deg_per_kNm"]) * DEGREE / 1e6
    lever = to_root(WORLD, plain.tip_mm)[SLOW * k] - structure.FOOT_mm
    moment = np.cross(lever, force)
    own = plain.moment_Nmm[k]
    work = np.dot(soft * (moment + own), moment)
    assert np.dot((run.tip_mm - plain.tip_mm)[SLOW * k], force) == pytest.approx(work, rel=1e-6)


def test_a_crooked_elbow_turns_the_forearm_and_nothing_before_it():
    body = arm.reference_pose(WORLD)
    tilt = 0.3 * DEGREE
    c, s = np.cos(tilt), np.sin(tilt)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    bent = arm.crooked(body, arm.ELBOW, turn)
    np.testing.assert_array_equal(bent.screws[:2], body.screws[:2])
    np.testing.assert_allclose(bent.screws[2], turn @ body.screws[2])
    assert np.degrees(np.arccos(bent.screws[1] @ bent.screws[2])) == pytest.approx(0.3)
    q = joints_for(WORLD, np.array([[50.0, 20.0, 10.0]]))
    # the same by hand: link 2 carries a turned frame in which A3 ... A6 move as ever
    rest = q.copy()
    rest[:, :2] = 0.0
    front = q.copy()
    front[:, 2:] = 0.0
    elbow = body.points_mm[2]
    inner = arm.pose(body, rest)[0][0]
    there = turn @ (inner - elbow) + elbow
    place, axes = arm.pose(body, front)
    along = axes[0] @ body.tcp_axes.T  # motion of link 2 from its reference pose
    expected = place[0] + along @ (there - body.tcp_mm)
    np.testing.assert_allclose(arm.pose(bent, q)[0][0], expected, atol=1e-9)


def test_axes_that_are_parallel_after_all_change_nothing(plain):
    for build in (LIBRARY["axis_parallelism"].same, *LIBRARY["axis_parallelism"].others):
        run = driven(form(build, 1e-12)[1])
        assert np.abs(run.tip_mm - plain.tip_mm).max() < 1e-8


# readings ---------------------------------------------------------------------------------------------------


def test_twist_is_read_and_moves_nothing(plain):
    _, run = only("gear_twist", 0.4, "A2")
    torque_kNm = joint_torques(plain)[::1, 1] / 1e6
    read = (run.q_load - plain.q_load)[::SLOW, 1] / DEGREE
    np.testing.assert_allclose(read, 0.4 * torque_kNm, atol=1e-12)
    np.testing.assert_array_equal(run.tip_mm, plain.tip_mm)


def test_a_cubic_spring_is_the_root_of_its_law():
    torque = np.linspace(-900.0, 900.0, 181)
    x = readings.stiffening(torque, 150.0)
    np.testing.assert_allclose(x + x**3 / 150.0**2, torque, atol=1e-8)
    assert np.abs(x).max() < 0.6 * 900.0


def test_interpolation_errs_once_a_line(plain):
    values, run = only("encoder_interpolation", 0.002, "A3")
    wave = 0.002 * np.sin(values["lines"] * GEAR_RATIO[2] * plain.q_act[:, 2] + values["phase"])
    np.testing.assert_allclose((run.q_act - plain.q_act)[:, 2] / DEGREE, wave, atol=1e-12)
    np.testing.assert_array_equal(run.tip_mm, plain.tip_mm)


def test_an_eccentric_wheel_errs_once_a_turn_and_not_at_its_mark(plain):
    values, run = only("joint_eccentricity", 0.1, "A1")
    q, phase = plain.q_act[:, 0], values["phase"]
    np.testing.assert_allclose(
        (run.q_load - plain.q_load)[:, 0] / DEGREE, 0.1 * (np.sin(q + phase) - np.sin(phase)), atol=1e-12
    )


# surroundings -----------------------------------------------------------------------------------------------


def test_a_spindle_grows_from_nothing_and_down(plain):
    values, run = only("spindle_growth", 0.2)
    moved = run.tip_mm - plain.tip_mm
    expected = -0.2 * -np.expm1(-run.t_s / values["time_constant_s"])
    np.testing.assert_allclose(moved[:, 2], expected, atol=1e-9)
    assert np.abs(moved[:, :2]).max() < 1e-9


def test_growth_follows_the_speed_of_the_spindle(plain):
    plain.spindle_rad_s = np.where(plain.t_s < 2.0, 0.5, 0.0) * surroundings.RATED_rad_s
    try:
        out = surroundings.grown(plain, 1.5)
    finally:
        plain.spindle_rad_s = np.full(len(plain.t_s), surroundings.RATED_rad_s)
    t = plain.t_s
    warm, end = t < 2.0, 0.25 * -np.expm1(-2.0 / 1.5)
    np.testing.assert_allclose(out[warm], 0.25 * -np.expm1(-t[warm] / 1.5), atol=1e-12)
    np.testing.assert_allclose(out[~warm], end * np.exp(-(t[~warm] - 2.0) / 1.5), atol=1e-9)


def test_a_tracker_creeps_with_the_hours(plain):
    values, run = only("tracker_drift", 0.4)
    hours = 1.0 + run.t_s / 3600.0  # the run starts an hour after the first
    expected = 0.4 * hours[:, None] * np.array(values["direction"])
    np.testing.assert_allclose(run.tip_mm - plain.tip_mm, expected, atol=1e-9)


def test_a_beam_bends_with_the_square_of_its_length(plain):
    values, run = only("tracker_refraction", 0.1)
    length = np.linalg.norm(plain.tip_mm - values["stand_mm"], axis=1)
    moved = run.tip_mm - plain.tip_mm
    np.testing.assert_allclose(moved[:, 2], 0.1 * (length / 2000.0) ** 2, atol=1e-9)


def test_a_cable_pulls_nothing_at_the_start_and_with_the_travel(plain):
    values, run = only("cable_pull", 3.0, "A1")
    travel = (plain.q_load[::SLOW, 0] - plain.q_load[0, 0]) / DEGREE
    pull = run.force_N - plain.force_N
    np.testing.assert_allclose(pull, 3.0 * travel[:, None] * np.array(values["direction"]), atol=1e-9)
    assert np.abs(pull[0]).max() == 0.0
    loop = driven(form(surroundings.cable_pull_that_rubs, 3.0, 1, "A1")[1]).force_N - plain.force_N
    along = loop @ np.array(values["direction"])
    up = (np.gradient(travel) > 1e-4) & (np.abs(travel - np.median(travel)) < 0.3)
    down = (np.gradient(travel) < -1e-4) & (np.abs(travel - np.median(travel)) < 0.3)
    assert np.abs(along[up].mean() - along[down].mean()) > 0.5  # there and back differ
