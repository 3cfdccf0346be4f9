"""Drives, filters, tones and moments, and the unknown effects beside them, against what they say they do."""

import numpy as np
import pytest

from tests.plant import memory
from tests.plant.effects import LIBRARY, UNKNOWN
from tests.plant.effects.open import brake_after_stop, oil_film, vacuum_lifts
from tests.plant.robot import SLOW, Run, STEP_s
from tests.plant.scene import DEGREE, World
from tests.plant.short import driven, form, only
from tests.plant.signatures import Script

WHOLE = "slots"
"""A program that cuts in two layers and lasts long enough for what comes late."""


@pytest.fixture(scope="module")
def plain() -> Run:
    return driven({})


@pytest.fixture(scope="module")
def whole() -> Run:
    return driven({}, program=WHOLE)


def acting(name: str, size: float, target: str | None = None, number: int = 0) -> tuple[dict, Run]:
    """One effect in its own form on the whole program."""
    shelf = UNKNOWN if name in UNKNOWN else LIBRARY
    values, hooks = form(shelf[name].same, size, 1, target)
    return values, driven(hooks, number, WHOLE)


# the library ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["servo_lag", "dead_time", "servo_gain", "backlash"])
def test_all_axes_err_as_each_alone_does(name):
    size, build = float(np.sqrt(np.prod(LIBRARY[name].sizes))), LIBRARY[name].same
    together = driven(build(Script({}, "all"))[1](size)[1])
    seen = "q_load" if name == "backlash" else "q_act"
    for j in range(6):
        alone = driven(build(Script({}, f"A{j + 1}"))[1](size)[1])
        np.testing.assert_array_equal(getattr(together, seen)[:, j], getattr(alone, seen)[:, j])


def test_a_current_limit_clips_the_acceleration_and_catches_up():
    _, run = only("current_limit", 0.5, "A1")
    push = [np.abs(np.diff(q[:, 0], 2)).max() / STEP_s**2 for q in (run.q_cmd, run.q_act)]
    assert push[1] == pytest.approx(0.5 * push[0], rel=1e-6)
    off = np.abs(run.q_act - run.q_cmd)[:, 0]
    assert off[-50:].max() < 0.02 * off.max()  # in the rest after the last move


def test_a_drive_that_may_push_as_hard_as_it_must_follows_exactly():
    x = np.cumsum(np.cumsum(np.random.default_rng(1).normal(size=500))) * 1e-6
    np.testing.assert_allclose(memory.limited(x, 1e9, 10.0, STEP_s), x, atol=1e-12)


def test_a_collision_pushes_once_and_leaves_a_slip(whole):
    values, run = acting("collision", 1100.0, "A2")
    own = int(values["run"][4:]) - 1
    _, run = acting("collision", 1100.0, "A2", own)
    more = np.linalg.norm(run.force_N - whole.force_N, axis=1)
    assert 0.9 * 1100.0 < more.max() <= 1100.0
    at_s = run.slow_s[more > 1e-6]
    assert values["at_s"] <= at_s[0]
    assert at_s[-1] <= values["at_s"] + values["lasts_s"]
    assert 0.010 <= values["lasts_s"] <= 0.030
    assert values["moments"][0]["t_s"] == pytest.approx(values["at_s"] + 0.5 * values["lasts_s"])
    slip = (run.q_load - whole.q_load)[:, 1] / DEGREE
    assert abs(slip[0]) == 0.0
    assert slip[-1] == pytest.approx(values["slip_deg"])
    assert abs(values["slip_deg"]) == pytest.approx(0.0225 * 1.1)
    _, later = acting("collision", 1100.0, "A2", own + 1)
    np.testing.assert_array_equal(later.force_N, whole.force_N)
    assert (later.q_load - whole.q_load)[0, 1] / DEGREE == pytest.approx(values["slip_deg"])


def test_a_reading_in_steps_is_a_ladder_and_one_that_hangs_is_a_play(plain):
    _, run = only("force_steps", 20.0)
    np.testing.assert_allclose(run.sensed_N / 20.0, np.round(run.sensed_N / 20.0), atol=1e-9)
    assert np.abs(run.sensed_N - plain.sensed_N).max() <= 10.0 + 1e-9
    values, hooks = form(LIBRARY["force_hysteresis"].others[0], 0.05)
    off = np.abs(driven(hooks).sensed_N - plain.sensed_N).max()
    assert off == pytest.approx(values["half_N"]) == pytest.approx(7.5)
    values, run = only("force_hysteresis", 0.05)
    lacks = plain.sensed_N - run.sensed_N
    full = np.abs(plain.sensed_N).max(axis=0)
    np.testing.assert_allclose(np.abs(lacks).max(axis=0), 0.025 * full, rtol=1e-6)  # half of the loop's width


