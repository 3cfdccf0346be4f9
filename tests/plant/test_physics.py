"""The plant's physics against closed forms, published vectors and brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.plant import arm, chips, memory, path, pixels
from tests.plant.robot import Run, cut_at, joints_for, simulate
from tests.plant.scene import DEGREE, Frame, World, euler
from tests.plant.waypoints import PROGRAMS

WORLD = World()


@pytest.fixture(scope="module")
def plain() -> dict[str, Run]:
    """Every program without effects and mismatch."""
    return {name: simulate(p().waypoints(), WORLD, []) for name, p in PROGRAMS.items()}


# where the arm is and how it gives way ----------------------------------------------------------------------

VECTORS = """
0 -90 90 0 0 0 | 750 0 0 | 0 0 0 | 1840 0 1534 | 1.0299595 0 0.5539167
0 -90 90 0 0 0 | 0 750 0 | 0 0 0 | 1840 0 1534 | -0.0017850 2.3703725 0.0011737
0 -90 90 0 0 0 | 0 0 -750 | 0 0 0 | 1840 0 1534 | -0.5545488 0 -1.9160406
0 -90 90 0 0 0 | 0 0 0 | 50000 -30000 80000 | 1840 0 1534 | 0.1319952 0.4032532 0.1535758
30 -75 110 20 -40 60 | 546 0 0 | 0 0 0 | 1648.065793 -1099.861447 1146.663641 | 1.2522154 0.8079855 0.1438217
90 -120 130 180 30 -90 | 0 0 -1000 | 0 0 0 | -250 -1213.137562 1624.493789 | -0.4323871 -0.4321928 -2.5558832
-170 -20 -60 300 -115 345 | 1000 1000 1000 | -40000 5000 60000 |\
 -1226.000741 663.597648 2114.755162 | 1.5018462 1.4222091 0.7955368
5 -95 100 10 -80 -5 | 30000 -20000 10000 | 2e6 -1e6 3e6 |\
 1611.261297 -42.850623 2091.051388 | 15.5368311 -60.5214325 -12.8046411
"""


@pytest.mark.parametrize("line", VECTORS.strip().splitlines())
def test_pose_and_bending_of_the_published_chain(line):
    """Vectors of an independent implementation of the chain of frames (Hähn & Weigold 2020, eq. 1-9)."""
    q, force, moment, place, moved = (np.array([float(v) for v in c.split()]) for c in line.split("|"))
    body, q = arm.reference_pose(WORLD), q[None] * DEGREE
    rigid, _ = arm.pose(body, q)
    angles = arm.torques(body, q, force[None], moment[None]) / WORLD.stiffness_Nmm_rad
    bent, _ = arm.bent(body, q, angles)
    np.testing.assert_allclose(rigid[0], place, atol=1e-6)
    np.testing.assert_allclose(bent[0] - rigid[0], moved, atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(st.floats(-200, 400), st.floats(-400, 400), st.floats(-100, 100)),
    st.tuples(st.floats(-30, 30), st.floats(-30, 30), st.floats(-30, 30)),
)
def test_inverse_is_the_inverse(place, turns):
    axes = euler(*turns)[None]
    there = WORLD.base.origin_mm + np.array([place])
    q = arm.inverse(WORLD, there, axes)
    back, back_axes = arm.pose(arm.reference_pose(WORLD), q)
    np.testing.assert_allclose(back, there, atol=1e-8)
    np.testing.assert_allclose(back_axes, axes, atol=1e-11)


def test_another_base_and_tool_are_undone_by_the_inverse():
    world = WORLD.but(base=Frame.of(1400, 120, 700, 10, -4, 3), tool=Frame.of(200, 20, 300, 5, -80, 2))
    place = np.array([[50.0, -60.0, 20.0]])
    q = joints_for(world, place)
    there, axes = arm.pose(arm.reference_pose(world), q)
    np.testing.assert_allclose((there - world.base.origin_mm) @ world.base.axes, place, atol=1e-8)
    np.testing.assert_allclose(axes[0], world.base.axes, atol=1e-11)


def test_compliance_is_symmetric_for_small_loads():
    """Maxwell's theorem."""
    body, q = arm.reference_pose(WORLD), np.radians([[10.0, -80.0, 100.0, 20.0, -50.0, -15.0]])
    rigid = arm.pose(body, q)[0]
    moved = []
    for k in range(3):
        angles = arm.torques(body, q, np.eye(3)[None, k], np.zeros((1, 3))) / WORLD.stiffness_Nmm_rad
        moved.append((arm.bent(body, q, angles)[0] - rigid)[0])
    matrix = np.array(moved)
    np.testing.assert_allclose(matrix, matrix.T, atol=2e-3 * np.abs(matrix).max())


