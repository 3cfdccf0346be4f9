"""From tool axis and spin to the tool frame: a mill may be turned freely about its own axis."""

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats


def tool_rotation(axis: Floats, spin_rad: Floats | float) -> Floats:
    """Return tool frames as quaternions (n, 4) whose z is ``axis`` (n, 3).

    At zero spin the frame is ``$BASE`` turned by the smallest angle from z to the axis, so a 3-axis program
    has A = B = C = 0; ``spin_rad`` (n,) or a number then turns it about the axis. An axis along -z is
    reached by a half turn about x.
    """
    constant = len(axis) == 0 or (axis.strides[0] == 0 or bool(np.all(axis == axis[0])))
    if constant and np.ndim(spin_rad) == 0 and len(axis):
        rotation = _rotation(axis[:1], np.asarray([float(spin_rad)]))
        return np.broadcast_to(rotation, (len(axis), 4))
    return _rotation(axis, np.broadcast_to(np.asarray(spin_rad, dtype=float), (len(axis),)))


def _rotation(axis: Floats, spin_rad: Floats) -> Floats:
    x, y, z = axis[:, 0], axis[:, 1], axis[:, 2]
    across = x * x + y * y
    upside_down = (z < 0.0) & (across == 0.0)
    one_and_z = np.where(z < 0.0, across / (1.0 + np.abs(z)), 1.0 + z)  # the same, without cancellation
    scale = np.sqrt(2.0 * np.where(upside_down, 1.0, one_and_z))
    tilt = np.stack([-y / scale, x / scale, np.zeros_like(z), scale / 2.0], axis=1)
    tilt[upside_down] = [1.0, 0.0, 0.0, 0.0]
    half = spin_rad / 2.0
    c, s = np.cos(half), np.sin(half)
    tx, ty, _, tw = tilt.T
    turned = np.stack([tx * c + ty * s, ty * c - tx * s, tw * s, tw * c], axis=1)
    return fr.quaternion_from_rotation(fr.rotation_from_quaternion(turned))