# of no library ----------------------------------------------------------------------------------------------


def test_a_worn_collet_holds_what_it_has_given(plain):
    values, run = only("open:collet_tilts", 0.05)
    moved = (run.tip_mm - plain.tip_mm)[::SLOW]
    press = np.linalg.norm(plain.force_N[:, :2], axis=1)
    free = (press < 1e-9) & (run.slow_s > run.slow_s[press > values["grip_N"]][0])
    assert np.abs(moved[press == 0.0][:10]).max() == 0.0  # nothing before the first cut
    assert np.linalg.norm(moved[free], axis=1).max() > 0.005  # and something after it, without a load
    assert np.linalg.norm(moved, axis=1).max() <= 0.05 * np.sqrt(2.0)
    assert np.abs(moved[:, 2]).max() == 0.0


def test_a_carrier_drags_against_the_motion(plain):
    values, run = only("open:carrier_drags", 20.0)
    drag, speed = (run.force_N - plain.force_N)[:, 1], run.rates(run.q_load[:, 0])[::SLOW]
    moving = np.abs(speed) > 0.02
    assert np.all(np.sign(drag[moving]) == np.sign(speed[moving]))
    far = ((run.q_load[::SLOW, 0] / DEGREE - values["middle_deg"]) / 3.0) ** 2
    np.testing.assert_allclose(np.abs(drag[moving]), 20.0 * far[moving], rtol=1e-3, atol=1e-6)


def test_a_brake_drags_after_a_rest_and_lets_go():
    speed = np.concatenate([np.full(500, 0.1), np.zeros(100), np.full(500, 0.1), np.zeros(20), np.ones(100)])
    since = brake_after_stop.since_rest(speed, 0.05)
    assert since[:500].min() > 1e6
    assert since[599] == 0.0
    assert since[1099] == pytest.approx(0.5, abs=0.002)
    assert since[1119] > 0.5  # twenty milliseconds are no rest


def test_a_belt_of_an_encoder_slips_at_hard_accelerations_alone(plain):
    values, run = only("open:belt_slips", 0.05, "A1")
    rate = np.abs(np.diff(run.q_load[:, 0] - plain.q_load[:, 0]))
    push = np.abs(run.rates(run.rates(run.q_cmd))[1:, 0])
    soft = push < 0.9 * values["holds"] * push.max()
    assert rate[soft].max() < 1e-12
    assert rate.sum() > 0.0


def test_the_sun_bows_the_arm_sideways_to_its_own_line():
    _, run = only("open:sunny_side", 0.2)
    moved = run.tip_mm - driven({}).tip_mm
    forward = np.stack([np.cos(run.q_load[:, 0]), -np.sin(run.q_load[:, 0])], axis=1)
    assert np.abs(np.sum(moved[:, :2] * forward, axis=1)).max() < 1e-9
    assert np.linalg.norm(moved[:, :2], axis=1).max() <= 0.2 + 1e-9


def test_held_set_points_stop_all_joints_together(plain):
    _, run = only("open:held_set_points", 0.05)
    off, speed = run.q_act - plain.q_act, run.rates(run.q_cmd)
    behind = np.divide(-off, speed, out=np.zeros_like(off), where=np.abs(speed) > 1e-4)
    moving = np.all(np.abs(speed[:, :3]) > 1e-3, axis=1)
    np.testing.assert_allclose(behind[moving, 0], behind[moving, 1], atol=1e-9)
    assert 0.0 < behind[moving].max() <= 0.05


def test_a_beam_that_comes_back_keeps_its_offset_till_the_next_loss(whole):
    _, run = acting("beam_comes_back", 0.1)
    moved = np.linalg.norm(run.tip_mm - whole.tip_mm, axis=1)
    jumps = np.flatnonzero(np.abs(np.diff(moved)) > 1e-6)
    assert 1 <= len(jumps) <= 12
    assert moved[: jumps[0]].max() < 1e-12


def test_a_film_builds_up_faster_than_it_goes():
    speed = np.concatenate([np.zeros(200), np.full(1000, 0.1), np.zeros(1000)])
    thick = oil_film.film(speed, 0.1, 0.1, 2.0)
    assert thick[199] == 0.0
    assert thick[1199] > 0.99
    assert thick[2199] == pytest.approx(np.exp(-0.5), rel=0.02)


