"""Rotations, quaternions and KUKA frames as numpy arrays.

Conventions: active rotations, column vectors; quaternions are (x, y, z, w); A, B, C are KUKA's angles,
R = Rz(A)·Ry(B)·Rx(C).
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gcode2krl.arrays import Floats, Ints

_GIMBAL_COS = 1e-9


def rotation_from_abc(abc_rad: ArrayLike) -> Floats:
    """Return R = Rz(A)·Ry(B)·Rx(C), (..., 3, 3), for A, B, C (..., 3) in radians."""
    a, b, c = np.moveaxis(np.asarray(abc_rad, dtype=float), -1, 0)
    ca, sa, cb, sb, cc, sc = np.cos(a), np.sin(a), np.cos(b), np.sin(b), np.cos(c), np.sin(c)
    rows = [
        [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
        [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
        [-sb, cb * sc, cb * cc],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def abc_from_rotation(rotation: ArrayLike) -> Floats:
    """Return A, B, C (..., 3) in radians for rotations (..., 3, 3); at B = ±90° C is zero."""
    r = np.asarray(rotation, dtype=float)
    cos_b = np.hypot(r[..., 0, 0], r[..., 1, 0])
    locked = cos_b < _GIMBAL_COS
    a = np.where(locked, np.arctan2(-r[..., 0, 1], r[..., 1, 1]), np.arctan2(r[..., 1, 0], r[..., 0, 0]))
    b = np.arctan2(-r[..., 2, 0], cos_b)
    c = np.where(locked, 0.0, np.arctan2(r[..., 2, 1], r[..., 2, 2]))
    return np.stack([a, b, c], axis=-1)


def rotation_from_quaternion(quaternion: ArrayLike) -> Floats:
    """Return rotations (..., 3, 3) for unit quaternions (..., 4) as x, y, z, w."""
    x, y, z, w = np.moveaxis(np.asarray(quaternion, dtype=float), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_rotation(rotation: ArrayLike) -> Floats:
    """Return unit quaternions (..., 4) as x, y, z, w with w >= 0 for rotations (..., 3, 3).

    The component of largest magnitude is taken first (Shepperd's choice), so no case loses digits.
    """
    r = np.asarray(rotation, dtype=float)
    d0, d1, d2 = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    squares = np.stack([1 + d0 - d1 - d2, 1 - d0 + d1 - d2, 1 - d0 - d1 + d2, 1 + d0 + d1 + d2], axis=-1)
    xy, xz, yz = r[..., 0, 1] + r[..., 1, 0], r[..., 0, 2] + r[..., 2, 0], r[..., 1, 2] + r[..., 2, 1]
    wx, wy, wz = r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]
    candidates = np.stack(
        [
            np.stack([squares[..., 0], xy, xz, wx], axis=-1),
            np.stack([xy, squares[..., 1], yz, wy], axis=-1),
            np.stack([xz, yz, squares[..., 2], wz], axis=-1),
            np.stack([wx, wy, wz, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(squares, axis=-1)
    q = np.take_along_axis(candidates, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    result: Floats = np.where(q[..., 3:4] < 0, -q, q)
    return result


def transform(position_mm: ArrayLike, rotation: ArrayLike) -> Floats:
    """Return the homogeneous transform (..., 4, 4) of position (..., 3) in mm and rotation (..., 3, 3)."""
    position, r = np.asarray(position_mm, dtype=float), np.asarray(rotation, dtype=float)
    t = np.zeros((*np.broadcast_shapes(position.shape[:-1], r.shape[:-2]), 4, 4))
    t[..., :3, :3], t[..., :3, 3], t[..., 3, 3] = r, position, 1.0
    return t


def invert(t: ArrayLike) -> Floats:
    """Return the inverse of rigid transforms (..., 4, 4)."""
    m = np.asarray(t, dtype=float)
    r = np.swapaxes(m[..., :3, :3], -1, -2)
    return transform(-np.einsum("...ij,...j->...i", r, m[..., :3, 3]), r)


def angle_between(quaternion_a: ArrayLike, quaternion_b: ArrayLike) -> Floats:
    """Return the rotation angle (...,) in radians between unit quaternions (..., 4); signs do not matter."""
    a, b = np.asarray(quaternion_a, dtype=float), np.asarray(quaternion_b, dtype=float)
    b = np.where(np.sum(a * b, axis=-1, keepdims=True) < 0, -b, b)
    half_chord = np.linalg.norm(a - b, axis=-1) / 2.0
    angle: Floats = 4.0 * np.arcsin(np.clip(half_chord, 0.0, 1.0))
    return angle


def turn_between(a: Floats, b: Floats) -> Floats:
    """Return the rotation vectors (n, 3) in rad from quaternions (n, 4) to others, by the shorter arc.

    `slerp` turns evenly about them: b = exp(vector)·a, along the axes that the quaternions refer to.
    """
    scalar = np.sum(a * b, axis=1, keepdims=True)
    vector = a[:, 3:] * b[:, :3] - b[:, 3:] * a[:, :3] - np.cross(b[:, :3], a[:, :3])
    vector, scalar = np.where(scalar < 0.0, -vector, vector), np.abs(scalar)
    sine = np.linalg.norm(vector, axis=1, keepdims=True)
    turn: Floats = 2.0 * np.arctan2(sine, scalar) / np.where(sine > 0.0, sine, 1.0) * vector
    return turn


def slerp(a: Floats, b: Floats, part: Floats) -> Floats:
    """Return the rotations between quaternions (n, 4) and (n, 4) at fractions (n,), along the shorter arc."""
    b = np.where(np.sum(a * b, axis=1, keepdims=True) < 0, -b, b)
    half = np.arccos(np.clip(np.sum(a * b, axis=1), -1.0, 1.0))
    sine = np.sin(half)
    small = sine < 1e-9
    safe = np.where(small, 1.0, sine)
    wa = np.where(small, 1 - part, np.sin((1 - part) * half) / safe)
    wb = np.where(small, part, np.sin(part * half) / safe)
    mixed = wa[:, None] * a + wb[:, None] * b
    result: Floats = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return result


def all_alike(values: NDArray[Any]) -> bool:
    """Tell whether all rows (n, ...), at least one, are equal; at once where one stands for all in memory."""
    return values.strides[0] == 0 or bool((values == values[0]).all())


def equal_runs(values: Floats) -> tuple[Ints, Ints]:
    """Return (first row of each run of equal rows (r,), run of each row (n,)) of ``values`` (n, c)."""
    changes = np.zeros(len(values), dtype=np.bool_)
    for column in values.T:
        changes[1:] |= column[1:] != column[:-1]
    changes[:1] = True
    return np.flatnonzero(changes), np.cumsum(changes) - 1
