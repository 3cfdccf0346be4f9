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
    """(m, b)"""
    carried_by: Ints
    """(b,) number of the last axis, 0 to 5, that moves it."""


def bodies_of(cell: Cell, axes_mm: Floats, tip_mm: Floats, rotation: Floats, tool: Ints32) -> Bodies:
    """Return links, where the robot's masses are stated, and payload, where the cell's load is."""
    count = len(axes_mm)
    centres, masses, carried = [], [], []
    if cell.robot.drives.link_mass_kg is not None:
        ends = np.concatenate([axes_mm[:, 1:], axes_mm[:, -1:]], axis=1)
        centres.append((axes_mm + ends) / 2.0)
        masses.append(np.tile(cell.robot.drives.link_mass_kg, (count, 1)))
        carried += list(range(_LINKS))
    payload_kg, payload_mm = _payload(cell, tip_mm, rotation, tool)
    if payload_kg.any():
        centres.append(payload_mm[:, None])
        masses.append(payload_kg[:, None])
        carried.append(_LINKS - 1)
    centre_mm = np.concatenate([np.zeros((count, 0, 3)), *centres], axis=1)
    mass_kg = np.concatenate([np.zeros((count, 0)), *masses], axis=1)
    return Bodies(centre_mm, mass_kg, np.array(carried, dtype=int))


def _payload(cell: Cell, tip_mm: Floats, rotation: Floats, tool: Ints32) -> tuple[Floats, Floats]:
    """Return mass (m,) and centre (m, 3) of the payload, stated from the flange; 0 kg where it is not."""
    mass_kg, centre_mm = np.zeros(len(tip_mm)), np.array(tip_mm)
    for number in np.unique(tool):
        rows, load = tool == number, cell.load_of(int(number))
        if load.mass_kg is None:
            continue
        frame, flange = cell.tool_matrix(int(number)), np.array([load.x_mm, load.y_mm, load.z_mm])
        from_tip = frame[:3, :3].T @ (flange - frame[:3, 3])
        mass_kg[rows] = load.mass_kg
        centre_mm[rows] = tip_mm[rows] + rotation[rows] @ from_tip
    return mass_kg, centre_mm


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
