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

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import FLOAT, FLOATS, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import distinct
from gcode2krl.cutting.law import feed_per_tooth, law_array
from gcode2krl.tables import Forces, Motion, Toolpath

AMPLITUDE_MM = 0.1
"""Displacement over which an arc's end is followed, a usual amplitude of such chatter."""
TANGENT_RAD = 0.1
"""An arc's end nearer than this to 0 or pi is the tangent of the wall that the tool cuts."""
_process_stiffness = core_function(
    "cutting_process_stiffness", *(FLOATS,) * 6, FLOAT, FLOAT, FLOATS, OUT_FLOATS
)


def stiffness_of_cut(rows: Ints, forces: Forces, motion: Motion, toolpath: Toolpath, cell: Cell) -> Floats:
    """Return dF/du (n, 3, 3) in N/mm at ``rows`` (n,) of the tables, all of which cut.

    Raises an input error where the material has no law.
    """
    law = law_array(cell.material) if cell.material is not None else np.zeros(8)
    result, numbers = np.empty((len(rows), 3, 3)), forces.tool[rows]
    for number in distinct(numbers).tolist():
        mine = numbers == number
        at, tool = rows[mine], cell.tool[number]
        f_z_mm = feed_per_tooth(motion.speed_mm_s[at], toolpath.spindle_rad_s[motion.move[at]], tool.teeth)
        arcs, load = (forces.phi_rad[at], forces.a_p_mm[at], f_z_mm), forces.force_base_N[at]
        way = motion.direction[at], motion.rotation[at]
        result[mine] = process_stiffness(*arcs, load, *way, tool.teeth, tool.diameter_mm, law)
    return result


def process_stiffness(
    phi_rad: Floats,
    a_p_mm: Floats,
    f_z_mm: Floats,
    force_N: Floats,
    direction: Floats,
    rotation: Floats,
    teeth: int,
    diameter_mm: float,
    law: Floats,
) -> Floats:
    """Return dF/du (n, 3, 3) in N/mm: column j is the change of the mean force by a displacement along j.

    ``phi_rad`` (n, 2k) as in `mean_force`, NaN pairs are none; ``force_N`` (n, 3) on the tool and
    ``direction`` (n, 3) of its motion along the same axes, in which ``rotation`` (n, 4) are the quaternions
    of the tool frame; ``law`` (8,) of `law_array`.
    """
    change = np.empty((len(a_p_mm), 9))
    sample = (phi_rad, a_p_mm, f_z_mm, force_N, direction, rotation)
    _process_stiffness(*sample, float(teeth), diameter_mm, law, change)
    return change.reshape(-1, 3, 3)
