"""Rotations against scipy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gcode2krl import frames

RANDOM = np.random.default_rng(7)
angles = st.floats(-np.pi, np.pi)


def test_abc_and_quaternions_agree_with_scipy():
    abc = RANDOM.uniform(-np.pi, np.pi, (500, 3))
    expected = Rotation.from_euler("ZYX", abc)
    rotation = frames.rotation_from_abc(abc)
    np.testing.assert_allclose(rotation, expected.as_matrix(), atol=1e-14)
    quaternion = frames.quaternion_from_rotation(rotation)
    wanted = expected.as_quat()
    wanted *= np.sign(wanted[:, 3:4])
    np.testing.assert_allclose(quaternion, wanted, atol=1e-12)
    np.testing.assert_allclose(frames.rotation_from_quaternion(quaternion), rotation, atol=1e-13)


@given(angles, angles, angles)
def test_abc_round_trip(a, b, c):
    rotation = frames.rotation_from_abc([a, b, c])
    np.testing.assert_allclose(
        frames.rotation_from_abc(frames.abc_from_rotation(rotation)), rotation, atol=1e-8
    )


@given(angles, angles)
def test_at_ninety_degrees_c_is_zero(a, c):
    rotation = frames.rotation_from_abc([a, np.pi / 2, c])
    abc = frames.abc_from_rotation(rotation)
    assert abc[2] == 0.0
    np.testing.assert_allclose(frames.rotation_from_abc(abc), rotation, atol=1e-9)


def test_half_turns_have_unit_quaternions():
    for axis in np.eye(3):
        rotation = Rotation.from_rotvec(np.pi * axis).as_matrix()
        quaternion = frames.quaternion_from_rotation(rotation)
        np.testing.assert_allclose(np.linalg.norm(quaternion), 1.0)
        np.testing.assert_allclose(frames.rotation_from_quaternion(quaternion), rotation, atol=1e-12)


def test_angle_between_ignores_the_sign():
    turn = Rotation.from_rotvec([0.3, -0.2, 0.1])
    one = RANDOM.normal(size=(50, 4))
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    other = (turn * Rotation.from_quat(one)).as_quat()
    angle = np.linalg.norm([0.3, -0.2, 0.1])
    np.testing.assert_allclose(frames.angle_between(one, other), angle, atol=1e-7)
    np.testing.assert_allclose(frames.angle_between(one, -other), angle, atol=1e-7)


def test_invert():
    t = frames.transform(RANDOM.normal(size=(20, 3)), Rotation.random(20, random_state=1).as_matrix())
    np.testing.assert_allclose(frames.invert(t) @ t, np.broadcast_to(np.eye(4), (20, 4, 4)), atol=1e-12)
