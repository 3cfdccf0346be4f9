"""Kinematics, status and turn, Jacobian: against eq. 1 spelled out and an independent solver."""

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from gcode2krl.robot.inverse_kinematics import all_branches, one_branch
from gcode2krl.robot.kinematics import flange_pose, status_turn
from gcode2krl.robot.velocity_kinematics import jacobian, smallest_singular_value
from tests.krl.replay import opw_solver

FloatArray = npt.NDArray[np.float64]

GEOMETRIES = {
    "KR 300 R2500 ultra": np.array([350.0, 41.0, 675.0, 1150.0, 1000.0, 240.0]),
    "KR 210 R2700-2": np.array([330.0, -115.0, 645.0, 1150.0, 1220.0, 215.0]),
    "KR 6 R900 sixx": np.array([25.0, -35.0, 400.0, 455.0, 420.0, 80.0]),
}
KR300 = GEOMETRIES["KR 300 R2500 ultra"]
HOME_RAD = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
TOOL_MM = np.array([250.0, 0.0, 250.0])

# TCP of the default end effector on the KR 300, from an independent implementation of its frames
TCP_VECTORS = [
    ((0, -90, 90, 0, 0, 0), (1840.000000, 0.000000, 1534.000000)),
    ((30, -75, 110, 20, -40, 60), (1648.065793, -1099.861447, 1146.663641)),
    ((-45, -110, 70, -100, 65, 170), (513.185129, 997.431384, 2656.047628)),
    ((12.5, -60.25, 95.75, 33.3, 88.8, -140.1), (1522.086716, -473.385906, 539.750432)),
    ((90, -120, 130, 180, 30, -90), (-250.000000, -1213.137562, 1624.493789)),
    ((-170, -20, -60, 300, -115, 345), (-1226.000741, 663.597648, 2114.755162)),
    ((5, -95, 100, 10, -80, -5), (1611.261297, -42.850623, 2091.051388)),
]

each_robot = pytest.mark.parametrize("geometry", GEOMETRIES.values(), ids=GEOMETRIES.keys())
angles = st.lists(st.floats(-3.25, 3.25, width=32), min_size=6, max_size=6)
robots = st.sampled_from(list(GEOMETRIES.values()))


def random_angles(n: int, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).uniform(-math.pi, math.pi, (n, 6))


def translation(x: float, y: float, z: float) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def turn(axis: str, angle_rad: float) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler(axis, angle_rad).as_matrix()
    return matrix


def spelled_out(q: FloatArray, geometry: FloatArray) -> FloatArray:
    """Eq. 1, factor by factor."""
    a1, a2, c1, c2, c3, c4 = geometry
    factors = [
        turn("z", -q[0]),
        translation(a1, 0, c1),
        turn("y", q[1]),
        translation(c2, 0, 0),
        turn("y", q[2]),
        translation(c3, 0, -a2),
        turn("x", -q[3]),
        turn("y", q[4]),
        turn("x", -q[5]),
        translation(c4, 0, 0),
        turn("y", math.pi / 2),
    ]
    return np.asarray(np.linalg.multi_dot(factors))


def wrapped(angle_rad: FloatArray) -> FloatArray:
    return (angle_rad + math.pi) % (2 * math.pi) - math.pi


def margins(q: FloatArray, geometry: FloatArray) -> FloatArray:
    """How far a row is from the three singularities: wrist, elbow, and shoulder by the length of the arm."""
    a1, a2, _, c2, c3, _ = geometry
    elbow = q[:, 2] + math.atan2(a2, c3)
    radius = a1 + c2 * np.cos(q[:, 1]) + math.hypot(a2, c3) * np.cos(q[:, 1] + elbow)
    wrist, bend, shoulder = np.sin(q[:, 4]), np.sin(elbow), radius / (c2 + c3)
    return np.asarray(np.min(np.abs([wrist, bend, shoulder]), axis=0))


def assert_same_pose(q: FloatArray, position: FloatArray, rotation: FloatArray, geometry: FloatArray) -> None:
    position_again, rotation_again = flange_pose(q, geometry)
    np.testing.assert_allclose(position_again, position, rtol=0, atol=2e-8)
    np.testing.assert_allclose(rotation_again, rotation, rtol=0, atol=1e-10)