# the time law -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("boxes", [(0.1, 0.168), (0.3, 0.168), (0.025, 0.084, 0.084)])
def test_a_step_through_moving_averages(boxes):
    dt = 1e-4
    t = np.arange(0.0, 1.0, dt)
    speed = np.concatenate([np.zeros(10000), np.ones(len(t))])
    for box in boxes:
        n = round(box / dt)
        speed = np.convolve(speed, np.ones(n) / n)[: len(speed)]
    gone = np.cumsum(speed)[10000:] * dt
    np.testing.assert_allclose(path.smeared_ramp(t, boxes), gone, atol=3e-4)


def test_peak_acceleration_of_the_published_rule():
    """v / max(v/a, k), k = 0.168 s (Bigliardi et al. 2022, section 4)."""
    for speed, acceleration in ((200.0, 2000.0), (600.0, 2000.0), (400.0, 4000.0)):
        world = WORLD.but(acceleration_mm_s2=acceleration)
        t = np.arange(0.0, 0.8, 1e-4)
        s = speed * path.smeared_ramp(t, path.boxes_of(speed, world))
        peak = np.gradient(np.gradient(s, t), t).max()
        assert peak == pytest.approx(speed / max(speed / acceleration, 0.168), rel=2e-3)


def test_motion_is_continuous_and_keeps_the_programmed_speed(plain):
    for run in plain.values():
        speed = np.linalg.norm(np.diff(run.place_mm, axis=0), axis=1) / 0.001
        assert speed.max() < run.way.speed_mm_s.max() * (1 + 1e-9)
        np.testing.assert_allclose(run.place_mm[-1], run.way.position_mm[-1], atol=1e-9)


def test_joints_turn_round_in_the_programs(plain):
    turns = np.zeros(6)
    for run in plain.values():
        speed = run.rates(run.q_cmd)
        for j in range(6):
            sign = np.sign(speed[np.abs(speed[:, j]) > 1e-3, j])
            turns[j] += np.count_nonzero(np.diff(sign))
    assert turns.min() >= 10


# the cut ----------------------------------------------------------------------------------------------------


def steady_cut(width_mm: float, side: float) -> np.ndarray:
    """Feed, normal and axial force 5 mm deep at 0.1 mm a tooth in the middle of a straight pass along x."""
    stock = np.array([[-500.0, -8.0, -20.0], [500.0, width_mm - 8.0, 0.0]])
    if side < 0.0:
        stock[:, 1] = -stock[::-1, 1]
    work = chips.Pieces(
        np.array([[-600.0, 0, -5]]), np.array([[600.0, 0, -5]]), np.zeros(1), np.zeros(1), np.full(1, 1200.0)
    )
    place, before = np.array([[0.0, 0.0, -5.0]]), np.array([[-0.1, 0.0, -5.0]])
    cut = chips.cut(place, before, np.zeros(1), np.array([599.9]), work, WORLD.but(stock_mm=stock))
    assert cut.depth_mm[0] == pytest.approx(5.0)
    assert cut.width_mm[0] == pytest.approx(width_mm, rel=0.01)
    return cut.force_N[0] * [1, 1, -1]


@pytest.mark.parametrize(
    ("width_mm", "side", "expected"),
    [
        (16, 1, [-210.359, 430.795, 116.497]),
        (8, -1, [-266.336, 121.719, 58.249]),
        (8, 1, [55.977, 309.076, 58.249]),
        (4, -1, [-177.680, 12.639, 29.999]),
        (4, 1, [79.400, 170.219, 29.999]),
    ],
)
def test_mean_force_of_the_worked_example(width_mm, side, expected):
    """Closed form of Altintas' linear edge model; material on the left of the feed is cut up-milling."""
    np.testing.assert_allclose(steady_cut(width_mm, side), expected, atol=0.01 * np.abs(expected).max())


