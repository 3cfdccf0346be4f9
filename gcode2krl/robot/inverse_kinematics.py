"""Closed-form inverse kinematics of the arm of `kinematics`: all eight branches, or one along a path.

The index of a branch is KUKA's status S: bit 0 overhead, bit 1 elbow (A3 >= phi), bit 2 wrist (A5 < 0).
The wrist centre splits the problem (Pieper 1968): A1 from the direction to it, A2 and A3 from a planar
triangle by the law of cosines, A4 to A6 from the remaining rotation. All angles come from atan2 of a
direction (y, x), and A6 from the rotation that remains after A4, so a pose next to a singularity is solved as
exactly as any other.
"""

import math

import numba
import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats
from gcode2krl.compiled.inputs import read_only

Six = tuple[float, float, float, float, float, float]

STRETCH_TOLERANCE = 1e-12
"""How far cos(A3 - phi) may exceed 1 by rounding; less than 1e-8 mm beyond the stretched arm."""

AXIS_1_TOLERANCE_MM = 1e-9
"""A wrist centre as close as this to axis 1 leaves A1 free."""

WRIST_TOLERANCE = 1e-9
"""Below this |sin A5| axes 4 and 6 are one: A4 is free, A5 is exactly 0 or pi, A6 takes the rest."""

_BLOCK = 4096
"""Rows whose directions stay in the processor's cache."""


def all_branches(position_mm: npt.ArrayLike, rotation: npt.ArrayLike, geometry: npt.ArrayLike) -> Floats:
    """Return every set of angles that puts the flange into the given poses.

    Joint limits are ignored. Where axes 4 and 6 are one, A4 is 0 and both wrist branches are equal;
    where the wrist centre lies on axis 1, A1 is 0.

    Parameters
    ----------
    position_mm : (n, 3)
        Origin of the flange in the robot root.
    rotation : (n, 3, 3)
        Its axes as columns, orthonormal and right-handed; this is not checked.
    geometry : (6,)
        a1, a2, c1, c2, c3, c4 in mm; see `kinematics`.

    Returns
    -------
    q_rad : (n, 8, 6)
        A1 to A6 in (-pi, pi] by branch, which is the status S; NaN where a branch does not reach the pose.

    Raises
    ------
    ValueError
        If an array has the wrong shape.
    """
    position = read_only("position_mm", position_mm, -1, 3)
    axes = read_only("rotation", rotation, len(position), 3, 3)
    q_rad = np.empty((len(position), 8, 6))
    _all_rows(position, axes, read_only("geometry", geometry, 6), q_rad)
    return q_rad


