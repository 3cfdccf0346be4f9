"""Steps, springs, readings and surroundings against their closed forms."""

import numpy as np
import pytest

from tests.plant import masses, surface
from tests.plant.effects import LIBRARY, readings, steps, surroundings
from tests.plant.robot import SLOW, Run, fast, joint_torques, to_root
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


def test_a_fixture_gives_way_and_only_the_part_shows_it(plain):
    """The force on the part is the reaction of that on the tool; the cut is as far off the other way."""
    for build in (LIBRARY["fixture_compliance"].same, *LIBRARY["fixture_compliance"].others):
        _, hooks = form(build, 2.0)
        np.testing.assert_array_equal(driven(hooks).tip_mm, plain.tip_mm)
    values, run = only("fixture_compliance", 2.0)
    expected = plain.force_N * np.array(values["mm_per_kN"]) / 1000.0
    np.testing.assert_allclose(run.part_mm, -expected, atol=1e-12)
    with_it, without = (surface.surface(each, np.random.default_rng(3)) for each in (run, plain))
    np.testing.assert_array_equal(with_it.rows, without.rows)
    assert len(without.rows) > 100
    np.testing.assert_allclose(
        with_it.points_mm - without.points_mm, expected[without.rows], atol=1e-9
    )  # the tool's force pushes tool and part apart, as a soft shank would bend
    assert max(values["mm_per_kN"]) <= 2.0


def test_a_scan_is_judged_along_the_normals(plain):
    """A larger mill leaves floors where they were and walls further out by half of the difference."""
    _, hooks = form(LIBRARY["tool_diameter"].same, 0.2)
    run = driven(hooks)
    sign = np.sign(run.world.cutter.diameter_mm - plain.world.cutter.diameter_mm)
    change, both = surface.change_mm(run, plain), surface.surface(plain, np.random.default_rng(0))
    off = np.where(np.abs(change) > 0.05, -0.1 * sign, 0.0)
    np.testing.assert_allclose(change, off, atol=5e-3)  # the arm bends a little otherwise
    assert np.count_nonzero(off) == pytest.approx(np.count_nonzero(both.sides), abs=4)
    assert 0.9 * len(both.rows) < len(change) <= len(both.rows)


def test_a_pedestal_tilts_about_its_foot(plain):
    """Work of unit loads: the way along a force is the compliance times the square of its moment."""
    size = 0.5
    _, hooks = form(LIBRARY["pedestal_compliance"].same, size)

    def without_cut(run: Run) -> None:
        kept = run.force_N, run.moment_Nmm
        run.force_N, run.moment_Nmm = 0.0 * run.force_N, 0.0 * run.moment_Nmm
        hooks["tip"](run)
        run.force_N, run.moment_Nmm = kept

    run, still = driven(hooks), driven({"tip": without_cut})
    k = int(np.argmax(np.linalg.norm(plain.force_N, axis=1)))
    force, soft = plain.force_N[k], size / 1e9
    moment = np.cross(to_root(WORLD, plain.tip_mm)[SLOW * k], force)
    work = np.dot(soft * (moment + plain.moment_Nmm[k]), moment)
    assert np.dot((run.tip_mm - still.tip_mm)[SLOW * k], force) == pytest.approx(work, rel=1e-6)


STANDS = -20  # a slow sample after the last move


def test_a_foot_carries_the_arm_and_the_load(plain):
    """The moment about the foot of an arm that stands is that of its masses' weights by hand."""
    place, pull = (each[STANDS] for each in masses.pulls(plain))
    np.testing.assert_allclose(pull[:, 2], -9.80665 * np.append(masses.LINK_kg, masses.LOAD_kg), rtol=1e-6)
    lift = -plain.q_act[SLOW * STANDS, 1]  # the upper arm's slope
    swing = -plain.q_act[SLOW * STANDS, 0]
    out, up = 350.0 + 575.0 * np.cos(lift), 675.0 + 575.0 * np.sin(lift)
    np.testing.assert_allclose(place[1], [out * np.cos(swing), out * np.sin(swing), up], atol=1e-9)
    moment = masses.moment_about(plain, np.zeros(3))[STANDS]
    np.testing.assert_allclose(moment[1], np.sum(place[:, 0] * -pull[:, 2]), rtol=1e-6)


