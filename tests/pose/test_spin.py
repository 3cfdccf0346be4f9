"""Tool frames from axis and spin: z is the axis, the spin turns about it, the tilt is the shortest."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gcode2krl.pose.path import between
from gcode2krl.pose.quality import Judge, Quality
from gcode2krl.pose.spin import smooth_spin, stiffest_spin, tool_rotation
from gcode2krl.program.targets import straight
from tests.pose.judging import judge_by

angles = st.floats(-2 * np.pi, 2 * np.pi)
components = st.floats(-1, 1)
axes = st.tuples(components, components, components).filter(lambda v: np.linalg.norm(v) > 0.05)
UP = np.array([0.0, 0.0, 1.0])


def unit(vector):
    return np.array(vector) / np.linalg.norm(vector)


@settings(deadline=None)
@given(st.lists(axes, min_size=1, max_size=5), angles)
def test_z_is_the_axis(vectors, spin):
    axis = np.array([unit(v) for v in vectors])
    quaternion = tool_rotation(axis, spin)
    assert np.linalg.norm(quaternion, axis=1) == pytest.approx(1)
    assert Rotation.from_quat(quaternion).apply(UP) == pytest.approx(axis, abs=1e-9)


@settings(deadline=None)
@given(axes, angles, angles)
@example((0.0, 5.96e-08, -0.0625), 0.0, 1.0)
@example((1e-9, 0.0, -1.0), 1.0, -2.0)
def test_spin_turns_about_the_axis(vector, first, second):
    axis = unit(vector)[None]
    a, b = (Rotation.from_quat(tool_rotation(axis, spin)) for spin in (first, second))
    expected = Rotation.from_rotvec((second - first) * axis)
    assert ((b * a.inv()) * expected.inv()).magnitude() == pytest.approx(0, abs=1e-9)


@settings(deadline=None)
@given(axes)
def test_zero_spin_is_the_shortest_tilt(vector):
    axis = unit(vector)[None]
    tilt = Rotation.from_quat(tool_rotation(axis, 0.0)).magnitude()[0]
    assert tilt == pytest.approx(np.arccos(np.clip(axis[0, 2], -1, 1)), abs=1e-5)


@settings(deadline=None)
@given(st.lists(st.tuples(axes, angles), min_size=1, max_size=5))
def test_a_spin_for_each_row(rows):
    axis = np.array([unit(v) for v, _ in rows])
    spin = np.array([angle for _, angle in rows])
    one_by_one = [tool_rotation(axis[k : k + 1], float(spin[k]))[0] for k in range(len(rows))]
    assert tool_rotation(axis, spin) == pytest.approx(np.array(one_by_one), abs=1e-9)


@pytest.mark.parametrize(
    ("axis", "spin_deg", "abc_deg"),
    [(UP, 0, (0, 0, 0)), (-UP, 0, (0, 0, 180)), *((UP, deg, (deg, 0, 0)) for deg in (-180, -30, 90, 360))],
)
def test_upright_and_upside_down(axis, spin_deg, abc_deg):
    """All rows alike: the upright frame is turned about z alone, upside down it is that turned about x."""
    turned = Rotation.from_quat(tool_rotation(np.broadcast_to(axis, (4, 3)), np.radians(spin_deg)))
    off = turned * Rotation.from_euler("ZYX", abc_deg, degrees=True).inv()
    assert off.magnitude() == pytest.approx(np.zeros(4), abs=1e-9)


def test_no_rows():
    assert tool_rotation(np.empty((0, 3)), 0.0).shape == (0, 4)


# --- the search for a spin ------------------------------------------------------------------------------

PATH = np.column_stack([np.linspace(0, 2000, 201), np.zeros(201), np.zeros(201)])


def spin_of(margin, position=PATH, is_target=None):
    return smooth_spin(position, judge_by(margin), None, is_target)


def around(centre_of, width_rad):
    """Return a margin of two branches: 1 at a centre that may move with the row, 0 at its width."""

    def quality(rows, spin):
        off = np.abs(np.angle(np.exp(1j * (spin - centre_of(rows)))))
        good = np.maximum(1 - off / width_rad, -1.0)
        return np.stack([good, np.full(len(rows), -1.0)], axis=1)

    return quality


@pytest.mark.parametrize("centre_deg", [-150, -40, 60, 175])
def test_constant_where_a_constant_will_do(centre_deg):
    spin = spin_of(around(lambda rows: np.full(len(rows), np.radians(centre_deg)), np.radians(30)))
    assert isinstance(spin, float)
    assert abs(np.degrees(spin) - centre_deg) <= 0.7 * 30


def test_smallest_turn_wins_a_tie():
    assert spin_of(lambda rows, spin: np.ones((len(rows), 2))) == pytest.approx(0)


def test_changes_slowly_where_no_constant_will_do():
    """The good angle wanders by 120 degrees with a width of 25: the spin follows it without a jump."""

    def wanders(rows):
        return np.radians(120) * PATH[rows, 0] / 2000

    quality = around(wanders, np.radians(25))
    spin = spin_of(quality)
    assert np.shape(spin) == (201,)
    rows = np.arange(201)
    worst = min(quality(rows[k : k + 1], spin[k])[0, 0] for k in rows)
    assert worst > 0
    assert np.abs(np.diff(spin)).max() <= np.radians(5.001) * 10 / 25 * 2.5  # 10 mm a row


def test_between_targets_the_angle_is_on_the_way_from_one_to_the_other():
    """No constant will do; of the turns at the ends only those count that pass the middle well."""
    centre_deg = np.array([0.0, 10.0, 70.0, 75.0, 80.0])  # at 0, 500, 1000, 1500, 2000 mm
    is_target = np.array([True, False, False, False, True])
    width = np.radians(42)
    spin = spin_of(around(lambda rows: np.radians(centre_deg)[rows], width), PATH[::50], is_target)
    assert np.shape(spin) == (5,)
    assert np.allclose(np.diff(spin), np.diff(spin)[0])
    apart = np.abs(np.degrees(spin) - centre_deg)
    assert apart.max() < 42.0
    for first, last in itertools.product(np.radians(np.arange(-90, 91, 5)), repeat=2):
        line = np.linspace(first, last, 5)
        assert np.abs(np.degrees(line) - centre_deg).sum() >= apart.sum() - 3 * 5.0 - 1e-9


def test_a_long_move_has_points_between_its_targets():
    position = np.array([[0.0, 0, 0], [0, 0, 120], [0, 0, 130], [300, 0, 130], [300, 400, 130]])
    points = between(position, np.array([True, True, True, False, True]))
    found = points.of(position)
    assert (found[points.share == 0.0] == position).all()
    way = np.linalg.norm(np.diff(found, axis=0), axis=1)
    assert np.sort(way)[-1] == pytest.approx(300.0)  # the move that is not joined
    assert np.sort(way)[-2] <= 50.0 + 1e-9
    assert way.sum() == pytest.approx(120 + 10 + 300 + 400)
    axis = points.directions(np.array([[0.0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0]]))
    assert np.linalg.norm(axis, axis=1) == pytest.approx(1.0)
    assert len(between(position[:1], np.ones(1, dtype=bool)).of(position[:1])) == 1


def test_short_moves_leave_no_fewer_points_to_long_ones():
    short = np.column_stack([np.linspace(0, 400_000, 40_001), np.zeros(40_001), np.zeros(40_001)])
    position = np.vstack([short, short[-1] + [0.0, 400.0, 0.0]])
    assert len(between(position, np.ones(len(position), dtype=bool)).before) == len(position) + 7


def test_what_the_robot_does_not_see_move_has_points_all_the_same():
    """A rail goes along with the tool; then a table turns below it."""
    position = np.array([[0.0, 0, 0], [0, 400, 0], [0, 400, 0]])
    seen = np.array([[0.0, 0, 0], [0, 0, 0], [200, 0, 0]])
    before = between(position, np.ones(3, dtype=bool), seen).before
    assert np.bincount(before).tolist() == [8, 4, 1]


def test_opposite_axes_have_no_direction_between():
    points = between(np.array([[0.0, 0, 0], [0, 0, 200]]), np.ones(2, dtype=bool))
    with np.errstate(all="raise"):
        axis = points.directions(np.array([UP, -UP]))
    assert np.linalg.norm(axis, axis=1) == pytest.approx(1.0)


def test_no_line_leads_through_home_or_to_another_tool():
    ptp = np.array([True, False, False, True, True, False, False])
    home = np.array([True, False, False, True, False, False, False])
    tool = np.array([1, 1, 1, 1, 1, 1, 2])
    assert straight(ptp, home, tool).tolist() == [False, False, True, False, False, True, False]


def test_a_point_out_of_reach_does_not_make_the_others_worse():
    """No angle is possible in the last row: that which is good in all the others is taken."""
    good = around(lambda rows: np.full(len(rows), np.radians(100.0)), np.radians(30))
    spin = spin_of(lambda rows, spin: np.where(rows[:, None] == 200, -1.0, good(rows, spin)))
    assert np.abs(np.degrees(spin) - 100.0).max() <= 15.0


def test_a_single_position():
    assert spin_of(around(lambda rows: np.full(len(rows), 1.0), 0.5), PATH[:1]) == pytest.approx(
        1.0, abs=0.36
    )


def test_impossible_everywhere_is_still_a_number():
    assert np.isfinite(spin_of(lambda rows, spin: np.full((len(rows), 8), -1.0)))


def test_a_turn_that_hits_is_taken_before_one_out_of_reach():
    """The arm reaches between 80 and 120 degrees only, and hits something throughout."""

    def quality(rows, spin):
        reachable = np.full((len(rows), 8), abs(np.degrees(spin) - 100.0) <= 20.0)
        return Quality(reachable, reachable, np.where(reachable, 0.4, 0.0))

    short = smooth_spin(PATH[:2], Judge(quality))
    assert abs(np.degrees(short) - 100.0) <= 20.0


@pytest.mark.parametrize(("softest_deg", "wanted_deg"), [(0.0, 90.0), (60.0, -50.0), (-60.0, 50.0)])
def test_the_stiffest_turn_keeps_off_what_is_hardly_reached(softest_deg, wanted_deg):
    """Bending falls with the distance from a turn; margins are above 0.15 within 90 or 50 degrees of zero."""
    within_deg = 90.0 if softest_deg == 0.0 else 50.0

    def margin(rows, spin):
        return np.full((len(rows), 2), 0.2 if abs(np.degrees(spin)) < within_deg + 1.0 else 0.14)

    def bending(rows, spin):
        return np.full((len(rows), 2), 2.0 - abs(np.degrees(spin) - softest_deg) / 360.0)

    spin = stiffest_spin(PATH, judge_by(margin, bending))
    assert abs(np.degrees(spin)) == pytest.approx(abs(wanted_deg))
    assert softest_deg == 0.0 or np.degrees(spin) == pytest.approx(wanted_deg)


def test_where_no_turn_is_stiff_and_reached_the_smooth_one_is_taken():
    margin = around(lambda rows: np.full(len(rows), 1.0), 0.5)
    judge = judge_by(lambda rows, spin: 0.1 * margin(rows, spin), lambda rows, spin: np.ones((len(rows), 2)))
    assert stiffest_spin(PATH, judge) == smooth_spin(PATH, judge)
