"""The stage: Joints and Forces to Deflection."""

import math

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import points_moved, to_rest, vectors_turned
from gcode2krl.compliance.deflection import deflection_along, deflection_of, feed_direction, tip_position
from gcode2krl.compliance.model import stiffness
from gcode2krl.frames import invert
from gcode2krl.tables import Deflection, Forces, Joints, chord_directions


def deflect(joints: Joints, forces: Forces, cell: Cell) -> Deflection:
    """Return how far the tool tip bends away under the forces, and the correction normal to the feed.

    The feed direction is that of the tip's velocity, from the joints and their speeds. The band combines
    those of forces and stiffness as independent (root of the sum of squares; an assumption).

    Parameters
    ----------
    joints, forces : tables of the same rows, from one Motion.
    cell : its virtual joints.

    Raises
    ------
    NotUnderstoodError
        Where the cell does not state the stiffness of every virtual joint.
    ValueError
        Where the tables differ in length.

    Examples
    --------
    >>> from gcode2krl import Prediction, deflect
    >>> prediction = Prediction.load("prediction")
    >>> deflect(prediction.joints, prediction.forces, prediction.cell)
    Deflection(... samples, up to ... mm)
    """
    if len(joints) != len(forces):
        raise ValueError(f"joints have {len(joints)} rows, forces {len(forces)}")
    return deflect_at(joints.q_rad, joints.qd_rad_s, joints.external, forces, cell)


def deflect_at(q_rad: Floats, qd_rad_s: Floats, external: Floats, forces: Forces, cell: Cell) -> Deflection:
    """Return what `deflect` returns, from joints (m, 6), their speeds (m, 6) and E1 to E6 (m, 6)."""
    force, moment = forces.force_base_N, forces.moment_base_Nmm
    by = to_rest(external, cell)
    if by is None:
        deflection, correction = deflection_along(q_rad, qd_rad_s, force, moment, cell, forces.tool)
    else:
        feed = (
            vectors_turned(_feed_on_part(q_rad, by, forces.tool, cell), by)
            if len(by) > 1  # the tip goes along the part otherwise than along the arm's root
            else feed_direction(q_rad, qd_rad_s, cell, forces.tool)
        )
        load = vectors_turned(force, by), vectors_turned(moment, by)
        bent = deflection_of(q_rad, *load, feed, cell, forces.tool)
        deflection, correction = (vectors_turned(vector, invert(by)) for vector in bent)
    return Deflection(
        deflection_base_mm=deflection,
        correction_base_mm=correction,
        relative_band=math.hypot(forces.relative_band, stiffness(cell).relative_band),
    )


def _feed_on_part(q_rad: Floats, by: Floats, tool: Ints32, cell: Cell) -> Floats:
    """Return the directions (m, 3) in which the tip goes along ``$BASE``, from the chords of its positions.

    ``by`` (m, 4, 4) as from `to_rest`.
    """
    base = cell.base_matrix()
    seen_mm = (tip_position(q_rad, cell, tool) - base[:3, 3]) @ base[:3, :3]
    return chord_directions(points_moved(seen_mm, invert(by)))