class TestFlangePose:
    @each_robot
    def test_is_the_product_of_its_factors(self, geometry: FloatArray) -> None:
        q = random_angles(200) * 2
        position, rotation = flange_pose(q, geometry)
        wanted = np.array([spelled_out(row, geometry) for row in q])
        np.testing.assert_allclose(position, wanted[:, :3, 3], rtol=0, atol=1e-9)
        np.testing.assert_allclose(rotation, wanted[:, :3, :3], rtol=0, atol=1e-14)

    def test_home(self) -> None:
        position, rotation = flange_pose(HOME_RAD[None], KR300)
        np.testing.assert_allclose(position[0], [1590, 0, 1784], rtol=0, atol=1e-9)
        np.testing.assert_allclose(rotation[0, :, 2], [1, 0, 0], rtol=0, atol=1e-15)

    @pytest.mark.parametrize(("q_deg", "tcp_mm"), TCP_VECTORS)
    def test_reference_vectors(self, q_deg: tuple[float, ...], tcp_mm: tuple[float, ...]) -> None:
        position, rotation = flange_pose(np.radians([q_deg]), KR300)
        np.testing.assert_allclose(position[0] + rotation[0] @ TOOL_MM, tcp_mm, rtol=0, atol=1e-6)

    def test_takes_read_only_and_strided_input(self) -> None:
        q = random_angles(4)
        wanted, _ = flange_pose(q, KR300)
        q_fortran = np.asfortranarray(q)
        q_fortran.flags.writeable = False
        np.testing.assert_array_equal(flange_pose(q_fortran, KR300.tolist())[0], wanted)
        assert q.flags.writeable

    def test_no_rows(self) -> None:
        position, rotation = flange_pose(np.empty((0, 6)), KR300)
        assert position.shape == (0, 3)
        assert rotation.shape == (0, 3, 3)

    def test_wrong_shape(self) -> None:
        with pytest.raises(ValueError, match=r"q_rad has shape \(6,\), not \(n, 6\)"):
            flange_pose(HOME_RAD, KR300)
        with pytest.raises(ValueError, match="geometry"):
            flange_pose(HOME_RAD[None], KR300[:5])


