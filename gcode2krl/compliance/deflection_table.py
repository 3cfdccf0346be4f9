"""The stage: Joints and Forces to Deflection."""

import math

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.compliance.deflection import deflection_of, feed_direction
from gcode2krl.tables import Deflection, Forces, Joints


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
    return deflect_at(joints.q_rad, joints.qd_rad_s, forces, cell)


def deflect_at(q_rad: Floats, qd_rad_s: Floats, forces: Forces, cell: Cell) -> Deflection:
    """Return what `deflect` returns, from joints (m, 6) in rad and their speeds (m, 6) in rad/s."""
    feed = feed_direction(q_rad, qd_rad_s, cell, forces.tool)
    deflection, correction = deflection_of(
        q_rad, forces.force_base_N, forces.moment_base_Nmm, feed, cell, forces.tool
    )
    return Deflection(
        deflection_base_mm=deflection,
        correction_base_mm=correction,
        relative_band=math.hypot(forces.relative_band, cell.compliance.relative_band),
    )
