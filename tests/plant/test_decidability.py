"""Distances: closed forms of small problems, and the plant's own effects that are, or are not, alike."""

import itertools

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from tests.plant.confounded import SAME
from tests.plant.decidability import class_of, distance_nats, of_plan
from tests.plant.distance import Block, Products, bounded
from tests.plant.instruments import Instruments
from tests.plant.kinds import plan_of
from tests.plant.scenes import CHANNELS, Scene, signals_of
from tests.plant.signatures import Library, Script, Start, columns, starts
from tests.plant.whitened import Channel, moment_of, tone_of

RNG = np.random.default_rng(7)


def problem(change, mismatch, *candidates, most=1.0):
    """Products of a change with mismatch columns within ± 1 and candidates (n, k) within ± `most`."""
    every = np.column_stack([change, mismatch, *candidates])
    at, blocks = 1 + mismatch.shape[1], []
    for i, some in enumerate(candidates):
        k = some.shape[1]
        blocks.append(Block(f"c{i}", np.arange(at, at + k), -most * np.ones(k), most * np.ones(k)))
        at += k
    m = np.arange(1, 1 + mismatch.shape[1])
    return Products(every.T @ every, Block("mismatch", m, -np.ones(len(m)), np.ones(len(m))), blocks)


@pytest.mark.parametrize(("size", "bound"), [(5.0, 2.0), (1.5, 2.0), (5.0, 0.0)])
def test_an_offset_in_white_noise_less_what_its_box_takes(size, bound):
    """n·(a - bound)²/2 in units of the noise, and nothing where the box reaches it."""
    n = 400
    one = np.ones((n, 1))
    found = problem(size * one[:, 0], bound * one + (1e-9 if bound == 0.0 else 0.0)).least()
    assert 0.5 * found.chi2 == pytest.approx(0.5 * n * max(size - bound, 0.0) ** 2, abs=1e-4)


def test_the_order_of_columns_is_no_matter():
    y, m = RNG.normal(size=300), RNG.normal(size=(300, 5))
    one, two = RNG.normal(size=(300, 2)), RNG.normal(size=(300, 3))
    first = problem(y, m, one, two)
    turned = problem(y, m[:, ::-1], two, one)
    assert first.least(*first.candidates).chi2 == pytest.approx(turned.least(*turned.candidates).chi2)


def test_bounds_hold_where_they_bind():
    """Against the rows themselves, which are what the products stand for."""
    y, a = 3.0 * RNG.normal(size=200), RNG.normal(size=(200, 6))
    a[:, 3] = a[:, 2] + 0.01 * RNG.normal(size=200)
    y = y + a @ np.array([2.0, -3.0, 0.4, 0.1, 0.0, 5.0])
    lower, upper = -np.ones(6), np.array([1.0, 1.0, 1.0, 0.5, 1.0, 2.0])
    every = np.column_stack([y, a])
    chi2, x = bounded(every.T @ every, np.arange(1, 7), lower, upper)
    rows = lsq_linear(a, y, bounds=(lower, upper), method="bvls")
    assert chi2 == pytest.approx(2.0 * rows.cost, rel=1e-6)
    assert np.all(x >= lower - 1e-9)
    assert np.all(x <= upper + 1e-9)


def test_pairs_are_the_best_of_all_pairs():
    """On a small problem every pair is tried within its bounds."""
    n, count = 200, 7
    candidates = [RNG.normal(size=(n, 1)) for _ in range(count)]
    y = 0.8 * candidates[2][:, 0] - 0.6 * candidates[5][:, 0] + 0.5 * RNG.normal(size=n)
    found = problem(y, RNG.normal(size=(n, 2)), *candidates)
    by_hand = min(found.least(a, b).chi2 for a, b in itertools.combinations(found.candidates, 2))
    pairs = found.pairs(found.singles())
    assert pairs[0].chi2 == pytest.approx(by_hand)
    assert {b.label for b in pairs[0].blocks} == {"c2", "c5"}


def test_what_another_does_as_well_is_at_no_distance():
    y = RNG.normal(size=(300, 1))
    found = problem(0.5 * y[:, 0], RNG.normal(size=(300, 3)), y, RNG.normal(size=(300, 1)))
    assert found.singles()[0].blocks[0].label == "c0"
    assert found.singles()[0].chi2 < 1e-6


def test_a_model_error_is_taken_off_the_distance():
    assert distance_nats(400.0, 400.0, 0.0) == pytest.approx(200.0)
    assert distance_nats(400.0, 400.0, 0.1) == pytest.approx(0.5 * 18.0**2)
    assert distance_nats(1.0, 400.0, 0.1) == 0.0
    assert [class_of(d) for d in (2.9, 3.0, 9.9, 10.0)] == ["undecidable", "open", "open", "decidable"]


@pytest.mark.parametrize("memory", [0.0, 0.7])
def test_noise_with_a_memory_is_whitened_to_one(memory):
    channel, n = Channel("tcp", 0.004, 0.02, memory, (0,)), 20000
    noise = np.zeros(n)
    fresh = RNG.normal(size=n)
    for i in range(1, n):
        noise[i] = memory * noise[i - 1] + np.sqrt(1.0 - memory**2) * fresh[i]
    white = channel.whitened(0.02 * noise[:, None])[:, 0]
    assert white.std() == pytest.approx(1.0, abs=0.03)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.03


