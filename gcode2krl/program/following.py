"""A turntable that follows a five-axis program: it turns as that of a machine with a rotary table would.

The robot can tilt the tool any way, so the table need not turn. Where it does, the tool keeps to one plane
through the table's axis as seen from the robot, and the arm hardly turns: with a the tool axis in ``$BASE``
and z the table's, the table stands at minus the azimuth of a about z, but for a constant.
"""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.units import DEG_PER_RAD

_UPRIGHT_SINE = 0.01
"""A tool that is tilted less points nowhere, 0.6 degrees."""


def following_deg(tool_axis: Floats, table_axis: Floats) -> Floats:
    """Return the angles (p,) in deg of a table that keeps tilted tools in one plane, without full turns.

    Parameters
    ----------
    tool_axis : (p, 3) unit vectors in ``$BASE``.
    table_axis : (3,) unit vector in ``$BASE``; a positive angle turns the table right-handed about it.
    """
    side = np.eye(3)[int(np.argmin(np.abs(table_axis)))]
    x = np.cross(table_axis, np.cross(side, table_axis))
    x /= np.linalg.norm(x)
    y = np.cross(table_axis, x)
    across, along = tool_axis @ y, tool_axis @ x
    tilted = np.flatnonzero(np.hypot(across, along) > _UPRIGHT_SINE)
    if not len(tilted):
        return np.zeros(len(tool_axis))
    azimuth = np.unwrap(np.arctan2(across[tilted], along[tilted]))
    place = np.arange(len(tool_axis))
    turned: Floats = -np.interp(place, tilted, azimuth) * DEG_PER_RAD
    return np.asarray(turned - turned[0])
