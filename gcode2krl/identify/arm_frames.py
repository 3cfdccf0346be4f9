"""Where the virtual joints are: the undeformed frames of the elastic chain."""

import numpy as np
from numpy.typing import ArrayLike

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.compliance.chain import AXIS_FRAME, AXIS_SIGN, AXIS_ZERO
from gcode2krl.compliance.model import frames as chain_frames


def joint_frames(q_rad: ArrayLike, cell: Cell) -> Floats:
    """Return the frames of the virtual joints in the robot root, in the order of `sections.VIRTUAL_JOINTS`.

    Frame i follows from its predecessor by Rx(alpha)·Tx(a)·Tz(d)·Rz(theta) (Hähn & Weigold 2020, eq. 1, with
    b = 0); a virtual joint sits at the origin of its frame and turns about the frame's axes (eq. 3). Lengths
    and places are those of `model.frames`.

    Parameters
    ----------
    q_rad : (n, 6)
        A1 to A6 with the controller's signs and zero.

    Returns
    -------
    (n, 10, 4, 4)
        Translations in mm.
    """
    q = np.atleast_2d(np.asarray(q_rad, dtype=float))
    steps = chain_frames(cell)
    theta = np.zeros((len(q), len(steps)))
    theta[:, AXIS_FRAME] = q * AXIS_SIGN + AXIS_ZERO
    poses = np.empty((len(q), len(steps), 4, 4))
    frame = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    for number, (cos, sin, a_mm, d_mm) in enumerate(steps):
        tilt = np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
        turn = np.zeros((len(q), 3))
        turn[:, 0] = theta[:, number]
        step = fr.transform(tilt @ np.array([a_mm, 0.0, d_mm]), tilt @ fr.rotation_from_abc(turn))
        frame = poses[:, number] = frame @ step
    return poses
