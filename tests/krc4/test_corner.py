"""Approximated corners: the closed forms, and the blended path in Motion."""

import itertools

import numpy as np
import pytest

from gcode2krl import plan_motion
from gcode2krl.krc4 import corner
from tests.krc4 import oracle
from tests.krc4.conftest import HEAD, K_S, polyline

FINE_S = 0.001


def triangle(length_1, length_2, alpha_deg, tilt=0.0):
    """Return P1, P2, P3 with the corner at P2 in front of the robot; ``tilt`` lifts it out of the plane."""
    half = np.deg2rad(alpha_deg) / 2
    arms = np.array([[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0]])
    turn = np.array([[np.cos(tilt), 0, -np.sin(tilt)], [0, 1, 0], [np.sin(tilt), 0, np.cos(tilt)]])
    arms = arms @ turn.T
    return np.array([length_1 * arms[0], [0, 0, 0], length_2 * arms[1]])


# --- closed forms -----------------------------------------------------------------------------------------


def test_values_of_the_paper():
    p1, p2, p3 = (np.tile(p, (3, 1)) for p in triangle(230, 230, 75))
    speed = np.array([200.0, 400.0, 600.0])
    d, error, a_p, duration = corner(p1, p2, p3, 80.0, speed)
    assert d == pytest.approx(np.full(3, 80.0))
    assert a_p / 1000 == pytest.approx([0.3967, 1.5867, 3.5701], abs=5e-5)
    assert error == pytest.approx(np.full(3, 80 * np.cos(np.deg2rad(37.5)) / 2))
    assert duration == pytest.approx(160 / speed)


@pytest.mark.parametrize(
    ("cdis", "effective"),
    [(20, 20), (60, 60), (100, 100), (115, 115), (120, 115), (140, 115), (160, 115), (180, 115), (200, 115)],
)
def test_truncation_at_half_the_line(cdis, effective):
    p1, p2, p3 = (p[None, :] for p in triangle(230, 230, 75))
    d, error, a_p, duration = corner(p1, p2, p3, float(cdis), np.array([600.0]))
    cosine = np.cos(np.deg2rad(37.5))
    assert d[0] == pytest.approx(effective)
    assert error[0] == pytest.approx(effective * cosine / 2)
    assert a_p[0] == pytest.approx(600**2 * cosine / effective)
    assert duration[0] == pytest.approx(2 * effective / 600)


@pytest.mark.parametrize(("length_1", "length_2", "wanted"), [(30, 200, 15), (200, 30, 15), (60, 50, 20)])
def test_half_of_the_shorter_line(length_1, length_2, wanted):
    p1, p2, p3 = (p[None, :] for p in triangle(length_1, length_2, 110, tilt=0.4))
    assert corner(p1, p2, p3, 20.0, np.array([50.0]))[0][0] == pytest.approx(wanted)


def test_many_random_corners_against_the_parabola():
    random = np.random.default_rng(7)
    p1, p2, p3 = random.uniform(-50, 50, (3, 40, 3))
    cdis, speed = random.uniform(0.1, 30, 40), random.uniform(5, 500, 40)
    d, error, a_p, duration = corner(p1, p2, p3, cdis, speed)
    for k in range(40):
        lengths = np.linalg.norm(p2[k] - p1[k]), np.linalg.norm(p3[k] - p2[k])
        assert d[k] == pytest.approx(min(cdis[k], *lengths / np.array(2.0)))
        points = oracle.parabola(p1[k], p2[k], p3[k], d[k], 2001)
        apex = np.linalg.norm(points - p2[k], axis=1).min()
        assert error[k] == pytest.approx(apex, rel=1e-6)
        change = (p3[k] - p2[k]) / lengths[1] - (p2[k] - p1[k]) / lengths[0]
        assert a_p[k] == pytest.approx(np.linalg.norm(change) * speed[k] / duration[k])


def test_a_pair_of_equal_speeds_is_one_speed():
    p1, p2, p3 = (p[None, :] for p in triangle(100, 80, 90))
    one = corner(p1, p2, p3, 10.0, np.array([50.0]))
    two = corner(p1, p2, p3, 10.0, np.array([[50.0, 50.0]]))
    for left, right in zip(one, two, strict=True):
        assert np.ravel(right)[0] == pytest.approx(np.ravel(left)[0])


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_straight_reversal_and_length_zero_without_nan():
    p1 = np.array([[-10, 0, 0], [-10, 0, 0], [0, 0, 0], [-10, 0, 0], [0, 0, 0], [-0.1, -0.3, -0.7]], float)
    p2 = np.zeros((6, 3))
    p3 = np.array([[10, 0, 0], [-10, 0, 0], [10, 0, 0], [0, 0, 0], [0, 0, 0], [0.1, 0.3, 0.7]], float)
    for speed in (np.full(6, 50.0), np.zeros(6)):
        for cdis in (2.0, 0.0):
            values = corner(p1, p2, p3, cdis, speed)
            assert all(np.isfinite(column).all() for column in values)
            d, error, a_p, _ = values
            assert (d >= 0).all()
            assert d[[2, 3, 4]] == pytest.approx(np.zeros(3))
            assert error[[0, 2, 3, 4, 5]] == pytest.approx(np.zeros(5), abs=1e-6)
            assert a_p[[0, 5]] == pytest.approx(np.zeros(2), abs=1e-3)


