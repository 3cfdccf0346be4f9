"""How the mean cutting force changes where the tool's tip is displaced: the process stiffness.

Only slow displacements count, far below tooth passing, of a tool that goes on along its feed:

- along the axis the depth of cut changes, and the force with it: -F/a_p. Exact for a flat mill; of round
  edges, whose force is not proportional to the depth, it is the mean from nothing up to this depth;
- normal to feed and axis an arc begins or ends elsewhere: where it does not end at the tangent of its own
  wall, it ends at a plane face along the feed, which stays where it is. The force there is that of an edge at
  that angle, taken as a cylinder's;
- along the feed nothing changes.

In a slot both ends are the tool's own walls, and only the depth counts. Derived from the linear edge law
(Altintas, Manufacturing Automation, 2nd ed. 2012, ch. 2) in its convention of angles, see `cutting.force`.
"""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.compiled.inputs import distinct
from gcode2krl.cutting.law import KIENZLE, feed_per_tooth, law_array
from gcode2krl.frames import rotation_from_quaternion
from gcode2krl.tables import Forces, Motion, Toolpath

AMPLITUDE_MM = 0.1
"""Displacement over which an arc's end is followed, a usual amplitude of such chatter."""
_TANGENT_RAD = 0.1
"""An arc's end nearer than this to 0 or pi is the tangent of the wall that the tool cuts."""


def stiffness_of_cut(forces: Forces, motion: Motion, toolpath: Toolpath, cell: Cell) -> Floats:
    """Return dF/du (m, 3, 3) in N/mm along ``$BASE``: column j is the change by a displacement along axis j.

    Rows as in ``forces`` and ``motion``; 0 where nothing is cut. Raises an input error where the material has
    no law.
    """
    law = law_array(cell.material) if cell.material is not None else np.zeros(8)
    result = np.zeros((len(forces), 3, 3))
    cuts = np.isfinite(forces.phi_rad[:, 0]) & (forces.a_p_mm > 0.0)
    for number in distinct(forces.tool[cuts]):
        rows = np.flatnonzero(cuts & (forces.tool == number))
        tool, move = cell.tool[int(number)], motion.move[rows]
        depth_mm = forces.a_p_mm[rows]
        axis = rotation_from_quaternion(np.ascontiguousarray(motion.rotation[rows]))[:, :, 2]
        feed = across(motion.direction[rows], axis)
        normal = np.cross(axis, feed)
        f_z_mm = feed_per_tooth(motion.speed_mm_s[rows], toolpath.spindle_rad_s[move], tool.teeth)
        local = side_slope(forces.phi_rad[rows], depth_mm, f_z_mm, tool.teeth, tool.diameter_mm, law)
        sideways = local[:, :1] * feed + local[:, 1:2] * normal - local[:, 2:] * axis
        deeper = -forces.force_base_N[rows] / depth_mm[:, None]
        result[rows] = sideways[:, :, None] * normal[:, None, :] + deeper[:, :, None] * axis[:, None, :]
    return result


def across(direction: Floats, axis: Floats) -> Floats:
    """Return the unit direction (n, 3) of a motion across unit axes (n, 3), zero where it is along them."""
    part = direction - axis * np.einsum("ij,ij->i", direction, axis)[:, None]
    size = np.linalg.norm(part, axis=1, keepdims=True)
    return np.asarray(np.divide(part, size, out=np.zeros_like(part), where=size > 1e-9))


def side_slope(
    phi_rad: Floats, a_p_mm: Floats, f_z_mm: Floats, teeth: int, diameter_mm: float, law: Floats
) -> Floats:
    """Return the change of the mean force (n, 3), feed, normal and axial, in N/mm towards the feed normal.

    ``phi_rad`` (n, 2k) as in `mean_force`; ``law`` (8,) of `law_array`.
    """
    slope = np.zeros((len(phi_rad), 3))
    for end in range(phi_rad.shape[1]):
        phi = phi_rad[:, end]
        free = np.isfinite(phi) & (phi > _TANGENT_RAD) & (phi < np.pi - _TANGENT_RAD)
        phi = np.where(free, phi, np.pi / 2.0)
        reach = 2.0 * AMPLITUDE_MM / diameter_mm
        there, back = (np.arccos(np.clip(np.cos(phi) - way, -1.0, 1.0)) for way in (reach, -reach))
        turn = (there - back) / (2.0 * AMPLITUDE_MM) * (1.0 if end % 2 else -1.0)
        t, r, a = _edge_force(f_z_mm * np.sin(phi), law)
        edge = np.stack([-t * np.cos(phi) - r * np.sin(phi), t * np.sin(phi) - r * np.cos(phi), a], axis=1)
        slope += np.where(free, teeth * a_p_mm / (2.0 * np.pi) * turn, 0.0)[:, None] * edge
    return slope


def _edge_force(chip_mm: Floats, law: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the tangential, radial and axial force in N/mm of width on a chip (n,)."""
    if law[0] == KIENZLE:
        t = law[1] * np.maximum(chip_mm, 0.0) ** (1.0 - law[2])
        return t, law[3] * t, law[4] * t
    t, r, a = (law[1 + q] * chip_mm + law[4 + q] for q in range(3))
    return t, r, a
