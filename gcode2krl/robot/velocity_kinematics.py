"""Geometric Jacobian of the arm of `kinematics`, and how far a pose is from a singularity.

Column j is the velocity of a point of the flange, and the angular velocity of the flange, for A(j+1) turning
with 1 rad/s: the axis of rotation crossed with the lever arm, and the axis itself (Whitney 1972).
"""

import math

import numba
import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats
from gcode2krl.compiled.inputs import read_only

_TOGETHER = 64
"""Rows that are computed together."""


def jacobian(q_rad: npt.ArrayLike, geometry: npt.ArrayLike, tool_position_mm: npt.ArrayLike) -> Floats:
    """Return the Jacobian of the tool tip along the axes of the robot root.

    Parameters
    ----------
    q_rad : (n, 6)
        A1 to A6 with the controller's signs and zero.
    geometry : (6,)
        a1, a2, c1, c2, c3, c4 in mm; see `kinematics`.
    tool_position_mm : (3,)
        The tip in the flange frame.

    Returns
    -------
    jacobian : (n, 6, 6)
        Rows 0 to 2 the velocity of the tip in mm/rad, rows 3 to 5 the angular velocity in rad/rad.

    Raises
    ------
    ValueError
        If an array has the wrong shape.
    """
    q = read_only("q_rad", q_rad, -1, 6)
    tool = read_only("tool_position_mm", tool_position_mm, 3)
    columns = np.empty((len(q), 6, 6))
    _jacobian_rows(q, read_only("geometry", geometry, 6), tool, columns)
    return columns


def smallest_singular_value(
    q_rad: npt.ArrayLike, geometry: npt.ArrayLike, tool_position_mm: npt.ArrayLike
) -> Floats:
    """Return the distance to a singularity: the smallest singular value of the dimensionless Jacobian.

    The velocity rows are divided by the length of the stretched arm, c2 + hypot(c3, a2), 2151 mm on the
    KR 300 R2500 ultra. A joint turning with 1 rad/s then moves the tip by at most about 1, as it turns the
    flange by 1, so that neither kind of row dominates; and arms of one shape and different size have
    the same value. Its inverse is the largest norm of the joint speeds for a unit motion of the tool.

    Parameters
    ----------
    q_rad : (n, 6)
        A1 to A6 with the controller's signs and zero.
    geometry : (6,)
        a1, a2, c1, c2, c3, c4 in mm; see `kinematics`.
    tool_position_mm : (3,)
        The tip in the flange frame.

    Returns
    -------
    sigma_min : (n,)
        0 at a singularity, computed as the root of an eigenvalue, so accurate to 1e-7 only. NaN where q is.

    Raises
    ------
    ValueError
        If an array has the wrong shape.
    """
    q = read_only("q_rad", q_rad, -1, 6)
    tool = read_only("tool_position_mm", tool_position_mm, 3)
    sigma_min = np.empty(len(q))
    _sigma_rows(q, read_only("geometry", geometry, 6), tool, sigma_min)
    return sigma_min


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _jacobian_rows(q: Floats, geometry: Floats, tool_position_mm: Floats, columns: Floats) -> None:
    for i in range(q.shape[0]):
        _fill(q, i, geometry, tool_position_mm, 1.0, columns[i])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _sigma_rows(q: Floats, geometry: Floats, tool_position_mm: Floats, sigma_min: Floats) -> None:
    """Write the singular values; rows go through each step together, so that it is vectorised."""
    scale = 1.0 / (geometry[3] + math.hypot(geometry[4], geometry[1]))
    count = q.shape[0]
    matrix, columns, gram = np.empty((6, 6)), np.empty((6, 6, _TOGETHER)), np.empty((6, 6, _TOGETHER))
    square, root = np.empty((6, _TOGETHER)), np.empty(_TOGETHER)
    for first in range(0, count, _TOGETHER):
        for m in range(_TOGETHER):
            _fill(q, min(first + m, count - 1), geometry, tool_position_mm, scale, matrix)
            for row in range(6):
                for j in range(6):
                    columns[row, j, m] = matrix[row, j]
        for row in range(6):
            for other in range(row + 1):
                for m in range(_TOGETHER):
                    total = 0.0
                    for j in range(6):
                        total += columns[row, j, m] * columns[other, j, m]
                    gram[row, other, m] = total
        _tridiagonal(gram, square)
        _smallest_root(gram, square, root)
        for m in range(min(_TOGETHER, count - first)):
            sigma_min[first + m] = math.sqrt(root[m])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fill(
    q: Floats,
    i: int,
    geometry: Floats,
    tool_position_mm: Floats,
    scale: float,
    columns: Floats,
) -> None:
    """Write the Jacobian of row i, its velocity rows times ``scale``."""
    a1, a2, _, c2, c3, c4 = geometry
    cos_1, sin_1 = math.cos(q[i, 0]), math.sin(q[i, 0])
    cos_2, sin_2 = math.cos(q[i, 1]), math.sin(q[i, 1])
    cos_23, sin_23 = math.cos(q[i, 1] + q[i, 2]), math.sin(q[i, 1] + q[i, 2])
    cos_4, sin_4 = math.cos(q[i, 3]), math.sin(q[i, 3])
    cos_5, sin_5 = math.cos(q[i, 4]), math.sin(q[i, 4])
    cos_6, sin_6 = math.cos(q[i, 5]), math.sin(q[i, 5])

    # the tip from the wrist centre, turned by eq. 1 from the right to the left: Ry(90 deg) Tr(c4,0,0) first
    x, y, z = tool_position_mm[2] + c4, tool_position_mm[1], -tool_position_mm[0]
    y, z = cos_6 * y + sin_6 * z, cos_6 * z - sin_6 * y
    x, z = cos_5 * x + sin_5 * z, cos_5 * z - sin_5 * x
    y, z = cos_4 * y + sin_4 * z, cos_4 * z - sin_4 * y
    # now along the forearm; then in the arm's plane: x forward, y to the left, z up
    x, z = cos_23 * x + sin_23 * z, cos_23 * z - sin_23 * x
    forearm_x, forearm_z = c3 * cos_23 - a2 * sin_23, -c3 * sin_23 - a2 * cos_23
    upper_x, upper_z = c2 * cos_2, -c2 * sin_2
    axis_6_x = -cos_23 * cos_5 + sin_23 * cos_4 * sin_5
    axis_6_y = sin_4 * sin_5
    axis_6_z = cos_23 * cos_4 * sin_5 + sin_23 * cos_5

    # axis of rotation and lever arm from a point of it to the tip, both in the arm's plane
    from_3_x, from_3_z = x + forearm_x, z + forearm_z
    from_2_x, from_2_z = from_3_x + upper_x, from_3_z + upper_z
    joints = (
        (0.0, 0.0, -1.0, from_2_x + a1, from_2_z),
        (0.0, 1.0, 0.0, from_2_x, from_2_z),
        (0.0, 1.0, 0.0, from_3_x, from_3_z),
        (-cos_23, 0.0, sin_23, x, z),
        (-sin_23 * sin_4, cos_4, -cos_23 * sin_4, x, z),
        (axis_6_x, axis_6_y, axis_6_z, x, z),
    )
    for j in range(6):
        axis_x, axis_y, axis_z, lever_x, lever_z = joints[j]
        speed_x = scale * (axis_y * lever_z - axis_z * y)
        speed_y = scale * (axis_z * lever_x - axis_x * lever_z)
        columns[0, j] = cos_1 * speed_x + sin_1 * speed_y  # Rz(-A1): from the plane to the root
        columns[1, j] = cos_1 * speed_y - sin_1 * speed_x
        columns[2, j] = scale * (axis_x * y - axis_y * lever_x)
        columns[3, j] = cos_1 * axis_x + sin_1 * axis_y
        columns[4, j] = cos_1 * axis_y - sin_1 * axis_x
        columns[5, j] = axis_z