class TestAllBranches:
    @each_robot
    def test_independent_solver(self, geometry: FloatArray) -> None:
        n = 3_000
        position, rotation = flange_pose(random_angles(n, seed=1), geometry)
        mine = all_branches(position, rotation, geometry)
        solver = opw_solver(geometry, degrees=False)
        poses = RigidTransform.from_components(position, Rotation.from_matrix(rotation))
        compared = 0
        for i in range(n):
            q = mine[i][~np.isnan(mine[i, :, 0])]
            if margins(q, geometry).min() < 1e-3:  # ill-conditioned in one of the two formulations
                continue
            theirs = np.array(solver.inverse(poses[i]))
            assert len(theirs) == len(q), i
            distance = abs(wrapped(q[:, None] - theirs[None])).max(axis=2)
            assert distance.min(axis=1).max() < 1e-9, i
            assert sorted(distance.argmin(axis=1)) == list(range(len(q))), i
            compared += len(q)
        assert compared > 5 * n

    @each_robot
    def test_forward_of_inverse_and_branch_is_status(self, geometry: FloatArray) -> None:
        given_q = random_angles(8_000, seed=2)
        position, rotation = flange_pose(given_q, geometry)
        q = all_branches(position, rotation, geometry)
        assert (np.isnan(q).any(axis=2) == np.isnan(q).all(axis=2)).all()
        row, branch = np.nonzero(~np.isnan(q[:, :, 0]))
        found = q[row, branch]
        assert (found > -math.pi).all()
        assert (found <= math.pi).all()
        assert_same_pose(found, position[row], rotation[row], geometry)
        regular = margins(found, geometry) > 1e-6
        np.testing.assert_array_equal(status_turn(found[regular], geometry)[0], branch[regular])
        status, _ = status_turn(given_q, geometry)
        regular = margins(given_q, geometry) > 1e-3
        mine = q[np.arange(len(q)), status][regular]
        np.testing.assert_allclose(wrapped(mine - given_q[regular]), 0, rtol=0, atol=1e-9)

    def test_out_of_reach(self) -> None:
        position = np.array([[4000.0, 0, 1000], [1590, 0, 1784], [590, 0, 675], [math.nan, 0, 0]])
        rotation = np.repeat(flange_pose(HOME_RAD[None], KR300)[1], 4, axis=0)
        q = all_branches(position, rotation, KR300)
        assert np.isnan(q[[0, 3]]).all()
        assert np.isfinite(q[1]).all()
        assert np.isnan(q[2, [0, 2, 4, 6]]).all()  # wrist centre on axis 2: only overhead reaches it
        assert np.isfinite(q[2, [1, 3, 5, 7]]).all()

    def test_stretched_arm_is_reached_and_a_micrometre_more_is_not(self) -> None:
        phi_rad = -math.atan2(41.0, 1000.0)
        q = np.array([[0.3, -0.8, phi_rad, 0.4, 0.9, -0.2]])
        position, rotation = flange_pose(q, KR300)
        found = all_branches(position, rotation, KR300)[0, [0, 2, 4, 6]]
        assert np.isfinite(found).all()
        assert_same_pose(found, position.repeat(4, 0), rotation.repeat(4, 0), KR300)
        outwards = np.array(
            [math.cos(-0.8) * math.cos(0.3), -math.cos(-0.8) * math.sin(0.3), -math.sin(-0.8)]
        )
        assert np.isnan(all_branches(position + 1e-3 * outwards, rotation, KR300)[0, [0, 2, 4, 6]]).all()

    @pytest.mark.parametrize("a5_rad", [0.0, 1e-15, 1e-12, 1e-9, 1e-8, 1e-6, 1e-4, -1e-15, -1e-8, -1e-5])
    def test_pose_is_exact_near_the_wrist_singularity(self, a5_rad: float) -> None:
        q = random_angles(500, seed=3)
        q[:, 4] = a5_rad
        position, rotation = flange_pose(q, KR300)
        found = all_branches(position, rotation, KR300)
        ok = np.isfinite(found[:, :, 0])
        position_again, rotation_again = flange_pose(found[ok], KR300)
        row = np.nonzero(ok)[0]
        np.testing.assert_allclose(rotation_again, rotation[row], rtol=0, atol=2e-9)
        np.testing.assert_allclose(position_again, position[row], rtol=0, atol=1e-6)
        if abs(a5_rad) > 1e-8:  # exact, not merely within the tolerance that holds A4
            np.testing.assert_allclose(rotation_again, rotation[row], rtol=0, atol=1e-13)

    def test_exact_wrist_singularity(self) -> None:
        q = np.array([[0.2, -1.2, 1.4, 0.7, 0.0, 0.5]])
        found = all_branches(*flange_pose(q, KR300), KR300)[0]
        np.testing.assert_allclose(found[[2, 6]], [[0.2, -1.2, 1.4, 0.0, 0.0, 1.2]] * 2, rtol=0, atol=1e-12)
        assert (found[[2, 6], 4] == 0.0).all()

    def test_wrist_centre_on_axis_1(self) -> None:
        a1, a2, _, c2, c3, _ = KR300
        a2_rad = -2.0  # the triangle closes on axis 1 for some elbow
        cos_forearm = (-a1 - c2 * math.cos(a2_rad)) / math.hypot(a2, c3)
        a3_rad = -a2_rad - math.atan2(a2, c3) - math.acos(cos_forearm)
        q = np.array([[0.4, a2_rad, a3_rad, 0.3, 0.8, -0.6]])
        position, rotation = flange_pose(q, KR300)
        found = all_branches(position, rotation, KR300)[0]
        assert np.isfinite(found).all()
        assert_same_pose(found, position.repeat(8, 0), rotation.repeat(8, 0), KR300)
        status = int(status_turn(q, KR300)[0][0])
        np.testing.assert_allclose(one_branch(position, rotation, KR300, status, q[0]), q, rtol=0, atol=1e-9)

    def test_wrong_shape(self) -> None:
        with pytest.raises(ValueError, match="rotation"):
            all_branches(np.zeros((2, 3)), np.zeros((1, 3, 3)), KR300)

    @settings(max_examples=300, deadline=None)
    @given(angles, robots)
    def test_every_finite_branch_reaches_the_pose(self, q: list[float], geometry: FloatArray) -> None:
        position, rotation = flange_pose([q], geometry)
        found = all_branches(position, rotation, geometry)[0]
        found = found[np.isfinite(found[:, 0])]
        assert len(found) >= 2
        position_again, rotation_again = flange_pose(found, geometry)
        np.testing.assert_allclose(position_again, position.repeat(len(found), 0), rtol=0, atol=1e-6)
        np.testing.assert_allclose(rotation_again, rotation.repeat(len(found), 0), rtol=0, atol=2e-9)