def test_joint_moments_are_the_work_of_the_weights(plain):
    """Virtual work: a joint's moment is the weights' work for a small turn, by differences."""
    body, q = plain.body(), np.ascontiguousarray(plain.q_act[::SLOW][STANDS : STANDS + 1])
    kg, step = np.append(masses.LINK_kg, masses.LOAD_kg), 1e-6
    centres = masses.reference_centres(plain, body)
    for j in range(6):
        turned = q.copy()
        turned[0, j] += step
        lift = masses.carried(body, turned, centres)[0, :, 2] - masses.carried(body, q, centres)[0, :, 2]
        expected = -9.80665 * float(kg @ lift) / step
        assert masses.joint_moments(plain)[STANDS, j] == pytest.approx(expected, rel=1e-4, abs=5.0)


# readings ---------------------------------------------------------------------------------------------------


def test_twist_is_read_and_moves_nothing(plain):
    _, run = only("gear_twist", 0.4, "A2")
    torque_kNm = joint_torques(plain)[::1, 1] / 1e6
    read = (run.q_load - plain.q_load)[::SLOW, 1] / DEGREE
    carried_kNm = masses.joint_moments(plain)[:, 1] / 1e6
    np.testing.assert_allclose(read, 0.4 * (torque_kNm + carried_kNm), atol=1e-12)
    assert carried_kNm.min() > 1.0  # an arm of this size weighs kN·m about A2
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


def test_an_eccentric_wheel_errs_once_a_turn(plain):
    values, run = only("joint_eccentricity", 0.1, "A1")
    q, phase = plain.q_act[:, 0], values["phase"]
    np.testing.assert_allclose(
        (run.q_load - plain.q_load)[:, 0] / DEGREE, 0.1 * np.sin(q + phase), atol=1e-12
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


def test_a_beam_bends_with_the_square_of_its_level_length(plain):
    values, run = only("tracker_refraction", 0.1)
    length = np.linalg.norm((plain.tip_mm - values["stand_mm"])[:, :2], axis=1)
    moved = run.tip_mm - plain.tip_mm
    np.testing.assert_allclose(moved[:, 2], 0.1 * (length / 2000.0) ** 2, atol=1e-9)


def test_a_cable_pulls_nothing_at_the_start_and_with_the_travel(plain):
    values, run = only("cable_pull", 3.0, "A1")
    assert np.abs(run.tip_mm - plain.tip_mm).max() > 0.0
    travel = (plain.q_load[::SLOW, 0] - plain.q_load[0, 0]) / DEGREE
    expected = 3.0 * travel[:, None] * np.array(values["direction"])
    np.testing.assert_allclose(run.sensed_N - plain.sensed_N, expected, atol=1e-3)  # the flange bends too
    own = driven(form(surroundings.cable_pull_of_the_sensor, 3.0, 1, "A1")[1])
    np.testing.assert_allclose(own.sensed_N - plain.sensed_N, expected, atol=1e-9)
    np.testing.assert_array_equal(own.tip_mm, plain.tip_mm)
    assert np.abs(expected[0]).max() == 0.0
    drum = driven(form(surroundings.cable_pull_at_the_tool, 3.0, 1, "A1")[1])
    np.testing.assert_allclose(drum.force_N - plain.force_N, expected, atol=1e-9)
    assert np.abs(drum.tip_mm - plain.tip_mm).max() > 0.0
    loop = driven(form(surroundings.cable_pull_that_rubs, 3.0, 1, "A1")[1]).force_N - plain.force_N
    along = loop @ np.array(values["direction"])
    up = (np.gradient(travel) > 1e-4) & (np.abs(travel - np.median(travel)) < 0.3)
    down = (np.gradient(travel) < -1e-4) & (np.abs(travel - np.median(travel)) < 0.3)
    assert np.abs(along[up].mean() - along[down].mean()) > 0.5  # there and back differ