# --- the blended path -------------------------------------------------------------------------------------

CASES = [  # L1, L2, alpha, CDIS, v mm/s, a m/s², tilt; long enough to reach v before the corner
    (230, 230, 75, 80, 200, 4.0, 0.0),
    (230, 230, 75, 80, 600, 4.0, 0.0),
    (230, 230, 75, 80, 600, 2.0, 0.0),
    (230, 230, 75, 200, 400, 4.0, 0.0),
    (230, 230, 75, 20, 600, 4.0, 0.0),
    (120, 60, 120, 60, 100, 4.0, -0.3),
    (60, 120, 40, 10, 75, 2.0, -0.2),
    (80, 80, 170, 25, 150, 2.0, 0.0),
]


class Blend:
    """One corner in Motion, and what the law says about it."""

    def __init__(self, run, case, dt_s=FINE_S):
        length_1, length_2, self.alpha_deg, cdis, self.v, a_m_s2, tilt = case
        self.p = np.round(triangle(length_1, length_2, self.alpha_deg, tilt), 6)
        self.motion = run(polyline(self.p, [self.v] * 2), dt_s=dt_s, cdis_mm=float(cdis), acc_cp_m_s2=a_m_s2)
        sides = np.linalg.norm(np.diff(self.p, axis=0), axis=1)
        self.polyline_mm = sides.sum()
        self.u1, self.u2 = np.diff(self.p, axis=0) / sides[:, None]
        self.half = np.arccos(-self.u1 @ self.u2) / 2
        self.d = min(cdis, *sides / 2)
        self.error = self.d * np.cos(self.half) / 2
        self.a_p = self.v**2 * np.cos(self.half) / self.d
        self.duration_s = self.polyline_mm / self.v + self.v / (1000 * a_m_s2) + K_S
        outward = self.u1 - self.u2  # from the corner's inside to P2
        self.outward = outward / np.linalg.norm(outward)

    def inside(self, margin=0):
        """Return the rows in the corner, a margin of samples away from its ends."""
        rows = np.flatnonzero(self.motion.corner)
        assert (np.diff(rows) == 1).all()
        return rows[margin : len(rows) - margin]


@pytest.fixture(scope="module", params=CASES, ids=str)
def blend(request, run_program):
    return Blend(run_program, request.param)


def off_line(position, through, direction):
    relative = position - through
    return np.linalg.norm(relative - np.outer(relative @ direction, direction), axis=1)


