"""Projection of a correction into the plane normal to the feed: eq. 10-11 of Haehn & Weigold 2020."""

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats
from gcode2krl.compiled.core import FLOAT, FLOATS, OUT_FLOATS, core_function
from gcode2krl.compliance.rows import rows_of

_project = core_function("compliance_project", FLOATS, FLOATS, FLOAT, OUT_FLOATS)
_directions = core_function("compliance_directions", OUT_FLOATS, FLOAT)


def project_normal(r: npt.ArrayLike, v: npt.ArrayLike) -> Floats:
    """Return the component of r normal to v, eq. 10-11.

    At a standstill there is no feed direction: rows with |v| = 0 come back unchanged. Any other v
    is projected out, however short, because it is scaled by its largest component before it is squared.

    Parameters
    ----------
    r : (n, 3)
        Correction, or any vector.
    v : (n, 3), or (3,) for all rows
        Feed direction along the same axes; its length does not matter.

    Returns
    -------
    normal : (n, 3)
        In the unit of r, with no component along v to rounding.

    Raises
    ------
    ValueError
        If an array has the wrong shape.
    """
    r_rows = rows_of("r", r, 3)
    normal = np.empty_like(r_rows)
    project_rows(r_rows, rows_of("v", v, 3, len(r_rows)), 1.0, normal)
    return normal


def project_rows(r: Floats, v: Floats, factor: float, normal: Floats) -> None:
    """Write ``factor`` times the component of each row of r (n, 3) normal to that of v (n, 3)."""
    _project(r, v, factor, normal)


def make_directions(velocity: Floats, least: float) -> None:
    """Make velocities (n, 3) their unit vectors in place, zero where one is less than ``least``."""
    _directions(velocity, least)