def test_a_preload_jumps_at_the_same_time_after_each_start(whole):
    at = []
    for number in (0, 2):
        _, run = acting("preload_jump", 0.02, number=number)
        moved = (run.tip_mm - whole.tip_mm)[:, 2]
        assert set(np.round(moved, 9)) == {0.0, np.round(moved[-1], 9)}
        assert abs(moved[-1]) == pytest.approx(0.02, rel=1e-3)
        at.append(run.t_s[np.flatnonzero(moved)[0]])
    assert at[0] == at[1]


def test_a_part_lifts_at_once_and_comes_down_slowly():
    press = np.concatenate([np.zeros(50), np.full(50, 180.0), np.zeros(100)])
    lift = vacuum_lifts.lifted(press, 100.0, 0.4)
    assert lift[49] == 0.0
    assert lift[50] == pytest.approx(0.8)
    assert lift[199] == pytest.approx(0.8 * np.exp(-1.0), rel=0.02)


def test_a_base_rocks_about_a_diagonal_between_two_feet(whole):
    values, run = acting("base_rocks", 0.3)
    moved = run.tip_mm - whole.tip_mm
    line = np.array([1.0, values["side"], 0.0]) / np.sqrt(2.0)
    assert np.abs(moved @ line).max() < 1e-9  # a turn about the line moves nothing along it
    reach = np.linalg.norm(np.cross(line, run.place_mm + World().base.origin_mm), axis=1).max()
    assert np.linalg.norm(moved, axis=1).max() <= 0.3 / 1500.0 * (reach + 5.0)


def test_an_edge_builds_up_with_the_metres_and_breaks_away(plain):
    values, run = only("open:edge_builds_up", 0.5)
    press = np.linalg.norm(plain.force_N, axis=1)
    share = np.linalg.norm(run.force_N, axis=1)[press > 30.0] / press[press > 30.0] - 1.0
    metres = plain.metres_cut[press > 30.0]
    rising = np.diff(share) >= -1e-12
    np.testing.assert_allclose(np.diff(share)[rising], 0.5 / values["cycle_m"] * np.diff(metres)[rising])
    assert share.min() >= 0.0
    assert share.max() <= 0.5


def test_a_chipped_tooth_kicks_at_its_angle(whole):
    values, run = acting("tooth_chipped", 0.02, "A1")
    kick = np.abs(run.q_load - whole.q_load)[:, 0] / DEGREE
    at = run.q_act[int(np.argmax(kick)), 0] / DEGREE
    assert at == pytest.approx(values["at_deg"], abs=0.05)
    assert kick.max() == pytest.approx(0.02, rel=0.01)
    far = np.abs(run.q_act[:, 0] / DEGREE - values["at_deg"]) > 5.0 * 120.0 / values["teeth"]
    assert far.any()
    assert kick[far].max() < 1e-3 * 0.02


def test_a_supply_that_sags_makes_all_joints_late_at_high_power(plain):
    _, run = only("open:supply_sags", 0.02)
    extra = run.lag_s - plain.lag_s
    assert np.abs(extra - extra[:, :1]).max() == 0.0
    assert 0.0 < extra.max() <= 0.02
    assert extra[:5].max() < 1e-3 * extra.max()


def test_a_loose_nest_stays_where_the_last_jolt_left_it(plain):
    values, run = only("open:nest_rattles", 0.1)
    moved = run.tip_mm - plain.tip_mm
    jolt = np.abs(run.rates(run.rates(run.place_mm)))
    assert np.abs(moved).max() <= 0.05
    moved = moved - moved[0]
    first = int(np.argmax(jolt.max(axis=1) > values["holds_mm_s2"]))
    assert np.abs(moved[: max(first - 30, 1)]).max() < 1e-9
    assert np.abs(moved[-100:]).max() > 0.005


def test_a_cable_pulls_until_it_jerks_free(whole):
    values, _ = acting("cable_jerks_free", 60.0)
    own = int(values["moments"][0]["run"][4:]) - 1
    _, run = acting("cable_jerks_free", 60.0, number=own)
    pull, at_s = np.linalg.norm(run.force_N - whole.force_N, axis=1), values["moments"][0]["t_s"]
    pulled = run.slow_s[pull > 0.0]
    assert pulled[0] >= at_s - values["lasts_s"]
    assert pulled[-1] < at_s
    assert pull.max() == pytest.approx(60.0, rel=0.02)
    _, other = acting("cable_jerks_free", 60.0, number=own + 1)
    np.testing.assert_array_equal(other.force_N, whole.force_N)
