"""Geometric Jacobian of the arm of `kinematics`, and how far a pose is from a singularity.

Column j is the velocity of a point of the flange, and the angular velocity of the flange, for A(j+1) turning
with 1 rad/s: the axis of rotation crossed with the lever arm, and the axis itself (Whitney 1972).
"""

import math

import numba
import numpy as np
import numpy.typing as npt

from gcode2krl.robot.kinematics import FloatArray, read_only


def jacobian(q_rad: npt.ArrayLike, geometry: npt.ArrayLike, tool_position_mm: npt.ArrayLike) -> FloatArray:
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
) -> FloatArray:
    """Return the distance to a singularity: the smallest singular value of the dimensionless Jacobian.

    The velocity rows are divided by the length of the stretched arm, c2 + hypot(c3, a2), 2151 mm on the
    KR 300 R2500 ultra. A joint turning with 1 rad/s then moves the tip by at most about 1, as it turns the
    flange by 1, so that neither kind of row drowns the other; and arms of one shape and different size have
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
        0 at a singularity, found as the root of an eigenvalue: right to 1e-7, not better. NaN where q is.

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
def _jacobian_rows(
    q: FloatArray, geometry: FloatArray, tool_position_mm: FloatArray, columns: FloatArray
) -> None:
    for i in range(q.shape[0]):
        _fill(q, i, geometry, tool_position_mm, 1.0, columns[i])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _sigma_rows(
    q: FloatArray, geometry: FloatArray, tool_position_mm: FloatArray, sigma_min: FloatArray
) -> None:
    length_mm = geometry[3] + math.hypot(geometry[4], geometry[1])
    columns, gram = np.empty((6, 6)), np.empty((6, 6))
    for i in range(q.shape[0]):
        _fill(q, i, geometry, tool_position_mm, 1.0 / length_mm, columns)
        for row in range(6):
            for column in range(row + 1):
                total = 0.0
                for k in range(6):
                    total += columns[row, k] * columns[column, k]
                gram[row, column] = total
                gram[column, row] = total
        sigma_min[i] = math.sqrt(_smallest_eigenvalue(gram))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fill(
    q: FloatArray,
    i: int,
    geometry: FloatArray,
    tool_position_mm: FloatArray,
    scale: float,
    columns: FloatArray,
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


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _smallest_eigenvalue(a: FloatArray) -> float:
    """Return that of a symmetric positive semi-definite (6, 6), which is overwritten.

    Householder's tridiagonal form, then Newton's method on the characteristic polynomial from below: all
    roots being real, it rises to the smallest one and never passes it (Golub and Van Loan, 8.3 and 8.4).
    """
    for k in range(4):
        norm_2 = 0.0
        for i in range(k + 2, 6):
            norm_2 += a[i, k] * a[i, k]
        if norm_2 == 0.0:
            continue
        head = a[k + 1, k]
        off_diagonal = -math.copysign(math.sqrt(head * head + norm_2), head)
        a[k + 1, k] = head - off_diagonal  # the Householder vector stays in column k, below the diagonal
        half = 0.5 * (a[k + 1, k] * a[k + 1, k] + norm_2)
        product = 0.0
        for i in range(k + 1, 6):
            total = 0.0
            for j in range(k + 1, 6):
                total += a[i, j] * a[j, k]
            a[k, i] = total / half
            product += a[k, i] * a[i, k]
        for i in range(k + 1, 6):
            a[k, i] -= 0.5 * product / half * a[i, k]
        for i in range(k + 1, 6):
            for j in range(k + 1, 6):
                a[i, j] -= a[i, k] * a[k, j] + a[k, i] * a[j, k]
        a[k + 1, k] = off_diagonal

    root: float = 0.0
    for _ in range(60):
        value, slope, value_before, slope_before = a[0, 0] - root, -1.0, 1.0, 0.0
        for k in range(1, 6):
            diagonal, square = a[k, k] - root, a[k, k - 1] * a[k, k - 1]
            value, value_before, slope, slope_before = (
                diagonal * value - square * value_before,
                value,
                diagonal * slope - value - square * slope_before,
                slope,
            )
        step = -value / slope
        if math.isnan(value):
            return math.nan
        if not step > 1e-15 * (1.0 + root):  # 0 / 0 at a double root too
            return root
        root += step
    return root
