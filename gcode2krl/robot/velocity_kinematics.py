"""Geometric Jacobian of the arm of `kinematics`, and how far a pose is from a singularity.

Column j is the velocity of a point of the flange, and the angular velocity of the flange, for A(j+1) turning
with 1 rad/s: the axis of rotation crossed with the lever arm, and the axis itself (Whitney 1972).
"""

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats
from gcode2krl.compiled.core import FLOATS, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import shaped

_jacobian = core_function("robot_jacobian", FLOATS, FLOATS, FLOATS, OUT_FLOATS)
_smallest_singular_value = core_function("robot_smallest_singular_value", FLOATS, FLOATS, FLOATS, OUT_FLOATS)


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
    q = shaped("q_rad", q_rad, -1, 6)
    tool = shaped("tool_position_mm", tool_position_mm, 3)
    columns = np.empty((len(q), 6, 6))
    _jacobian(q, shaped("geometry", geometry, 6), tool, columns)
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
    q = shaped("q_rad", q_rad, -1, 6)
    tool = shaped("tool_position_mm", tool_position_mm, 3)
    sigma_min = np.empty(len(q))
    _smallest_singular_value(q, shaped("geometry", geometry, 6), tool, sigma_min)
    return sigma_min