class TestOneBranch:
    @each_robot
    def test_is_that_of_all_branches(self, geometry: FloatArray) -> None:
        position, rotation = flange_pose(random_angles(3000, seed=4), geometry)
        every = all_branches(position, rotation, geometry)
        for branch in range(8):
            q = one_branch(position, rotation, geometry, branch, np.zeros(6))
            reached = np.isfinite(every[:, branch, 0])
            np.testing.assert_array_equal(np.isnan(q), np.isnan(every[:, branch]))
            kept = q[reached]
            np.testing.assert_allclose(wrapped(kept - every[reached, branch]), 0, rtol=0, atol=1e-12)
            assert abs(np.diff(kept, axis=0)).max() <= math.pi + 1e-9

    def test_winds_on(self) -> None:
        s = np.linspace(0.0, 1.0, 2001)[:, None]
        q = np.radians([10.0, -80, 100, -340, 40, -340]) + s * np.radians([30.0, 10, -20, 700, 20, 690])
        position, rotation = flange_pose(q, KR300)
        np.testing.assert_allclose(one_branch(position, rotation, KR300, 2, q[0]), q, rtol=0, atol=1e-11)
        one_turn_on = one_branch(position, rotation, KR300, 2, q[0] + np.radians([0, 0, 0, 360, 0, -360]))
        np.testing.assert_allclose(
            one_turn_on - q, np.radians([[0, 0, 0, 360, 0, -360]] * len(q)), atol=1e-11
        )

    def test_first_row_is_nearest_to_the_reference(self) -> None:
        q = np.radians([[20.0, -80, 100, 170, 40, -170]])
        pose = flange_pose(q, KR300)
        reference = np.radians([0.0, -90, 90, -20, 30, 30])
        found = np.degrees(one_branch(*pose, KR300, 2, reference))
        np.testing.assert_allclose(found, [[20, -80, 100, -190, 40, 190]], rtol=0, atol=1e-9)

    def test_axis_4_stays_through_the_wrist_singularity(self) -> None:
        a5 = np.concatenate([np.linspace(0.3, 0.1, 5), np.zeros(4)])
        q = np.stack([0 * a5, 0 * a5 - 1.3, 0 * a5 + 1.5, 0 * a5 + 0.8, a5, np.linspace(0, 0.4, 9)], axis=1)
        found = one_branch(*flange_pose(q, KR300), KR300, 2, q[0])
        np.testing.assert_allclose(found, q, rtol=0, atol=1e-12)
        assert (found[5:, 4] == 0.0).all()

    def test_home_keeps_the_reference_where_it_is_free(self) -> None:
        pose = flange_pose(HOME_RAD[None], KR300)
        np.testing.assert_allclose(one_branch(*pose, KR300, 2, HOME_RAD), HOME_RAD[None], rtol=0, atol=1e-14)
        found = one_branch(*pose, KR300, 2, HOME_RAD + np.radians([0, 0, 0, 200, 0, 0]))
        np.testing.assert_allclose(np.degrees(found), [[0, -90, 90, 200, 0, 160]], rtol=0, atol=1e-10)

    def test_rows_out_of_reach_do_not_break_the_winding(self) -> None:
        q = np.tile(np.radians([0.0, -80, 100, 0, 40, 0]), (40, 1))
        q[:, 5] = np.linspace(0, 6, 40)
        position, rotation = flange_pose(q, KR300)
        position[18:21] += 5000.0
        position[0] = math.nan
        rotation[30, 0, 0] = math.nan
        found = one_branch(position, rotation, KR300, 2, q[0])
        out = [0, 18, 19, 20, 30]
        assert np.isnan(found[out]).all()
        np.testing.assert_allclose(np.delete(found, out, 0), np.delete(q, out, 0), rtol=0, atol=1e-11)

    def test_bad_arguments(self) -> None:
        pose = flange_pose(HOME_RAD[None], KR300)
        for branch in (-1, 8):
            with pytest.raises(ValueError, match="not 0 to 7"):
                one_branch(*pose, KR300, branch, HOME_RAD)
        with pytest.raises(ValueError, match="not finite"):
            one_branch(*pose, KR300, 2, np.full(6, math.nan))

    @settings(max_examples=200, deadline=None)
    @given(angles, angles, robots)
    def test_is_within_half_a_turn_of_the_reference(
        self, q: list[float], reference: list[float], geometry: FloatArray
    ) -> None:
        pose = flange_pose([q], geometry)
        branch = int(status_turn([q], geometry)[0][0])
        found = one_branch(*pose, geometry, branch, 3.0 * np.array(reference))
        if np.isfinite(found).all():
            assert abs(found - 3.0 * np.array(reference)).max() <= math.pi + 1e-9
            np.testing.assert_allclose(flange_pose(found, geometry)[0], pose[0], rtol=0, atol=1e-6)
        else:  # on the border between two branches rounding may choose the neighbour
            assert margins(np.array([q]), geometry)[0] < 1e-6


