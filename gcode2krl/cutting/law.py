"""How much force a chip takes: the material's law as numbers, the chip from speed and spindle, its limits."""

import numpy as np
from numpy.typing import ArrayLike

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections import Material
from gcode2krl.errors import input_error
from gcode2krl.units import MM_PER_M, RAD_PER_REV

LINEAR_EDGE, KIENZLE = 0, 1
"""Kinds of law: ``[LINEAR_EDGE, Ktc, Krc, Kac, Kte, Kre, Kae, 0]`` or ``[KIENZLE, kc11, mc, radial ratio,
axial ratio, 0, 0, 0]``."""

THIN_CHIP_MM = 0.005
"""Below this largest chip an edge rubs and ploughs rather than cuts: an assumption, about the edge radius of
a sharp carbide mill; the smallest chip that still comes off is 0.2-0.4 of that radius. Linear edge
coefficients, fitted above it, then overestimate the force and say nothing about heat and wear."""

THICK_CHIP_MM = 0.2
"""Above this largest chip the linear edge sets of the library are extrapolated: fitted at 0.025-0.2 mm a
tooth."""


def law_array(material: Material) -> Floats:
    """Return a material's force law (8,) as compiled code takes it (see `KIENZLE`).

    Raises an input error where the material has no law.
    """
    if material.kienzle is not None:
        law = material.kienzle
        values = (KIENZLE, law.kc11, law.mc, law.radial_ratio, law.axial_ratio, 0.0, 0.0, 0.0)
        return np.array(values)
    if material.linear_edge is None:
        raise input_error(
            "material-without-law",
            f"[material] {material.model or material.name!r} has neither linear_edge nor kienzle",
            "give one of them, or name a material of the library (`gcode2krl models list`)",
        )
    return linear_edge_law(material.linear_edge.array())


def linear_edge_law(coefficients: ArrayLike) -> Floats:
    """Return the law (8,) of Ktc, Krc, Kac in N/mm² and Kte, Kre, Kae in N/mm (6,)."""
    six = np.asarray(coefficients, dtype=float)
    if six.shape != (6,) or not np.isfinite(six).all():
        raise input_error(
            "force-input",
            f"coefficients: found {six.tolist()}, allowed: six finite numbers Ktc, Krc, Kac, Kte, Kre, Kae",
        )
    return np.array([LINEAR_EDGE, *six, 0.0])


def feed_per_tooth(speed_mm_s: ArrayLike, spindle_rad_s: ArrayLike, teeth: int) -> Floats:
    """Return the feed per tooth f_z = 2·pi·v/(N·|omega|) in mm (n,), 0 where the spindle is stopped.

    `speed_mm_s` is the predicted speed along the path, plunges included, not the programmed feed. Without
    rotation there is no chip, so no force; moving through material then is a collision, reported elsewhere.
    """
    speed, omega = np.broadcast_arrays(
        np.abs(np.asarray(speed_mm_s, dtype=float)), np.abs(np.asarray(spindle_rad_s, dtype=float))
    )
    turning = omega > 0.0
    per_tooth = RAD_PER_REV * speed / (teeth * np.where(turning, omega, 1.0))
    return np.asarray(np.where(turning, per_tooth, 0.0))


def spindle_power(torque_Nmm: ArrayLike, spindle_rad_s: ArrayLike) -> Floats:
    """Return the cutting power (n,) in W: torque times speed of rotation, without losses of the spindle."""
    torque = np.asarray(torque_Nmm, dtype=float)
    return np.asarray(torque * np.abs(np.asarray(spindle_rad_s, dtype=float)) / MM_PER_M)
