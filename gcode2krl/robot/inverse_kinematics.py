"""Closed-form inverse kinematics of the arm of `kinematics`: all eight branches, or one along a path.

The index of a branch is KUKA's status S: bit 0 overhead, bit 1 elbow (A3 >= phi), bit 2 wrist (A5 < 0).
The wrist centre splits the problem (Pieper 1968): A1 from the direction to it, A2 and A3 from a planar
triangle by the law of cosines, A4 to A6 from the remaining rotation. All angles come from atan2 of a
direction (y, x), and A6 from the rotation that remains after A4, so a pose next to a singularity is solved as
exactly as any other.
"""

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats
from gcode2krl.compiled.core import FLOATS, INT, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import shaped

_POSES = (FLOATS, FLOATS, FLOATS)
"""Positions (n, 3), rotations (n, 3, 3) or one for all, geometry (6,)."""
_all_branches = core_function("robot_all_branches", *_POSES, OUT_FLOATS)
_directions = core_function("robot_directions", *_POSES, INT, OUT_FLOATS, OUT_FLOATS, returns=INT)
_wind = core_function("robot_wind", FLOATS, FLOATS, OUT_FLOATS)
_path = core_function("robot_path", *_POSES, INT, FLOATS, OUT_FLOATS)

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
    position = shaped("position_mm", position_mm, -1, 3)
    axes = shaped("rotation", rotation, len(position), 3, 3)
    q_rad = np.empty((len(position), 8, 6))
    _all_branches(position, axes, shaped("geometry", geometry, 6), q_rad)
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
    reference = shaped("q_reference_rad", q_reference_rad, 6)
    if not np.isfinite(reference).all():
        raise ValueError("q_reference_rad is not finite")
    position = shaped("position_mm", position_mm, -1, 3)
    axes = shaped("rotation", rotation, 1 if np.shape(rotation)[0] == 1 else len(position), 3, 3)
    shape = shaped("geometry", geometry, 6)
    q_rad = np.empty((len(position), 6))
    room = np.empty((2, 6 * _BLOCK))
    for first in range(0, len(position), _BLOCK):
        rows = slice(first, first + _BLOCK)
        turned, q_part = axes[rows] if len(axes) > 1 else axes, q_rad[rows]
        y, x = (column[: 6 * len(q_part)].reshape(6, len(q_part)) for column in room)
        if _directions(position[rows], turned, shape, int(branch), y, x):
            _wind(np.arctan2(y, x, out=y), reference, q_part)  # numpy's is the faster arc tangent
        else:
            _path(position[rows], turned, shape, int(branch), reference, q_part)
        reached = np.flatnonzero(q_part[:, 0] == q_part[:, 0])
        if len(reached):
            reference = shaped("q_reference_rad", q_part[reached[-1]], 6)
    return q_rad
