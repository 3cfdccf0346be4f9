"""Cut a motion out of a grid and read every sample: the core's function and what it writes."""

from typing import NamedTuple

from gcode2krl.arrays import Floats
from gcode2krl.compiled.core import FLOAT, FLOATS, INT, OUT_FLOATS, StructOf, core_function
from gcode2krl.cutting.edge import CUTTERS, WORK
from gcode2krl.cutting.sweep import GRID, PATH

ARCS = 3
"""Engagement arcs that are reported; the widest where there are more."""


class Result(NamedTuple):
    """A row per sample; zero and NaN in air."""

    force_N: Floats
    """(n, 3) on the tool, along the axes of the field."""
    moment_Nmm: Floats
    """(n, 3) about the tip."""
    torque_Nmm: Floats
    a_p_mm: Floats
    a_e_mm: Floats
    phi_rad: Floats
    """(n, 2 * ARCS) pairs, NaN padded."""
    ramp_rad: Floats
    """(n,) angle of descent."""
    centre_mm: Floats
    """(n,) material below the middle of a descending tool."""
    overlap_mm: Floats
    """(n, 3) how far rapid, shank and holder are in the material."""


RESULT = StructOf(**dict.fromkeys(Result._fields, OUT_FLOATS))

cut_strip = core_function(
    "cutting_cut_strip",
    *(GRID, PATH, CUTTERS, FLOATS, FLOATS, FLOATS, FLOAT, FLOAT, INT, FLOAT, WORK, OUT_FLOATS, RESULT),
)
"""Cut all samples one after the other; read those whose coordinate ``axis`` lies in [low, high).

Takes grid, path, cutters, the law (8,), ``f_z_mm`` and ``way_mm`` (n,), low, high, axis, ``reach_mm``, an
`edge.new_work`, ``rapid_mm`` (n,), which gets the height that rapids cut off, and a `Result`. Sweeps farther
than ``reach_mm`` from the strip are left out: the field outside is another strip's. The reading of a sample
depends only on the samples before it, not on how the field is divided.
"""