def one_branch(
    position_mm: npt.ArrayLike,
    rotation: npt.ArrayLike,
    geometry: npt.ArrayLike,
    branch: int,
    q_reference_rad: npt.ArrayLike,
) -> Floats:
    """Return the angles of one branch along a path, without jumps of a full turn.

    Each angle is the turn nearest to that of the row before, in the first row to the reference, so A4 and A6
    wind beyond 180 degrees where the path does. Where axes 4 and 6 are one, A4 stays as it was and A6 takes
    the rest; where the wrist centre lies on axis 1, A1 stays. A row out of reach is NaN and the next row
    follows the last one that was reached. Joint limits are ignored.

    Parameters
    ----------
    position_mm : (n, 3)
        Origin of the flange in the robot root, row after row along the path.
    rotation : (n, 3, 3), or (1, 3, 3) for all rows
        Its axes as columns, orthonormal and right-handed; this is not checked.
    geometry : (6,)
        a1, a2, c1, c2, c3, c4 in mm; see `kinematics`.
    branch : int
        0 to 7, the status S.
    q_reference_rad : (6,)
        The angles before the first row.

    Returns
    -------
    q_rad : (n, 6)
        A1 to A6 with the controller's signs and zero.

    Raises
    ------
    ValueError
        If an array has the wrong shape, the branch is not 0 to 7, or the reference is not finite.
    """
    if branch not in range(8):
        raise ValueError(f"branch is {branch}, not 0 to 7")
    reference = read_only("q_reference_rad", q_reference_rad, 6)
    if not np.isfinite(reference).all():
        raise ValueError("q_reference_rad is not finite")
    position = read_only("position_mm", position_mm, -1, 3)
    axes = read_only("rotation", rotation, 1 if np.shape(rotation)[0] == 1 else len(position), 3, 3)
    shape = read_only("geometry", geometry, 6)
    q_rad = np.empty((len(position), 6))
    room = np.empty((2, 6 * _BLOCK))
    for first in range(0, len(position), _BLOCK):
        rows = slice(first, first + _BLOCK)
        turned, q_part = axes[rows] if len(axes) > 1 else axes, q_rad[rows]
        y, x = (column[: 6 * len(q_part)].reshape(6, len(q_part)) for column in room)
        if _direction_rows(position[rows], turned, shape, int(branch), y, x):
            _wind_rows(np.arctan2(y, x, out=y), reference, q_part)  # numpy's is the faster arc tangent
        else:
            _path_rows(position[rows], turned, shape, int(branch), reference, q_part)
        reached = np.flatnonzero(q_part[:, 0] == q_part[:, 0])
        if len(reached):
            reference = read_only("q_reference_rad", q_part[reached[-1]], 6)
    return q_rad


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _all_rows(position_mm: Floats, rotation: Floats, geometry: Floats, q_rad: Floats) -> None:
    for i in range(position_mm.shape[0]):
        for branch in range(8):
            y, x, _, _ = _directions(position_mm, i, rotation, i, geometry, branch, 1.0, 0.0, 1.0, 0.0)
            for j in range(6):
                q_rad[i, branch, j] = _main_value(math.atan2(y[j], x[j]))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _direction_rows(
    position_mm: Floats,
    rotation: Floats,
    geometry: Floats,
    branch: int,
    y: Floats,
    x: Floats,
) -> bool:
    """Write the angles (6, n) as directions y, x; False where one depends on the row before or has none."""
    regular = True
    step = 1 if rotation.shape[0] > 1 else 0
    for i in range(position_mm.shape[0]):
        y_i, x_i, free_1, free_4 = _directions(
            position_mm, i, rotation, i * step, geometry, branch, 1.0, 0.0, 1.0, 0.0
        )
        for j in range(6):
            y[j, i], x[j, i] = y_i[j], x_i[j]
        regular &= not (free_1 or free_4 or math.isnan(y_i[5]))
    return regular


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _wind_rows(angle_rad: Floats, q_reference_rad: Floats, q_rad: Floats) -> None:
    """Write the turns (n, 6) of angles (6, n) that are nearest to the row before."""
    for j in range(6):
        before = q_reference_rad[j]
        for i in range(angle_rad.shape[1]):
            before = _nearest_turn(angle_rad[j, i], before)
            q_rad[i, j] = before


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _path_rows(
    position_mm: Floats,
    rotation: Floats,
    geometry: Floats,
    branch: int,
    q_reference_rad: Floats,
    q_rad: Floats,
) -> None:
    """Write the angles row by row; free angles are those of the row before."""
    before = np.empty(6)
    for j in range(6):
        before[j] = q_reference_rad[j]
    step = 1 if rotation.shape[0] > 1 else 0
    for i in range(position_mm.shape[0]):
        y, x, free_1, free_4 = _directions(
            position_mm,
            i,
            rotation,
            i * step,
            geometry,
            branch,
            math.cos(before[0]),
            math.sin(before[0]),
            math.cos(before[3]),
            math.sin(before[3]),
        )
        reached = not math.isnan(y[5])  # NaN as soon as any part of the pose is
        for j in range(6):
            stays = (j == 0 and free_1) or (j == 3 and free_4)
            if reached and not stays:
                before[j] = _nearest_turn(math.atan2(y[j], x[j]), before[j])
            q_rad[i, j] = before[j] if reached else math.nan


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _nearest_turn(angle_rad: float, before_rad: float) -> float:
    """Return the angle with the whole turns that bring it nearest to another."""
    way = before_rad - angle_rad
    if -math.pi <= way < math.pi:
        return angle_rad
    return angle_rad + 2.0 * math.pi * np.floor(way / (2.0 * math.pi) + 0.5)  # type: ignore[no-any-return]