# each branch is a loop of the textbook's form, over rows that are worked on together
@numba.njit(cache=True, nogil=True, error_model="numpy")
def _tridiagonal(a: Floats, square: Floats) -> None:
    """Bring symmetric (6, 6, m), of which the lower half is read, to Householder's tridiagonal form.

    The diagonal is left in ``a``; ``square`` (6, m) gets the squares of the off-diagonal, from row 1 on
    (Golub and Van Loan, 8.3).
    """
    step, two_over = np.empty((6, _TOGETHER)), np.empty(_TOGETHER)
    for k in range(4):
        for m in range(_TOGETHER):
            below = 0.0
            for i in range(k + 2, 6):
                below += a[i, k, m] * a[i, k, m]
            head = a[k + 1, k, m]
            beside = -math.copysign(math.sqrt(head * head + below), head)
            square[k + 1, m] = beside * beside
            head -= beside
            a[k + 1, k, m] = head  # the Householder vector stays in column k, below the diagonal
            size = head * head + below
            two_over[m] = 2.0 / size if size > 1e-300 else 0.0
        for i in range(k + 1, 6):
            for m in range(_TOGETHER):
                total = 0.0
                for j in range(k + 1, i + 1):
                    total += a[i, j, m] * a[j, k, m]
                for j in range(i + 1, 6):
                    total += a[j, i, m] * a[j, k, m]
                step[i, m] = total * two_over[m]
        for m in range(_TOGETHER):
            along = 0.0
            for i in range(k + 1, 6):
                along += step[i, m] * a[i, k, m]
            along *= 0.5 * two_over[m]
            for i in range(k + 1, 6):
                step[i, m] -= along * a[i, k, m]
        for i in range(k + 1, 6):
            for j in range(k + 1, i + 1):
                for m in range(_TOGETHER):
                    a[i, j, m] -= a[i, k, m] * step[j, m] + step[i, m] * a[j, k, m]
    for m in range(_TOGETHER):
        square[5, m] = a[5, 4, m] * a[5, 4, m]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _smallest_root(a: Floats, square: Floats, root: Floats) -> None:
    """Write the smallest eigenvalues (m,) of positive semi-definite tridiagonal matrices, NaN where they are.

    Newton's method on the characteristic polynomial from below: all roots being real, it rises to the
    smallest one and never passes it (Golub and Van Loan, 8.4).
    """
    root[:] = 0.0
    for _ in range(60):
        rising = 0
        for m in range(_TOGETHER):
            at = root[m]
            value, slope, value_before, slope_before = a[0, 0, m] - at, -1.0, 1.0, 0.0
            for k in range(1, 6):
                diagonal = a[k, k, m] - at
                value, value_before, slope, slope_before = (
                    diagonal * value - square[k, m] * value_before,
                    value,
                    diagonal * slope - value - square[k, m] * slope_before,
                    slope,
                )
            step = -value / slope
            rises = step > 1e-15 * (1.0 + at)  # 0 / 0 at a double root does not
            root[m] = at + (step if rises else 0.0 * value)
            rising += rises
        if rising == 0:
            return