def test_leaves_and_joins_the_lines_at_d(blend):
    """In the corner the distance to a line grows with the square of time: its root is a straight line."""
    motion, rows = blend.motion, blend.inside(2)
    for direction, part, sign in (
        (blend.u1, rows[: len(rows) // 2], -1),
        (blend.u2, rows[len(rows) // 2 :], 1),
    ):
        root = np.sqrt(off_line(motion.position_mm[part], blend.p[1], direction))
        slope, offset = np.polyfit(root, motion.time_s[part], 1)
        assert np.abs(np.polyval([slope, offset], root) - motion.time_s[part]).max() < 1e-6
        place = np.array([np.interp(offset, motion.time_s, motion.position_mm[:, k]) for k in range(3)])
        along = (place - blend.p[1]) @ direction
        assert sign * along == pytest.approx(blend.d, abs=1e-3 + 0.5 * blend.a_p * FINE_S**2)


def test_flag_marks_the_corner_and_nothing_else(blend):
    motion = blend.motion
    rows = blend.inside()
    span = motion.time_s[rows[-1]] - motion.time_s[rows[0]]
    assert span == pytest.approx(2 * blend.d / blend.v, abs=2.001 * FINE_S)
    from_lines = np.minimum(
        off_line(motion.position_mm, blend.p[1], blend.u1), off_line(motion.position_mm, blend.p[1], blend.u2)
    )
    assert from_lines[~motion.corner].max() < 1e-9
    assert from_lines[blend.inside(2)].min() > 0
    assert (np.diff(motion.move) >= 0).all()
    assert len(np.unique(motion.move[motion.time_s > 0])) == 2


def test_points_lie_on_the_parabola(blend):
    points = oracle.parabola(*blend.p, blend.d)
    position = blend.motion.position_mm[blend.inside()]
    nearest = [np.linalg.norm(points - point, axis=1).argmin() for point in position]
    gap = []
    for point, k in zip(position, nearest, strict=True):
        k = min(max(k, 1), len(points) - 2)
        chord = points[k + 1] - points[k - 1]
        gap.append(np.linalg.norm(np.cross(point - points[k - 1], chord)) / np.linalg.norm(chord))
    assert max(gap) < 1e-5


def test_distance_of_the_apex(blend):
    """Projected on the bisector the corner is a parabola in time: its extremum is the apex."""
    rows = blend.inside(2)
    time = blend.motion.time_s[rows] - blend.motion.time_s[rows].mean()
    height = (blend.motion.position_mm[rows] - blend.p[1]) @ blend.outward
    curve = np.polynomial.Polynomial.fit(time, height, 2)
    assert np.abs(curve(time) - height).max() < 1e-7
    apex = curve.deriv().roots()[0]
    assert -curve(apex) == pytest.approx(blend.error, abs=1e-6)
    nearest = np.linalg.norm(blend.motion.position_mm - blend.p[1], axis=1).min()
    assert blend.error - 1e-6 <= nearest < blend.error + (blend.v * FINE_S) ** 2 / blend.d


def test_speed_in_the_corner(blend):
    motion, rows = blend.motion, blend.inside(1)
    assert motion.speed_mm_s[rows].min() == pytest.approx(blend.v * np.sin(blend.half), rel=1e-4, abs=0.01)
    assert motion.speed_mm_s[rows].min() > 0.1 * blend.v
    before, after = motion.speed_mm_s[: rows[0]], motion.speed_mm_s[rows[-1] :]
    assert before.max() == pytest.approx(blend.v, rel=1e-6)
    assert after.max() == pytest.approx(blend.v, rel=1e-4)
    velocity = np.gradient(motion.position_mm[rows], motion.time_s[rows], axis=0)[1:-1]
    assert np.abs(np.linalg.norm(velocity, axis=1) - motion.speed_mm_s[rows][1:-1]).max() < 1e-3 * blend.v


def test_acceleration_in_the_corner(blend):
    motion, rows = blend.motion, blend.inside(2)
    assert motion.acceleration_mm_s2[rows] == pytest.approx(np.full(len(rows), blend.a_p), rel=1e-6)
    second = np.diff(motion.position_mm[rows], 2, axis=0) / FINE_S**2
    assert np.linalg.norm(second, axis=1) == pytest.approx(np.full(len(second), blend.a_p), rel=1e-3)
    assert second @ blend.outward == pytest.approx(np.full(len(second), -blend.a_p), rel=1e-3)


def test_direction_is_continuous(blend):
    motion = blend.motion
    velocity = np.diff(motion.position_mm, axis=0) / np.diff(motion.time_s)[:, None]
    change = np.linalg.norm(np.diff(velocity, axis=0), axis=1)[:-1]
    # a difference of means over two samples: no more than the largest acceleration over their span
    assert change.max() <= motion.acceleration_mm_s2.max() * FINE_S * 1.01 + 1e-6


def test_path_is_the_arc_length(blend):
    motion = blend.motion
    chords = np.linalg.norm(np.diff(motion.position_mm, axis=0), axis=1)
    summed = np.concatenate([[0], np.cumsum(chords)])
    assert np.abs(motion.path_mm - summed).max() < 1e-4 * motion.path_mm[-1]
    curve = oracle.parabola(*blend.p, blend.d)
    arc = np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
    assert motion.path_mm[-1] == pytest.approx(blend.polyline_mm - 2 * blend.d + arc, rel=1e-6)
    assert (np.diff(motion.path_mm) >= 0).all()


def test_duration_and_parameter(blend):
    """The corner costs no time: the distance along the polyline is that of one straight line."""
    motion = blend.motion
    assert motion.time_s[-1] == pytest.approx(blend.duration_s, abs=FINE_S)
    wanted = oracle.chain([(blend.polyline_mm, blend.v)], blend_acceleration(blend), K_S)
    before = np.arange(len(motion)) < blend.inside()[0]
    after = np.arange(len(motion)) > blend.inside()[-1]
    position = wanted.position(motion.time_s)
    along_1 = np.linalg.norm(motion.position_mm - blend.p[0], axis=1)
    assert np.abs(along_1 - position)[before].max() < 1e-3
    to_go = np.linalg.norm(motion.position_mm - blend.p[2], axis=1)
    assert np.abs(blend.polyline_mm - to_go - position)[after].max() < 1e-3


def blend_acceleration(blend):
    """Return $ACC.CP from the duration, which the test beside it checks."""
    return blend.v / (blend.duration_s - blend.polyline_mm / blend.v - K_S)


# --- several corners --------------------------------------------------------------------------------------


def test_corners_that_meet_in_the_middle_of_a_line(run_program):
    """CDIS beyond half of every line: the corners touch, and the speed never falls to zero."""
    points = [(40 * (k % 2), -90 + 30 * k, 0) for k in range(7)]
    points = [(0, -240, 0), *points, (0, 240, 0)]
    v, lengths = 60, [np.linalg.norm(np.subtract(b, a)) for a, b in itertools.pairwise(points)]
    motion = run_program(polyline(points, [v] * 8), dt_s=FINE_S, cdis_mm=100.0)
    assert np.isfinite(motion.acceleration_mm_s2).all()
    assert motion.time_s[-1] == pytest.approx(sum(lengths) / v + v / 2000 + K_S, abs=FINE_S)
    between = (motion.time_s > 0.3) & (motion.time_s < motion.time_s[-1] - 0.3)
    assert motion.speed_mm_s[between].min() > 0.3 * v
    chords = np.linalg.norm(np.diff(motion.position_mm, axis=0), axis=1)
    assert chords.sum() == pytest.approx(motion.path_mm[-1], rel=1e-4)
    for point in points[2:-2]:
        nearest = np.linalg.norm(motion.position_mm - np.array(point), axis=1).min()
        cosine = 40 / 50  # lines along (40, 30) and (-40, 30)
        assert nearest == pytest.approx(25 * cosine / 2, abs=1e-3)


def test_corner_between_unequal_speeds_runs_at_the_slower(run_program):
    """The speed changes longer than the corner lasts: braking ends before it, acceleration starts after."""
    p = triangle(100, 100, 90)
    cdis, cosine = 0.5, np.sqrt(0.5)
    for speeds in ((60, 20), (20, 60)):
        motion = run_program(polyline(p, speeds), dt_s=FINE_S, cdis_mm=cdis)
        rows = np.flatnonzero(motion.corner)[2:-2]
        assert motion.acceleration_mm_s2[rows] == pytest.approx(
            np.full(len(rows), 20**2 * cosine / cdis), rel=1e-4
        )
        assert motion.speed_mm_s[rows].min() == pytest.approx(20 * np.sqrt(0.5), rel=1e-3)
        assert motion.time_s[motion.corner][-1] - motion.time_s[motion.corner][0] == pytest.approx(
            2 * cdis / 20, abs=2.001 * FINE_S
        )
        assert motion.speed_mm_s.max() == pytest.approx(60, rel=1e-6)


def test_a_wide_corner_takes_the_change_of_speed(run_program):
    """|dv|/a + k <= 2·d/v: each line is left and joined at its own speed, and the direction is continuous."""
    p = triangle(120, 120, 90)
    motion = run_program(polyline(p, (50, 40)), dt_s=FINE_S, cdis_mm=20.0)
    rows = np.flatnonzero(motion.corner)
    assert motion.speed_mm_s[rows[0]] == pytest.approx(50, rel=0.01)
    assert motion.speed_mm_s[rows[-1]] == pytest.approx(40, rel=0.01)
    inner = motion.acceleration_mm_s2[rows[2:-2]]
    assert np.ptp(inner) < 1e-6 * inner.max()  # a constant acceleration vector
    velocity = np.diff(motion.position_mm, axis=0) / np.diff(motion.time_s)[:, None]
    change = np.linalg.norm(np.diff(velocity, axis=0), axis=1)[:-1]
    assert change.max() <= motion.acceleration_mm_s2.max() * FINE_S * 1.02 + 1e-6


def test_exact_stop_has_no_corner(run_program):
    p = triangle(60, 60, 90)
    for text in (polyline(p, [40, 40], "G61"), polyline(p, [40, 40])):
        motion = run_program(text, dt_s=FINE_S, cdis_mm=0.0)
        assert not motion.corner.any()
        assert np.linalg.norm(motion.position_mm - p[1], axis=1).min() < 1e-6
        assert motion.time_s[-1] == pytest.approx(2 * (60 / 40 + 0.02 + K_S), abs=2 * FINE_S)


def test_accepts_targets_and_toolpath(make_cell, read):
    from gcode2krl import set_targets

    cell = make_cell(cdis_mm=5.0)
    toolpath = read(HEAD + "G64\nG0 X0 Y0 Z0\nG1 Y40 F3000\nG1 X30\nM30\n", cell)
    one, two = plan_motion(toolpath, cell), plan_motion(set_targets(toolpath, cell), cell)
    assert (one.position_mm == two.position_mm).all()
    assert (one.time_s == two.time_s).all()
    assert (one.move == two.move).all()
