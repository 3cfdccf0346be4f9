"""Forward kinematics of a KUKA six-axis arm with an ortho-parallel base and a spherical wrist.

The geometry is one array (6,), ``[a1, a2, c1, c2, c3, c4]`` in mm, named as in Brandstötter, Angerer and
Hofbaur, "An analytical solution of the inverse kinematics problem of industrial serial manipulators with an
ortho-parallel basis and a spherical wrist" (2014); their lateral offset b is zero on every robot here. With
angles in the controller's signs and zero the flange, seen from the robot root, is::

    T = Rz(-A1) Tr(a1,0,c1) Ry(A2) Tr(c2,0,0) Ry(A3) Tr(c3,0,-a2)     wrist centre, forearm along x
        Rx(-A4) Ry(A5) Rx(-A6) Tr(c4,0,0) Ry(90 deg)                  flange, z pointing out of it    (eq. 1)
"""

import math

import numba
import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.compiled.inputs import read_only


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
    q = read_only("q_rad", q_rad, -1, 6)
    position_mm = np.empty((len(q), 3))
    rotation = np.empty((len(q), 3, 3))
    _flange_rows(q, read_only("geometry", geometry, 6), position_mm, rotation)
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
    q = read_only("q_rad", q_rad, -1, 6)
    status, turn = np.empty(len(q), dtype=np.int32), np.empty(len(q), dtype=np.int32)
    _status_rows(q, read_only("geometry", geometry, 6), grid_rad, status, turn)
    return status, turn


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _status_rows(q: Floats, geometry: Floats, grid_rad: float, status: Ints32, turn: Ints32) -> None:
    a1, a2, _, c2, c3, _ = geometry
    stretched, forearm = math.atan2(a2, c3), math.hypot(a2, c3)
    angle = np.empty(6)
    for i in range(q.shape[0]):
        turns = 0
        for j in range(6):
            angle[j] = np.rint(q[i, j] / grid_rad) * grid_rad if grid_rad > 0.0 else q[i, j]
            if angle[j] < 0.0:
                turns |= 1 << j
        elbow = angle[2] + stretched
        bits = 0
        if a1 + c2 * math.cos(angle[1]) + forearm * math.cos(angle[1] + elbow) < 0.0:
            bits |= 1
        if _wrapped(elbow) >= 0.0:
            bits |= 2
        if _wrapped(angle[4]) < 0.0:
            bits |= 4
        status[i], turn[i] = bits, turns


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _wrapped(angle_rad: float) -> float:
    """Return the same direction in (-pi, pi]; an angle already there is returned unchanged."""
    turns = np.ceil((angle_rad - math.pi) / (2.0 * math.pi))
    return angle_rad - 2.0 * math.pi * turns  # type: ignore[no-any-return]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _flange_rows(q: Floats, geometry: Floats, position_mm: Floats, rotation: Floats) -> None:
    a1, a2, c1, c2, c3, c4 = geometry
    for i in range(q.shape[0]):
        cos_1, sin_1 = math.cos(q[i, 0]), math.sin(q[i, 0])
        cos_2, sin_2 = math.cos(q[i, 1]), math.sin(q[i, 1])
        cos_23, sin_23 = math.cos(q[i, 1] + q[i, 2]), math.sin(q[i, 1] + q[i, 2])
        cos_4, sin_4 = math.cos(q[i, 3]), math.sin(q[i, 3])
        cos_5, sin_5 = math.cos(q[i, 4]), math.sin(q[i, 4])
        cos_6, sin_6 = math.cos(q[i, 5]), math.sin(q[i, 5])
        # columns of Rx(-A4) Ry(A5) Rx(-A6) Ry(90 deg): the flange's axes along those of the forearm
        flange = (
            (-sin_5 * cos_6, -cos_4 * sin_6 - sin_4 * cos_5 * cos_6, sin_4 * sin_6 - cos_4 * cos_5 * cos_6),
            (-sin_5 * sin_6, cos_4 * cos_6 - sin_4 * cos_5 * sin_6, -sin_4 * cos_6 - cos_4 * cos_5 * sin_6),
            (cos_5, -sin_4 * sin_5, -cos_4 * sin_5),
        )
        for column in range(3):
            x, y, z = flange[column]
            along = cos_23 * x + sin_23 * z  # the arm's plane, then Rz(-A1)
            rotation[i, 0, column] = cos_1 * along + sin_1 * y
            rotation[i, 1, column] = -sin_1 * along + cos_1 * y
            rotation[i, 2, column] = -sin_23 * x + cos_23 * z
        radius = a1 + c2 * cos_2 + c3 * cos_23 - a2 * sin_23
        height = c1 - c2 * sin_2 - c3 * sin_23 - a2 * cos_23
        position_mm[i, 0] = cos_1 * radius + c4 * rotation[i, 0, 2]
        position_mm[i, 1] = -sin_1 * radius + c4 * rotation[i, 1, 2]
        position_mm[i, 2] = height + c4 * rotation[i, 2, 2]
