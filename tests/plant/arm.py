"""Kinematics of the arm: screws of its reference pose, a product of exponentials, and the closed inverse.

Reference pose: all six angles of the controller are zero; the arm lies forward along x. Every joint is a
screw (direction, point) of that pose, every virtual joint an origin with three directions of that pose.
Angles carry the controller's signs because the directions of A1, A4 and A6 point the other way.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from tests.plant.scene import Frame, World

X, Y, Z = np.eye(3)
ELBOW = 2  # row of A3


@dataclass(frozen=True)
class Arm:
    """The reference pose as arrays, in the robot's root, mm."""

    screws: np.ndarray  # (6, 3) directions
    points_mm: np.ndarray  # (6, 3)
    tcp_mm: np.ndarray  # (3,)
    tcp_axes: np.ndarray  # (3, 3)
    hinges_mm: np.ndarray  # (10, 3) origins of the virtual joints
    hinge_axes: np.ndarray  # (10, 3, 3)
    hinge_after: np.ndarray  # (10,) number of joints in front of each


def reference_pose(world: World, tool: Frame | None = None) -> Arm:
    """The screws of a robot with these lengths, with the world's tool or another one."""
    a1, a2, c1, c2, c3, c4 = world.lengths_mm
    tool = world.tool if tool is None else tool
    shoulder = np.array([a1, 0.0, c1])
    elbow = shoulder + c2 * X
    wrist = elbow + c3 * X - a2 * Z
    flange = wrist + c4 * X
    flange_axes = np.column_stack([-Z, Y, X])
    screws = np.array([-Z, Y, Y, -X, Y, -X])
    points = np.array([np.zeros(3), shoulder, elbow, wrist, wrist, wrist])
    link = np.column_stack([X, -Z, Y])  # x along the link, z = axis 2
    fore = np.column_stack([Z, -Y, X])  # z along the forearm
    axes = [np.eye(3), link, link, np.column_stack([Z, X, Y]), fore, fore, np.column_stack([Z, X, Y])]
    hinges = [c1 * Z, shoulder, shoulder + c2 / 2.0 * X, elbow, wrist - c3 / 2.0 * X, wrist, wrist]
    for along in (0.0, 28.0, 56.0):  # flange face, middle of the sensor, face of the holder
        hinges.append(flange + along * X)
        axes.append(flange_axes)
    return Arm(
        screws,
        points,
        flange + flange_axes @ tool.origin_mm,
        flange_axes @ tool.axes,
        np.array(hinges),
        np.array(axes),
        np.array([1, 2, 2, 3, 3, 4, 5, 6, 6, 6]),
    )


def crooked(arm: Arm, joint: int, turn: np.ndarray) -> Arm:
    """The arm with all that lies behind a joint's seat turned about its point; `turn` is a rotation."""
    point = arm.points_mm[joint]

    def moved(points: np.ndarray) -> np.ndarray:
        return (points - point) @ turn.T + point

    behind = arm.hinge_after > joint
    axes, hinges = arm.hinge_axes.copy(), arm.hinges_mm.copy()
    axes[behind], hinges[behind] = turn @ axes[behind], moved(hinges[behind])
    screws, points = arm.screws.copy(), arm.points_mm.copy()
    screws[joint:], points[joint:] = screws[joint:] @ turn.T, moved(points[joint:])
    return replace(
        arm,
        screws=screws,
        points_mm=points,
        tcp_mm=moved(arm.tcp_mm),
        tcp_axes=turn @ arm.tcp_axes,
        hinges_mm=hinges,
        hinge_axes=axes,
    )


@njit(cache=True, nogil=True)
def _exponential(direction, angle, out):
    """Rotation about a unit direction (Rodrigues)."""
    s, c = np.sin(angle), np.cos(angle)
    x, y, z = direction[0], direction[1], direction[2]
    d = 1.0 - c
    out[0, 0], out[0, 1], out[0, 2] = c + d * x * x, d * x * y - s * z, d * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = d * x * y + s * z, c + d * y * y, d * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = d * x * z - s * y, d * y * z + s * x, c + d * z * z


@njit(cache=True, nogil=True)
def _mul(a, b, out):
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(cache=True, nogil=True)
def _apply(a, v, out):
    for i in range(3):
        out[i] = a[i, 0] * v[0] + a[i, 1] * v[1] + a[i, 2] * v[2]


@njit(cache=True, nogil=True)
def _levels(q, screws, points, rot, pos):
    """Motion of the body behind each joint relative to the reference pose: rot (7,3,3), pos (7,3)."""
    e, v = np.empty((3, 3)), np.empty(3)
    rot[0] = np.eye(3)
    pos[0] = 0.0
    for j in range(6):
        _exponential(screws[j], q[j], e)
        _mul(rot[j], e, rot[j + 1])
        _apply(e, points[j], v)
        v = points[j] - v
        _apply(rot[j], v, pos[j + 1])
        pos[j + 1] += pos[j]


@njit(cache=True, nogil=True)
def _pose(q, screws, points, tcp, tcp_axes):
    n = len(q)
    place, axes = np.empty((n, 3)), np.empty((n, 3, 3))
    rot, pos = np.empty((7, 3, 3)), np.empty((7, 3))
    for i in range(n):
        _levels(q[i], screws, points, rot, pos)
        _apply(rot[6], tcp, place[i])
        place[i] += pos[6]
        _mul(rot[6], tcp_axes, axes[i])
    return place, axes


@njit(cache=True, nogil=True)
def _hinge(k, after, hinges, hinge_axes, rot, pos, origin, axes):
    level = after[k]
    _apply(rot[level], hinges[k], origin)
    origin += pos[level]
    _mul(rot[level], hinge_axes[k], axes)