@numba.njit(nogil=True, error_model="numpy", forceinline=True)
def _directions(
    position_mm: Floats,
    k: int,
    rotation: Floats,
    i: int,
    geometry: Floats,
    branch: int,
    cos_1: float,
    sin_1: float,
    cos_4: float,
    sin_4: float,
) -> tuple[Six, Six, bool, bool]:
    """Return A1 to A6 of position k and rotation i as directions y, x, and whether A1 and A4 are free.

    A free angle is the given one. Out of reach, all directions are NaN.
    """
    a1, a2, c1, c2, c3, c4 = geometry
    wrist_x = position_mm[k, 0] - c4 * rotation[i, 0, 2]  # wrist centre: back along the flange's z
    wrist_y = position_mm[k, 1] - c4 * rotation[i, 1, 2]
    radius = math.sqrt(wrist_x * wrist_x + wrist_y * wrist_y)
    if branch & 1:  # overhead: axis 1 faces away from the wrist centre
        wrist_x, wrist_y, radius = -wrist_x, -wrist_y, -radius
    free_1 = not abs(radius) > AXIS_1_TOLERANCE_MM
    cos_1 = cos_1 if free_1 else wrist_x / abs(radius)
    sin_1 = sin_1 if free_1 else -wrist_y / abs(radius)

    # triangle of upper arm, forearm and the line from axis 2 to the wrist centre; angles count downwards
    along = radius - a1
    down = c1 - (position_mm[k, 2] - c4 * rotation[i, 2, 2])
    forearm_2 = c3 * c3 + a2 * a2
    forearm = math.sqrt(forearm_2)
    distance_2 = along * along + down * down
    cos_elbow = (distance_2 - c2 * c2 - forearm_2) / (2.0 * c2 * forearm)
    reached = abs(cos_elbow) <= 1.0 + STRETCH_TOLERANCE  # NaN input is not
    cos_1, cos_elbow = (cos_1, cos_elbow) if reached else (math.nan, math.nan)
    square = (1.0 - cos_elbow) * (1.0 + cos_elbow)
    sin_elbow = math.sqrt(0.0 if square < 0.0 else square)
    sin_elbow = sin_elbow if branch & 2 else -sin_elbow
    reach_along, reach_down = c2 + forearm * cos_elbow, forearm * sin_elbow
    cos_2 = (along * reach_along + down * reach_down) / distance_2
    sin_2 = (down * reach_along - along * reach_down) / distance_2
    cos_3 = (cos_elbow * c3 + sin_elbow * a2) / forearm
    sin_3 = (sin_elbow * c3 - cos_elbow * a2) / forearm
    cos_23, sin_23 = cos_2 * cos_3 - sin_2 * sin_3, sin_2 * cos_3 + cos_2 * sin_3

    # Rx(-A4) Ry(A5) Rx(-A6) = m, the flange's axes z, y, -x seen from the forearm
    y_x, y_y = sin_1, cos_1  # the forearm's y; its z is (z_x, z_y, cos_23)
    z_x, z_y = cos_1 * sin_23, -sin_1 * sin_23
    m_00 = (cos_1 * rotation[i, 0, 2] - sin_1 * rotation[i, 1, 2]) * cos_23 - sin_23 * rotation[i, 2, 2]
    m_10 = y_x * rotation[i, 0, 2] + y_y * rotation[i, 1, 2]
    m_20 = z_x * rotation[i, 0, 2] + z_y * rotation[i, 1, 2] + cos_23 * rotation[i, 2, 2]
    m_11 = y_x * rotation[i, 0, 1] + y_y * rotation[i, 1, 1]
    m_21 = z_x * rotation[i, 0, 1] + z_y * rotation[i, 1, 1] + cos_23 * rotation[i, 2, 1]
    m_12 = -y_x * rotation[i, 0, 0] - y_y * rotation[i, 1, 0]
    m_22 = -z_x * rotation[i, 0, 0] - z_y * rotation[i, 1, 0] - cos_23 * rotation[i, 2, 0]
    sin_5 = math.sqrt(m_10 * m_10 + m_20 * m_20)
    free_4 = sin_5 < WRIST_TOLERANCE
    sin_5 = -sin_5 if branch & 4 else sin_5
    cos_4 = cos_4 if free_4 else -m_20 / sin_5
    sin_4 = sin_4 if free_4 else -m_10 / sin_5
    sin_5 = 0.0 if free_4 else sin_5
    # rows 1 and 2 of Rx(A4) m = Ry(A5) Rx(-A6): exact for the A4 taken, at the singularity too
    sin_6, cos_6 = cos_4 * m_12 - sin_4 * m_22, cos_4 * m_11 - sin_4 * m_21
    return (
        (sin_1, sin_2, sin_3, sin_4, sin_5, sin_6),
        (cos_1, cos_2, cos_3, cos_4, m_00, cos_6),
        free_1,
        free_4,
    )


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _main_value(angle_rad: float) -> float:
    """Return the same direction in (-pi, pi], for an angle less than a turn away from it."""
    if angle_rad > math.pi:
        return angle_rad - 2.0 * math.pi
    if angle_rad <= -math.pi:
        return angle_rad + 2.0 * math.pi
    return angle_rad