def test_entry_into_a_wall_follows_the_exact_arc():
    """d after contact the rim cuts from asin(1 - d/R) to pi minus that."""
    stock = np.array([[0.0, -100.0, -20.0], [400.0, 100.0, 0.0]])
    world, f_z = WORLD.but(stock_mm=stock), 0.077
    k = world.cutter.coefficients
    for d in (0.2, 1.0, 4.0, 7.9):
        x = d - 8.0
        work = chips.Pieces(
            np.array([[-50.0, 0, -5]]), np.array([[50.0, 0, -5]]), np.zeros(1), np.zeros(1), np.full(1, 100.0)
        )
        place, before = np.array([[x, 0.0, -5.0]]), np.array([[x - f_z, 0.0, -5.0]])
        cut = chips.cut(place, before, np.zeros(1), np.array([x + 50.0 - f_z]), work, world)
        phi = np.linspace(np.arcsin(1 - d / 8), np.pi - np.arcsin(1 - d / 8), 20001)
        ft = k[0] * f_z * np.sin(phi) + k[3]
        fr = k[1] * f_z * np.sin(phi) + k[4]
        share = 3 * 5.0 / (2 * np.pi)
        feed = share * np.trapezoid(-ft * np.cos(phi) - fr * np.sin(phi), phi)
        normal = share * np.trapezoid(ft * np.sin(phi) - fr * np.cos(phi), phi)
        np.testing.assert_allclose(cut.force_N[0, :2], [feed, normal], rtol=0.01, atol=0.5)


@pytest.mark.parametrize("corner", ["parabola", "quartic"])
def test_chords_lie_within_the_skin_of_the_rounded_corners(corner):
    world, share = WORLD.but(corner=corner), np.linspace(0.0, 1.0, 21)
    for program in PROGRAMS.values():
        links = path.chains(program().waypoints(), world)
        work = chips.pieces(links, world)
        for j in range(len(work.chain)):
            s = work.from_mm[j] + share * (work.to_mm[j] - work.from_mm[j])
            chord = work.start_mm[j] + share[:, None] * (work.end_mm[j] - work.start_mm[j])
            off = chord - path.at_distance(links[int(work.chain[j])], s, world)
            assert np.linalg.norm(off, axis=1).max() <= chips.SKIN_mm * 1.001


@pytest.mark.parametrize(
    ("name", "begin_s", "end_s"),
    [
        ("ramps", 12.64, 12.76),  # from a level slot into a rising one that leads a little aside
        ("pocket", 2.2, 3.0),  # an arc of short moves, full slot
        ("pocket", 7.6, 8.6),  # the next round, half of the width
        ("contour", 16.54, 16.66),  # 90°, out of the air into the side
    ],
)
def test_cut_in_corners_and_arcs_is_that_of_a_map_of_pixels(plain, name, begin_s, end_s):
    """Left over: the map's arcs are those of a whole turn, three passings, and known to a pixel or two."""
    run = plain[name]
    time_s, force_N, arc_rad = pixels.tooth_passings(run, begin_s, end_s, 0.02)
    cut = cut_at(run, time_s, path.commanded(run.links, time_s, WORLD))
    off = np.linalg.norm(cut.force_N - force_N, axis=1)
    peak = np.linalg.norm(force_N, axis=1).max()
    assert peak > 200.0
    assert off.max() < 0.03 * peak
    assert np.sqrt(np.mean(off**2)) < 0.015 * peak
    rows = (cut.depth_mm > 0.0) & np.isfinite(arc_rad).all(axis=1)
    aside = np.degrees(cut.arc_rad[rows] - arc_rad[rows])
    assert np.count_nonzero(rows) > 30
    assert np.abs(aside).max() < 6.0
    assert np.sqrt(np.mean(aside**2)) < 1.5


