"""Projection of a correction into the plane normal to the feed: eq. 10-11 of Haehn & Weigold 2020."""

import numba
import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats
from gcode2krl.compliance.rows import rows_of


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


@numba.njit(cache=True, nogil=True, error_model="numpy")
def project_rows(r: Floats, v: Floats, factor: float, normal: Floats) -> None:
    """Write ``factor`` times the component of each row of r (n, 3) normal to that of v (n, 3)."""
    for i in range(len(r)):
        rx, ry, rz = r[i]
        vx, vy, vz = v[i]
        largest = max(abs(vx), abs(vy), abs(vz))
        if largest != 0.0:
            vx, vy, vz = vx / largest, vy / largest, vz / largest  # eq. 11
            along = (rx * vx + ry * vy + rz * vz) / (vx * vx + vy * vy + vz * vz)
            rx, ry, rz = rx - along * vx, ry - along * vy, rz - along * vz  # eq. 10
        normal[i, 0] = factor * rx + 0.0  # + 0.0: never a negative zero
        normal[i, 1] = factor * ry + 0.0
        normal[i, 2] = factor * rz + 0.0
