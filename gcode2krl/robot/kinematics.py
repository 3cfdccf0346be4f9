"""Forward kinematics of a KUKA six-axis arm with an ortho-parallel base and a spherical wrist.

The geometry is one array (6,), ``[a1, a2, c1, c2, c3, c4]`` in mm, named as in Brandstötter, Angerer and
Hofbaur, "An analytical solution of the inverse kinematics problem of industrial serial manipulators with an
ortho-parallel basis and a spherical wrist" (2014); their lateral offset b is zero on every robot here. With
angles in the controller's signs and zero the flange, seen from the robot root, is::

    T = Rz(-A1) Tr(a1,0,c1) Ry(A2) Tr(c2,0,0) Ry(A3) Tr(c3,0,-a2)     wrist centre, forearm along x
        Rx(-A4) Ry(A5) Rx(-A6) Tr(c4,0,0) Ry(90 deg)                  flange, z pointing out of it    (eq. 1)
"""

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.compiled.core import FLOAT, FLOATS, OUT_FLOATS, OUT_INTS32, core_function
from gcode2krl.compiled.inputs import shaped

_flange = core_function("robot_flange", FLOATS, FLOATS, OUT_FLOATS, OUT_FLOATS)
_status_turn = core_function("robot_status_turn", FLOATS, FLOATS, FLOAT, OUT_INTS32, OUT_INTS32)


def flange_pose(q_rad: npt.ArrayLike, geometry: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Return the pose of the flange, eq. 1.

    Parameters
    ----------
    q_rad : (n, 6)
        A1 to A6 with the controller's signs and zero; any number of turns.
    geometry : (6,)
        a1, a2, c1, c2, c3, c4 in mm.

    Returns
    -------
    position_mm : (n, 3)
        Origin of the flange in the robot root.
    rotation : (n, 3, 3)
        Its columns are the flange's x, y and z along the axes of the robot root.

    Raises
    ------
    ValueError
        If an array has the wrong shape.
    """
    q = shaped("q_rad", q_rad, -1, 6)
    position_mm = np.empty((len(q), 3))
    rotation = np.empty((len(q), 3, 3))
    _flange(q, shaped("geometry", geometry, 6), position_mm, rotation)
    return position_mm, rotation


def status_turn(
    q_rad: npt.ArrayLike, geometry: npt.ArrayLike, grid_rad: float = 0.0
) -> tuple[Ints32, Ints32]:
    """Return status S and turn T, the two integers by which KRL selects one set of angles for a pose.

    Status: bit 0, the wrist centre is behind axis 1 (overhead); bit 1, A3 >= phi, where phi = -atan2(a2, c3)
    is the stretched elbow; bit 2, A5 < 0. For A3 and A5 the half circle they lie in decides, which equals the
    plain comparison anywhere within the limits of a real arm. Turn: bit i is set where A(i+1) < 0.

    Parameters
    ----------
    q_rad : (n, 6)
        A1 to A6 with the controller's signs and zero.
    geometry : (6,)
        a1, a2, c1, c2, c3, c4 in mm.
    grid_rad : float
        The angles are rounded to its multiples first, so that a zero of the cell is zero in
        spite of rounding; 0 = no rounding.

    Returns
    -------
    status : (n,)
        0 to 7, the branch index of `all_branches`; 0 where an angle is NaN.
    turn : (n,)
        0 to 63; 0 where the angles are NaN.

    Raises
    ------
    ValueError
        If an array has the wrong shape.
    """
    q = shaped("q_rad", q_rad, -1, 6)
    status, turn = np.empty(len(q), dtype=np.int32), np.empty(len(q), dtype=np.int32)
    _status_turn(q, shaped("geometry", geometry, 6), grid_rad, status, turn)
    return status, turn