class TestStatusTurn:
    @pytest.mark.parametrize(
        ("q_deg", "status", "turn_bits"),
        [
            ((0, -90, 90, 0, 0, 0), 0b010, 0b000010),
            ((0, -90, 90, 0, -30, 0), 0b110, 0b010010),
            ((0, -90, 90, -10, 30, -5), 0b010, 0b101010),
            ((0, -140, 60, 0, 30, 0), 0b011, 0b000010),
            ((-20, -140, -30, 0, 30, 0), 0b001, 0b000111),
            ((10, -60, -3, 0, 30, 0), 0b000, 0b000110),
            ((10, -60, -2, 0, 30, 0), 0b010, 0b000110),  # phi is -2.35 degrees
            ((-185, -60, 40, 200, 30, -350), 0b010, 0b100011),
        ],
    )
    def test_known_poses(self, q_deg: tuple[float, ...], status: int, turn_bits: int) -> None:
        found_status, found_turn = status_turn(np.radians([q_deg]), KR300)
        assert (found_status[0], found_turn[0]) == (status, turn_bits)
        assert found_status.dtype == found_turn.dtype == np.int32

    def test_full_turns_change_the_turn_bits_only(self) -> None:
        q = random_angles(500, seed=5)
        status, _ = status_turn(q, KR300)
        status_on, turn_on = status_turn(q - 2 * math.pi, KR300)
        np.testing.assert_array_equal(status_on, status)
        assert (turn_on == 63).all()


class TestJacobian:
    @each_robot
    @pytest.mark.parametrize("tool_mm", [(0.0, 0.0, 0.0), (250.0, -30.0, 250.0)])
    def test_central_differences(self, geometry: FloatArray, tool_mm: tuple[float, float, float]) -> None:
        q = random_angles(200, seed=6)
        tool, step = np.array(tool_mm), 1e-5
        numeric = np.empty((len(q), 6, 6))
        _, middle = flange_pose(q, geometry)
        for j in range(6):
            (p_plus, r_plus), (p_minus, r_minus) = (
                flange_pose(q + sign * step * np.eye(6)[j], geometry) for sign in (1, -1)
            )
            numeric[:, :3, j] = (p_plus + r_plus @ tool - p_minus - r_minus @ tool) / (2 * step)
            spin = (r_plus - r_minus) / (2 * step) @ middle.transpose(0, 2, 1)
            numeric[:, 3:, j] = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        found = jacobian(q, geometry, tool)
        np.testing.assert_allclose(found[:, :3], numeric[:, :3], rtol=0, atol=1e-5)
        np.testing.assert_allclose(found[:, 3:], numeric[:, 3:], rtol=0, atol=1e-8)

    @each_robot
    def test_smallest_singular_value(self, geometry: FloatArray) -> None:
        q = random_angles(2000, seed=7)
        q[:50, 4] = 0.0
        q[30:100, 2] = -math.atan2(geometry[1], geometry[4])
        q[99] = 0.0
        columns = jacobian(q, geometry, TOOL_MM)
        columns[:, :3] /= geometry[3] + math.hypot(geometry[4], geometry[1])
        found = smallest_singular_value(q, geometry, TOOL_MM)
        np.testing.assert_allclose(found, np.linalg.svd(columns, compute_uv=False)[:, -1], rtol=0, atol=1e-7)
        assert found[:99].max() < 1e-7

    def test_smallest_singular_value_has_no_size_and_no_axis_1(self) -> None:
        q = random_angles(100, seed=8)
        found = smallest_singular_value(q, KR300, TOOL_MM)
        q[:, 0] += 1.0
        np.testing.assert_allclose(smallest_singular_value(q, KR300 / 4, TOOL_MM / 4), found, atol=1e-7)

    def test_nan(self) -> None:
        q = np.tile(HOME_RAD, (2, 1))
        q[0, 3] = math.nan
        found = smallest_singular_value(q, KR300, TOOL_MM)
        assert np.isnan(found[0])
        assert np.isfinite(found[1])

    @settings(max_examples=100, deadline=None)
    @given(angles, robots)
    def test_smallest_singular_value_never_exceeds_a_gain(self, q: list[float], geometry: FloatArray) -> None:
        scaled = jacobian([q], geometry, TOOL_MM)[0]
        scaled[:3] /= geometry[3] + math.hypot(geometry[4], geometry[1])
        gain = np.linalg.norm(scaled, axis=0).min()
        assert 0.0 <= smallest_singular_value([q], geometry, TOOL_MM)[0] <= gain + 1e-7
