"""Displacement of the tip under load: against an independent formulation, reference vectors, properties."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import frames as fr
from gcode2krl.cell import resolve_cell
from gcode2krl.compiled.core import FLOATS, OUT_FLOATS, core_function
from gcode2krl.compliance import displace, missing_stiffness, project_normal, tip_position
from gcode2krl.errors import NotUnderstoodError
from tests.compliance import independent
from tests.compliance.loads import (
    HOME,
    NONE,
    OTHER_GEOMETRY,
    OTHER_STIFFNESS,
    other_cell,
    poses,
    random_load,
    vectors,
)

# Joints in degrees, force in N and moment in N·mm at the tip; tip and displacement in mm, rotation vector in
# rad; all along the robot root. From an independent implementation of the frames in docs/compliance.md.
# fmt: off
VECTORS = [
    ((0, -90, 90, 0, 0, 0), (750, 0, 0), (0, 0, 0),
     (1840.000000, 0.000000, 1534.000000),
     (1.0299595, 0.0000000, 0.5539167), (0.0000000000, -0.0033029372, 0.0000000000)),
    ((0, -90, 90, 0, 0, 0), (0, 750, 0), (0, 0, 0),
     (1840.000000, 0.000000, 1534.000000),
     (-0.0017850, 2.3703725, 0.0011737), (0.0026448308, 0.0000006662, 0.0021278786)),
    ((0, -90, 90, 0, 0, 0), (0, 0, -750), (0, 0, 0),
     (1840.000000, 0.000000, 1534.000000),
     (-0.5545488, 0.0000000, -1.9160406), (0.0000000000, 0.0038345156, 0.0000000000)),
    ((0, -90, 90, 0, 0, 0), (0, 0, 0), (50000, -30000, 80000),
     (1840.000000, 0.000000, 1534.000000),
     (0.1319952, 0.4032532, 0.1535758), (0.0007868485, -0.0005695733, 0.0006796847)),
    ((30, -75, 110, 20, -40, 60), (546, 0, 0), (0, 0, 0),
     (1648.065793, -1099.861447, 1146.663641),
     (1.2522154, 0.8079855, 0.1438217), (-0.0002003866, -0.0005849354, 0.0031898487)),
    ((-45, -110, 70, -100, 65, 170), (-120, 431, -117), (0, 0, 4703),
     (513.185129, 997.431384, 2656.047628),
     (-0.7854401, 1.2865177, -0.7590640), (-0.0018422978, -0.0003890486, 0.0017698653)),
    ((12.5, -60.25, 95.75, 33.3, 88.8, -140.1), (300, -500, 200), (10000, 20000, -15000),
     (1522.086716, -473.385906, 539.750432),
     (0.4179607, -1.2679192, 0.2716187), (-0.0023150061, -0.0010919181, -0.0007913010)),
    ((90, -120, 130, 180, 30, -90), (0, 0, -1000), (0, 0, 0),
     (-250.000000, -1213.137562, 1624.493789),
     (-0.4323871, -0.4321928, -2.5558832), (0.0028879851, -0.0040183711, -0.0003031940)),
    ((-170, -20, -60, 300, -115, 345), (1000, 1000, 1000), (-40000, 5000, 60000),
     (-1226.000741, 663.597648, 2114.755162),
     (1.5018462, 1.4222091, 0.7955368), (-0.0004940767, 0.0000638872, 0.0001221717)),
    ((5, -95, 100, 10, -80, -5), (30000, -20000, 10000), (2e6, -1e6, 3e6),
     (1611.261297, -42.850623, 2091.051388),
     (15.5368311, -60.5214325, -12.8046411), (0.0627001160, 0.0166684986, -0.0609279093)),
]
# fmt: on
class TestDisplace:
    @pytest.mark.parametrize(("q_deg", "force", "moment", "tip", "shift", "turn"), VECTORS)
    def test_reference_vectors(self, cell, q_deg, force, moment, tip, shift, turn):
        q = np.radians([q_deg])
        found_shift, found_turn = displace(q, [force], [moment], cell)
        np.testing.assert_allclose(found_shift, [shift], rtol=0, atol=1e-6)
        np.testing.assert_allclose(found_turn, [turn], rtol=0, atol=1e-8)
        np.testing.assert_allclose(tip_position(q, cell), [tip], rtol=0, atol=1e-6)

    def test_product_of_exponentials(self, cell):
        q, force, moment = random_load(10_000, seed=0)
        shift, turn = displace(q, force, moment, cell)
        tip, wanted_shift, wanted_turn = independent.displaced(q, force, moment)
        np.testing.assert_allclose(shift, wanted_shift, rtol=0, atol=1e-9)
        np.testing.assert_allclose(turn, wanted_turn, rtol=0, atol=1e-12)
        np.testing.assert_allclose(tip_position(q, cell), tip, rtol=0, atol=1e-9)

    def test_product_of_exponentials_under_absurd_loads(self, cell):
        q, force, moment = random_load(500, seed=1, force_N=60_000.0, moment_Nmm=1e7)
        shift, turn = displace(q, force, moment, cell)
        _, wanted_shift, wanted_turn = independent.displaced(q, force, moment)
        assert np.linalg.norm(wanted_turn, axis=1).max() > 0.5
        np.testing.assert_allclose(shift, wanted_shift, rtol=0, atol=1e-8)
        np.testing.assert_allclose(turn, wanted_turn, rtol=0, atol=1e-11)

    def test_another_robot_and_end_effector(self):
        q, force, moment = random_load(1000, seed=2)
        shift, turn = displace(q, force, moment, other_cell())
        tool = other_cell().tool_matrix(1)[:3, 3]
        tip, wanted_shift, wanted_turn = independent.displaced(
            q, force, moment, OTHER_STIFFNESS, OTHER_GEOMETRY, tool, sensor_mm=90.0
        )
        np.testing.assert_allclose(shift, wanted_shift, rtol=0, atol=1e-9)
        np.testing.assert_allclose(turn, wanted_turn, rtol=0, atol=1e-12)
        np.testing.assert_allclose(tip_position(q, other_cell()), tip, rtol=0, atol=1e-9)

    def test_a_tool_a_row(self, cell):
        longer = {"diameter_mm": 10.0, "teeth": 2, "length_mm": 180.0}
        two_tools = resolve_cell({"based_on": "demonstration", "tool": {"7": longer}})
        q, force, moment = random_load(50, seed=3)
        tools = np.where(np.arange(50) % 3 == 0, 7, 1)
        shift, turn = displace(q, force, moment, two_tools, tool=tools)
        for number in (1, 7):
            rows = tools == number
            alone = displace(q[rows], force[rows], moment[rows], two_tools, tool=number)
            np.testing.assert_array_equal(shift[rows], alone[0])
            np.testing.assert_array_equal(turn[rows], alone[1])
            tip = two_tools.tool_matrix(number)[:3, 3]
            wanted = independent.displaced(q[rows], force[rows], moment[rows], tool=tip)[1]
            np.testing.assert_allclose(shift[rows], wanted, rtol=0, atol=1e-9)
        by_default = displace(q, force, moment, two_tools)[0]
        np.testing.assert_array_equal(by_default, displace(q, force, moment, cell, tool=1)[0])

    def test_any_number_of_threads_and_any_cut_gives_the_same_bits(self, cell):
        q, force, moment = random_load(45_001, seed=4)
        one = displace(q, force, moment, cell, threads=1)
        for threads in (2, 3):
            for wanted, found in zip(one, displace(q, force, moment, cell, threads=threads), strict=True):
                np.testing.assert_array_equal(found, wanted)
        for rows in (slice(0, 1), slice(20_123, 20_136), slice(44_000, None)):
            part = displace(q[rows], force[rows], moment[rows], cell)
            np.testing.assert_array_equal(part[0], one[0][rows])
            np.testing.assert_array_equal(part[1], one[1][rows])

    def test_whole_turns_change_nothing(self, cell):
        q, force, moment = random_load(100, seed=5)
        turned = q + 2 * math.pi * np.array([1, -1, 2, 3, -2, -5])
        np.testing.assert_allclose(
            displace(turned, force, moment, cell)[0],
            displace(q, force, moment, cell)[0],
            rtol=0,
            atol=1e-12,
        )

    def test_rows_out_of_reach_are_nan_and_leave_others_alone(self, cell):
        q, force, moment = random_load(10, seed=6)
        wanted = displace(q, force, moment, cell)[0]
        q[4] = math.nan
        found = displace(q, force, moment, cell)[0]
        assert np.isnan(found[4]).all()
        np.testing.assert_array_equal(np.delete(found, 4, axis=0), np.delete(wanted, 4, axis=0))

    def test_no_rows(self, cell):
        shift, turn = displace(np.empty((0, 6)), np.empty((0, 3)), np.empty((0, 3)), cell)
        assert shift.shape == turn.shape == (0, 3)

    def test_wrong_shapes(self, cell):
        with pytest.raises(ValueError, match=r"q_rad has shape \(6,\), not \(n, 6\)"):
            displace(HOME[0], NONE, NONE, cell)
        with pytest.raises(ValueError, match=r"force has shape \(2, 3\), not \(1, 3\)"):
            displace(HOME, np.zeros((2, 3)), NONE, cell)
        with pytest.raises(ValueError, match=r"tool has shape \(2,\)"):
            displace(HOME, NONE, NONE, cell, tool=[1, 1])

    def test_missing_stiffness_is_refused_by_name(self, cell):
        assert missing_stiffness(cell) is None
        lengths = cell.robot.geometry.model_dump(
            include={"a1_mm", "a2_mm", "c1_mm", "c2_mm", "c3_mm", "c4_mm"}
        )
        without = resolve_cell({"based_on": "demonstration", "robot": {"geometry": lengths}})
        with pytest.raises(NotUnderstoodError, match=r"A1, A2, linked_arm, A3, arm, A4, A5, A6") as error:
            displace(HOME, NONE, NONE, without)
        assert "sensor" not in str(error.value)
        assert "robot.payload" in error.value.issues[0].remedy
        assert error.value.issues == (missing_stiffness(without),)
        assert np.isfinite(tip_position(HOME, without)).all()

    def test_unknown_tool(self, cell):
        with pytest.raises(NotUnderstoodError, match="tool 99 is not in the cell"):
            displace(HOME, NONE, NONE, cell, tool=99)


class TestPhysics:
    @settings(max_examples=100, deadline=None)
    @given(poses)
    def test_no_load_no_displacement(self, cell, q):
        shift, turn = displace([q], NONE, NONE, cell)
        assert not shift.any()
        assert not turn.any()

    @settings(max_examples=100, deadline=None)
    @given(poses, vectors, vectors, st.sampled_from([1.0, 0.1, 0.01]))
    def test_small_loads_are_linear(self, cell, q, force, moment, share):
        load = share * np.hstack([200 * np.array(force), 10_000 * np.array(moment)])
        found = np.hstack(displace([q], load[:3], load[3:], cell))[0]
        # angles sum up to some 5 mrad and the tip moves by up to 2 mm: second order is their product
        linear = compliance(cell, q) @ load
        np.testing.assert_allclose(found[:3], linear[:3], rtol=0, atol=2e-2 * share**2 + 1e-9)
        np.testing.assert_allclose(found[3:], linear[3:], rtol=0, atol=5e-5 * share**2 + 1e-12)

    @settings(max_examples=100, deadline=None)
    @given(poses)
    def test_maxwell_symmetry(self, cell, q):
        matrix = compliance(cell, q)
        size = np.sqrt(np.diag(matrix))
        matrix = matrix / np.outer(size, size)
        np.testing.assert_allclose(matrix, matrix.T, rtol=0, atol=1e-7)
        assert np.linalg.eigvalsh(matrix).min() > 0

    @settings(max_examples=100, deadline=None)
    @given(poses, vectors, st.floats(-3.0, 3.0))
    def test_turning_axis_1_turns_everything(self, cell, q, force, angle):
        force = 800 * np.array([force])
        about_z = fr.rotation_from_abc([angle, 0, 0])
        shift, turn = displace([q], force, NONE, cell)
        turned_q = np.array([q]) - [[angle, 0, 0, 0, 0, 0]]
        shift_again, turn_again = displace(turned_q, force @ about_z.T, NONE, cell)
        np.testing.assert_allclose(shift_again, shift @ about_z.T, rtol=0, atol=1e-11)
        np.testing.assert_allclose(turn_again, turn @ about_z.T, rtol=0, atol=1e-14)

    @settings(max_examples=50, deadline=None)
    @given(poses, vectors)
    def test_doubled_stiffness_halves_the_displacement(self, cell, q, force):
        joints = {
            name: {"k_c": 2 * k.k_c, "k_b": 2 * k.k_b, "k_a": 2 * k.k_a}
            for name, k in cell.compliance.virtual_joints.items()
        }
        stiffer = resolve_cell({"based_on": "demonstration", "compliance": {"virtual_joints": joints}})
        np.testing.assert_allclose(
            displace([q], 2000 * np.array(force), NONE, stiffer)[0],
            displace([q], 1000 * np.array(force), NONE, cell)[0],
            rtol=0,
            atol=1e-12,
        )


def compliance(cell, q):
    """Return the compliance (6, 6), displacement and rotation by force and moment, by central differences."""
    loads = np.diag([1.0, 1.0, 1.0, 100.0, 100.0, 100.0])
    poses = np.repeat([q], 6, axis=0)
    plus, minus = (
        np.hstack(displace(poses, sign * loads[:, :3], sign * loads[:, 3:], cell)) for sign in (1, -1)
    )
    return (plus - minus).T / 2 / np.diag(loads)


class TestSinCos:
    @pytest.mark.parametrize("reach", [1e-8, 1.0, 10.0, 1e5])
    def test_any_quadrant(self, reach):
        self.agrees("compliance_sin_cos", np.random.default_rng(19).uniform(-reach, reach, 3000), 3e-16)

    @pytest.mark.parametrize("quarters", range(-9, 10))
    def test_borders_of_the_quadrants(self, quarters):
        border = quarters * math.pi / 4
        self.agrees("compliance_sin_cos", np.array([border, np.nextafter(border, 100.0)]), 3e-16)

    def test_series_up_to_a_quarter_turn(self):
        for angle, tolerance in ((math.pi / 4, 3e-16), (-1.0, 1e-14), (math.pi / 2, 1e-11)):
            self.agrees("compliance_sin_cos_near_zero", np.array([angle]), tolerance)

    def agrees(self, function, angles, tolerance):
        sine, cosine = np.full_like(angles, np.nan), np.full_like(angles, np.nan)
        core_function(function, FLOATS, OUT_FLOATS, OUT_FLOATS)(angles, sine, cosine)
        for angle, s, c in zip(angles, sine, cosine, strict=True):
            assert abs(s - math.sin(angle)) < tolerance
            assert abs(c - math.cos(angle)) < tolerance


finite = st.floats(-1e6, 1e6, allow_subnormal=True)
feeds = st.lists(
    st.one_of(st.floats(-1e150, 1e150, allow_subnormal=True), st.just(0.0)), min_size=3, max_size=3
)


def test_is_the_projector_of_the_plane():
    random = np.random.default_rng(0)
    r, v = random.normal(size=(1000, 3)), random.normal(size=(1000, 3))
    for k in range(1000):
        projector = np.eye(3) - np.outer(v[k], v[k]) / np.dot(v[k], v[k])
        np.testing.assert_allclose(project_normal(r[k : k + 1], v[k]), [projector @ r[k]], rtol=0, atol=1e-14)
    np.testing.assert_allclose(project_normal(r, v)[17], project_normal(r[17:18], v[17])[0], rtol=0, atol=0)


def test_by_hand():
    r = np.array([[1.0, 2.0, 3.0]] * 3)
    v = [[25.0, 0.0, 0.0], [0.0, 0.0, -0.001], [1.0, 1.0, 0.0]]
    np.testing.assert_allclose(project_normal(r, v), [[0, 2, 3], [1, 2, 0], [-0.5, 0.5, 3]], atol=1e-15)


def test_a_standstill_leaves_rows_as_they_are():
    r = np.array([[1.0, -2.0, 3.0], [1.0, -2.0, 3.0]])
    found = project_normal(r, [[0.0, 0.0, 0.0], [0.0, 1.0, -0.0]])
    np.testing.assert_array_equal(found, [[1, -2, 3], [1, 0, 3]])
    np.testing.assert_array_equal(project_normal(r, np.zeros(3)), r)


@pytest.mark.parametrize("size", [5e-324, 1e-310, 2.3e-308, 1e-200, 1e-160, 1.0, 1e160, 1.7e308])
def test_the_length_of_the_feed_does_not_matter(size):
    found = project_normal([[1.0, 2.0, 3.0]], [[size, 0.0, -size]])
    np.testing.assert_allclose(found, [[2.0, 2.0, 2.0]], rtol=1e-15)


@settings(max_examples=300, deadline=None)
@given(st.lists(finite, min_size=3, max_size=3), feeds)
def test_properties(r, v):
    """Normal to v, never longer than r, unchanged by a second projection, never NaN."""
    r = np.array([r])
    once = project_normal(r, v)
    rounding = 1e-14 * np.abs(r).max() + 1e-300  # norms underflow below
    assert np.isfinite(once).all()
    assert np.linalg.norm(once) <= np.linalg.norm(r) + rounding
    largest = np.abs(v).max()
    if largest > 0:
        direction = np.array(v) / largest
        assert abs(once @ direction)[0] <= rounding
        np.testing.assert_allclose(project_normal(once, v), once, rtol=0, atol=rounding)
    else:
        np.testing.assert_array_equal(once, r)


def test_wrong_shapes():
    with pytest.raises(ValueError, match=r"r has shape \(3,\), not \(n, 3\)"):
        project_normal([1.0, 2.0, 3.0], [1.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"v has shape \(2, 3\), not \(3, 3\)"):
        project_normal(np.zeros((3, 3)), np.zeros((2, 3)))


def test_inputs_stay_as_they_were():
    r, v = np.ones((2, 3)), np.ones((2, 3))
    result = project_normal(r, v)
    assert r.flags.writeable
    result += 1.0
    assert (r == 1).all()
    assert (v == 1).all()