def test_twice_the_noise_is_a_quarter_of_the_distance():
    values = RNG.normal(size=(500, 1))
    one, two = (Channel("tcp", 0.01, s, 0.5, (0,)).whitened(values) for s in (0.02, 0.04))
    assert np.sum(one**2) == pytest.approx(4.0 * np.sum(two**2))


def test_a_moment_and_a_tone_are_found_in_noise():
    t, way = np.arange(0.0, 15.0, 0.004), [Channel("tcp", 0.004, 1.0, 0.0, (0, 1))]
    noise = {(r, "tcp", k): RNG.normal(size=len(t)) for r in (0, 1) for k in (0, 1)}
    step = {k: v + 0.8 * ((t > 7.3) if k[0] == 1 else 0.0) for k, v in noise.items()}
    run, at_s = moment_of(step, way, "step")
    assert (run, at_s) == (1, pytest.approx(7.3, abs=0.1))
    hit = {k: v + 5.0 * ((np.abs(t - 4.2) < 0.01) if k == (0, "tcp", 1) else 0.0) for k, v in noise.items()}
    run, at_s = moment_of(hit, way, "impulse")
    assert (run, at_s) == (0, pytest.approx(4.2, abs=0.03))
    wave = {k: v + 0.5 * np.sin(2.0 * np.pi * 11.3 * t) for k, v in noise.items()}
    assert tone_of(wave, way, 3.0, 25.0) == pytest.approx(11.3, abs=0.05)


# the plant's effects ----------------------------------------------------------------------------------------


def test_a_script_answers_a_builder_in_place_of_chance():
    from tests.plant.effects import LIBRARY

    script = Script({0: (0.0, 0.0, 2.0)})
    values, _ = LIBRARY["thermal"].same(script)[1](0.5)
    assert script.asked == [("direction",), ("share",)]
    assert values["direction"] == [0.0, 0.0, 2.0]
    assert values["time_constant_h"] == pytest.approx(np.sqrt(0.5 * 3.0))
    assert {s.target for s in starts("servo_lag")} == {"A1", "A2", "A3", "A4", "A5", "A6", "all"}
    assert all(isinstance(s, Start) and columns(s) for s in starts("vibration"))


@pytest.fixture(scope="module")
def air() -> Scene:
    return Scene("air")


@pytest.mark.parametrize("name", ["servo_lag", "backlash", "stiffness", "thermal", "clock", "gravity"])
def test_a_scene_goes_on_as_a_whole_run_does(air, name):
    from tests.plant import instruments, robot
    from tests.plant.effects import LIBRARY, Draw
    from tests.plant.scene import World
    from tests.plant.scenes import READ
    from tests.plant.waypoints import PROGRAMS

    kind = LIBRARY[name]
    hooks = kind.same(Draw(3))[1](np.sqrt(kind.sizes[0] * kind.sizes[1]))[1]
    whole = robot.simulate(PROGRAMS["air"]().waypoints(), World(), [hooks], age_s=3600.0, number=1)
    whole = signals_of(instruments.clean(whole, READ))
    change = air.change(hooks, 3600.0, 1)
    for channel in CHANNELS:
        n = min(air.rows, len(whole[channel]))
        plain = whole[channel][:n] - air.signals[channel][:n]
        np.testing.assert_allclose(
            change[channel][:n], plain, atol=1e-3 * max(np.abs(plain).max(), 1e-9) + 1e-6
        )


NAMES = ("base_frame", "mastering", "tool_frame", "servo_lag", "dead_time", "clock")
"""A small library, so that signatures take seconds."""


@pytest.fixture(scope="module")
def small() -> Library:
    return Library(names=NAMES)


def decided(effect: str, library: Library, **how):
    from dataclasses import replace

    plan, _ = plan_of("single", 8, effect, "same")
    plan = replace(plan, how=replace(Instruments(q_load=False, tracker_mm=0.01), **how), days=plan.days[:2])
    size = plan.sizes([plan.drive(day, []) for day in plan.days])
    return of_plan(plan, size, library)[0]


def test_mastering_of_a1_cannot_be_told_from_the_base(small):
    assert ("base_frame", None) in SAME["mastering", "A1"]
    d = decided("mastering@A1", small)
    assert d.mismatch > 10.0
    assert d.one < 1e-2 * d.mismatch
    assert d.best_one == "base_frame"
    assert d.name == "undecidable"


def test_a_common_lag_is_told_from_clocks_and_single_lags(small):
    d = decided("servo_lag@all", small)
    assert d.name == "decidable"
    assert 10.0 < d.two <= d.one <= d.mismatch


def test_without_the_controller_a_common_lag_is_a_clock(small):
    """The tracker alone sees the tip late, by so much and no more."""
    d = decided("servo_lag@all", small, tables=("tracker",))
    assert d.mismatch > 10.0
    assert d.one < 0.05 * d.mismatch
    assert d.best_one in ("dead_time@all", "clock@tracker")


def test_what_only_the_part_shows_has_no_distance(small):
    plan, _ = plan_of("single", 8, "fixture_compliance", "same")
    assert of_plan(plan, [1.0], small) == [None]