@pytest.mark.parametrize("name", ["ramps", "pocket"])
def test_material_left_is_that_of_many_cylinders(plain, name):
    run = plain[name]
    t = np.arange(0.0, run.links[-1].end_s, 0.0008)
    swept = path.commanded(run.links, t, WORLD)
    rng = np.random.default_rng(3)
    points = rng.uniform([1, -69], [159, 69], (300, 2))
    left = chips.left_heights(points, run.pieces, WORLD)
    away = ((points[:, None] - swept[None, :, :2]) ** 2).sum(axis=2)
    brute = np.minimum(np.where(away < 64.0, swept[None, :, 2], np.inf).min(axis=1), 0.0)
    rim = np.abs(np.sqrt(away.min(axis=1)) - 8.0) < 0.15  # sampled cylinders are ragged there
    off = np.abs(left - brute)[~rim]
    assert np.quantile(off, 0.97) < 0.02
    assert np.count_nonzero(left < -0.5) > 20


def test_runout_without_lost_teeth_changes_nothing_but_a_tooth_that_is_lost_rubs_nothing():
    way = PROGRAMS["slots"]().waypoints()
    true = simulate(way, WORLD, []).cut.force_N
    little = simulate(way, WORLD.cutting(runout_mm=np.array([0.001, -0.0005, -0.0005])), []).cut.force_N
    much = simulate(way, WORLD.cutting(runout_mm=np.array([0.0, 0.0, -0.3])), []).cut.force_N
    assert np.abs(little - true).max() < 0.03 * np.abs(true).max()
    assert np.abs(much[:, 1]).max() < 0.97 * np.abs(true[:, 1]).max()


# memory -----------------------------------------------------------------------------------------------------


def test_lag_of_a_ramp_is_the_closed_form():
    t = np.arange(0.0, 0.5, 0.001)
    out = memory.lag(3.0 * t, np.full(len(t), 0.02), 0.001)
    np.testing.assert_allclose(out, 3.0 * (t - 0.02 * (1 - np.exp(-t / 0.02))), atol=1e-12)


def test_play_follows_only_when_it_touches():
    x = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, -1, 201)])
    y = memory.play(x, np.full(len(x), 0.1), 0.0)
    assert np.abs(y - x).max() <= 0.1 + 1e-12
    assert y[100] == pytest.approx(0.9)
    assert y[115] == pytest.approx(0.9)  # still in the gap
    assert y[-1] == pytest.approx(-0.9)


def test_second_order_rings_as_its_closed_form():
    t = np.arange(0.0, 0.6, 0.001)
    x = np.where(t > 0.0, 1.0, 0.0)
    w, z = 2 * np.pi * 12.0, 0.03
    wd, s = w * np.sqrt(1 - z**2), np.maximum(t - 0.0005, 0.0)  # the step is a ramp of one sample
    ring = 1 - np.exp(-z * w * s) * (np.cos(wd * s) + z / np.sqrt(1 - z**2) * np.sin(wd * s))
    np.testing.assert_allclose(memory.second_order(x, 12.0, z, 0.001)[2:], ring[2:], atol=0.01)


def test_spikes_come_after_reversals_only_and_fade():
    t = np.arange(0.0, 4.0, 0.001)
    speed = np.where(t < 1, 1.0, np.where(t < 2, 0.0, np.where(t < 3, 1.0, -1.0)))
    out = memory.reversal_spikes(speed, 0.5, 0.1, 0.001, 1e-3)
    assert np.abs(out[t < 3]).max() < 1e-12  # a stop is no reversal
    assert out[3000] == pytest.approx(0.5)
    assert out[3100] == pytest.approx(0.5 * np.exp(-1.0), rel=0.02)


def test_hysteresis_loops_are_closed_and_bounded():
    x = 300.0 * np.sin(np.linspace(0, 12 * np.pi, 6001))
    for z in (memory.bouc_wen(x, 300.0, 4.0), memory.play(x, np.full(len(x), 150.0), 0.0) / 300.0):
        assert np.abs(z).max() <= 1.0
        np.testing.assert_allclose(z[3000:4000], z[4000:5000], atol=0.01)
        assert abs(z[4500] - z[4000]) > 0.4  # up and down differ at zero


def test_bristles_settle_on_the_coulomb_level():
    speed = np.concatenate([np.full(1000, 0.2), np.full(1000, -0.2)])
    out = memory.lugre(speed, 2e-4, 0.01, 0.3, 0.001)
    assert out[900] == pytest.approx(1.0, abs=0.01)
    assert out[-1] == pytest.approx(-1.0, abs=0.01)
