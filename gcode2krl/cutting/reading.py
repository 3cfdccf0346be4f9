"""Cut a motion out of a grid and read every sample: the core's function and what it writes."""

from typing import NamedTuple

from gcode2krl.arrays import Bools, Floats
from gcode2krl.compiled.core import (
    BOOLS,
    FLOAT,
    FLOATS,
    INT,
    INTS32,
    OUT_BOOLS,
    OUT_FLOATS,
    OUT_INTS,
    StructOf,
    core_function,
)
from gcode2krl.cutting.edge import CUTTERS, WORK
from gcode2krl.cutting.sweep import GRID, PATH, SAMPLES

ARCS = 3
"""Engagement arcs that are reported; the widest where there are more."""
NODE_NUMBERS = 15 + 2 * ARCS
"""What the core keeps of the node that was read last."""
PROGRESS = 3
"""Numbers that say how far a strip has come: first the last point that was passed, then the last one whose
sweep is removed."""


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
    is_read: Bools
    """(n,) False where a row lies between those of the samples read before and after it."""


RESULT = StructOf.record(Result, written=Result._fields)

mark_nodes = core_function("cutting_mark_nodes", SAMPLES, BOOLS, FLOATS, FLOATS, INT, OUT_BOOLS, OUT_FLOATS)
"""Mark the samples (n,) at which the engagement is read in any case.

Takes samples, whether each is rapid, the distance (t,) in mm between two nodes of a tool, that (t,) for which
every sample behind a change is one, whether the motion ends with them, the marks, and ``settled_mm`` (n,),
which has to begin with that of the first sample (-inf at the start of a motion). A node stands where the tool
has gone so far, where its way turns by 10° and wherever tool or kind of move changes; behind such a place
every sample is one up to ``settled_mm``. That is NaN at samples at which a motion cannot be divided in two.
"""

mark_corners = core_function(
    "cutting_mark_corners", FLOATS, FLOATS, BOOLS, BOOLS, INTS32, FLOATS, BOOLS, OUT_BOOLS
)
"""Mark the points (k,) between which a path is straight.

Takes `Path.position_mm`, ``way_mm``, ``first``, ``rapid`` and ``tool`` of all points, the longest sweep of a
tool (t,) in mm, whether its sweeps along a slope have to be short (t,), and the marks.
"""

cut_strip = core_function(
    "cutting_cut_strip",
    *(GRID, PATH, SAMPLES, CUTTERS, FLOATS, FLOAT, FLOAT, INT, FLOAT, FLOAT, INT),
    *(WORK, OUT_INTS, OUT_FLOATS, OUT_FLOATS, RESULT),
)
"""Cut all samples one after the other; write the rows of those whose coordinate ``axis`` lies in [low, high).

Takes grid, path, samples, cutters, the law (8,), low, high, axis, ``reach_mm``, ``apart_mm``, whether the
motion ends with these samples, an `edge.new_work`, how far the strip has come (`PROGRESS` and
`NODE_NUMBERS`, zeros at the start), ``rapid_mm`` (p,), which gets the height that rapids cut off, a row a
point whose sweep was not removed before, and a `Result`. Sweeps farther than ``reach_mm`` from the strip
are left out: the field outside is another strip's. Nodes up to ``apart_mm`` outside are read as well. The
reading of a sample depends only on the samples before it, not on how the field or the samples are divided.
Of samples that go on behind others the first is the last of those, a node, which is not read again.
"""

mark_walls = core_function("cutting_mark_walls", GRID, OUT_BOOLS)
"""Mark the points (p,) at which the sweeps begin and end whose walls a grid shows."""

number_walls = core_function("cutting_number_walls", GRID, INTS32)
"""Give the sweeps whose walls a grid shows the new numbers (p,) of the points at which they end."""