@njit(cache=True, nogil=True)
def _cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@njit(cache=True, nogil=True)
def _torques(q, force, moment, screws, points, tcp, tcp_axes, hinges, hinge_axes, after):
    """Moment about x, y, z of each virtual joint under a load at the TCP, (n, 10, 3)."""
    n, m = len(q), len(hinges)
    out = np.empty((n, m, 3))
    rot, pos = np.empty((7, 3, 3)), np.empty((7, 3))
    origin, axes, tip = np.empty(3), np.empty((3, 3)), np.empty(3)
    for i in range(n):
        _levels(q[i], screws, points, rot, pos)
        _apply(rot[6], tcp, tip)
        tip += pos[6]
        for k in range(m):
            _hinge(k, after, hinges, hinge_axes, rot, pos, origin, axes)
            about = moment[i] + _cross(tip - origin, force[i])
            for a in range(3):
                out[i, k, a] = axes[0, a] * about[0] + axes[1, a] * about[1] + axes[2, a] * about[2]
    return out


@njit(cache=True, nogil=True)
def _bent(q, angles, screws, points, tcp, tcp_axes, hinges, hinge_axes, after):
    """Pose of the TCP when the virtual joints turn by these angles (n, 10, 3).

    In the undeformed pose every virtual joint is three screws through its origin; applied from the tip
    towards the foot, each about its own undeformed axes, their finite product moves the tip.
    """
    n, m = len(q), len(hinges)
    place, turn = np.empty((n, 3)), np.empty((n, 3, 3))
    rot, pos = np.empty((7, 3, 3)), np.empty((7, 3))
    origin, axes = np.empty(3), np.empty((3, 3))
    e, v, now, swap = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    for i in range(n):
        _levels(q[i], screws, points, rot, pos)
        tip = np.empty(3)
        _apply(rot[6], tcp, tip)
        tip += pos[6]
        _mul(rot[6], tcp_axes, now)
        for k in range(m - 1, -1, -1):
            _hinge(k, after, hinges, hinge_axes, rot, pos, origin, axes)
            for a in range(3):
                _exponential(axes[:, a].copy(), angles[i, k, a], e)
                _apply(e, tip - origin, v)
                tip = origin + v
                _mul(e, now, swap)
                now[:] = swap
        place[i], turn[i] = tip, now
    return place, turn


def pose(arm: Arm, q_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """TCP and its axes in the root for angles (n, 6)."""
    return _pose(q_rad, arm.screws, arm.points_mm, arm.tcp_mm, arm.tcp_axes)


def _arrays(arm: Arm) -> tuple:
    return (
        arm.screws,
        arm.points_mm,
        arm.tcp_mm,
        arm.tcp_axes,
        arm.hinges_mm,
        arm.hinge_axes,
        arm.hinge_after,
    )


def torques(arm: Arm, q_rad: np.ndarray, force_N: np.ndarray, moment_Nmm: np.ndarray) -> np.ndarray:
    """Moments at the virtual joints (n, 10, 3), N·mm, under a load at the TCP along the root's axes."""
    return _torques(q_rad, force_N, moment_Nmm, *_arrays(arm))


def bent(arm: Arm, q_rad: np.ndarray, angles_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """TCP and axes with the virtual joints turned by angles (n, 10, 3)."""
    return _bent(q_rad, angles_rad, *_arrays(arm))


def inverse(world: World, place_mm: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Angles (n, 6) of the controller for TCP poses (n, 3), (n, 3, 3) in the root.

    The arm reaches forward with the elbow up; of the two wrists the one with the smaller |A4| + |A6|.
    """
    a1, a2, c1, c2, c3, c4 = world.lengths_mm
    flange_axes = axes @ world.tool.axes.T
    flange = place_mm - flange_axes @ world.tool.origin_mm
    wrist = flange - c4 * flange_axes[:, :, 2]
    turn = np.arctan2(wrist[:, 1], wrist[:, 0])
    out, up = np.hypot(wrist[:, 0], wrist[:, 1]) - a1, wrist[:, 2] - c1
    fore, drop = np.hypot(c3, a2), np.arctan2(a2, c3)
    reach = np.hypot(out, up)
    cos_shoulder = (c2**2 + reach**2 - fore**2) / (2.0 * c2 * reach)
    cos_elbow = (c2**2 + fore**2 - reach**2) / (2.0 * c2 * fore)
    lift = np.arctan2(up, out) + np.arccos(cos_shoulder)
    q2, q3 = -lift, np.pi - np.arccos(cos_elbow) - drop
    bow = q2 + q3  # the forearm's slope, positive downwards
    ct, st, cb, sb = np.cos(turn), np.sin(turn), np.cos(bow), np.sin(bow)
    along = np.stack([ct * cb, st * cb, -sb], axis=1)
    side = np.stack([-st, ct, np.zeros_like(st)], axis=1)
    above = np.stack([ct * sb, st * sb, cb], axis=1)
    look, down = flange_axes[:, :, 2], -flange_axes[:, :, 0]  # reference: look = x, down = z
    lx, ly, lz = (np.sum(look * d, axis=1) for d in (along, side, above))
    ux, vx = np.sum(down * along, axis=1), np.sum(flange_axes[:, :, 1] * along, axis=1)
    bend = np.arctan2(np.hypot(ly, lz), lx)
    wrists = []
    for sign in (1.0, -1.0):
        q4 = np.arctan2(-sign * ly, -sign * lz)
        q6 = np.arctan2(-sign * vx, sign * ux)
        wrists.append(np.stack([-turn, q2, q3, q4, sign * bend, q6], axis=1))
    one, two = (np.abs(q[:, 3]) + np.abs(q[:, 5]) for q in wrists)
    return np.where((two < one)[:, None], wrists[1], wrists[0])
