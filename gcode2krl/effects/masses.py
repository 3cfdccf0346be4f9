"""Links and payload as points with a mass: what gears carry besides the cutting force.

No robot's data state where the centres of its links are; each is taken half-way between the axes at its ends,
those of the wrist at its centre. That is good to some 20 % of the weight and enough for how a torque changes
with the posture.
"""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.units import MM_PER_M

_LINKS = 6


class Bodies(NamedTuple):
    """The b bodies of an arm along a run; none where the cell states no mass."""

    centre_mm: Floats
    """(m, b, 3) in ``$BASE``."""
    mass_kg: Floats
    """(b,)"""
    carried_by: Ints
    """(b,) number of the last axis, 0 to 5, that moves it."""


def bodies_of(cell: Cell, axes_mm: Floats, tip_mm: Floats, rotation: Floats, tool: Ints32) -> Bodies:
    """Return links, where the robot's masses are stated, and payload, where the cell's load is."""
    count = len(axes_mm)
    centres, masses, carried = [], [], []
    if cell.robot.drives.link_mass_kg is not None:
        ends = np.concatenate([axes_mm[:, 1:], axes_mm[:, -1:]], axis=1)
        centres.append((axes_mm + ends) / 2.0)
        masses += list(cell.robot.drives.link_mass_kg)
        carried += list(range(_LINKS))
    if cell.load.mass_kg is not None:
        centres.append(_payload_mm(cell, tip_mm, rotation, tool)[:, None])
        masses.append(cell.load.mass_kg)
        carried.append(_LINKS - 1)
    centre_mm = np.concatenate([np.zeros((count, 0, 3)), *centres], axis=1)
    return Bodies(centre_mm, np.array(masses, dtype=float), np.array(carried, dtype=int))


def _payload_mm(cell: Cell, tip_mm: Floats, rotation: Floats, tool: Ints32) -> Floats:
    """Return the centre (m, 3) of the payload, which the cell states from the flange along its axes."""
    centre_mm = np.empty_like(tip_mm)
    flange = np.array([cell.load.x_mm, cell.load.y_mm, cell.load.z_mm])
    for number in np.unique(tool):
        rows, frame = tool == number, cell.tool_matrix(int(number))
        from_tip = frame[:3, :3].T @ (flange - frame[:3, 3])
        centre_mm[rows] = tip_mm[rows] + rotation[rows] @ from_tip
    return centre_mm


def torque_Nm(bodies: Bodies, push_N: Floats, axes_mm: Floats, jacobian: Floats) -> Floats:
    """Return the torques (m, 6) of forces (m, b, 3) on the bodies about the axes, positive with the angle.

    The axes' directions are the last rows of the tip's ``jacobian`` (m, 6, 6).
    """
    along = np.swapaxes(jacobian[:, 3:], 1, 2)
    torque = np.zeros(along.shape[:2])
    for body, carried in enumerate(bodies.carried_by):
        lever_mm = bodies.centre_mm[:, body, None] - axes_mm[:, : carried + 1]
        moment = np.cross(lever_mm, push_N[:, body, None])
        torque[:, : carried + 1] += np.sum(along[:, : carried + 1] * moment, axis=2) / MM_PER_M
    return torque
