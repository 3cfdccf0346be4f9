"""The edges of the tools, and the memory in which the compiled core reads the material in front of them."""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.compiled.core import StructOf

BAND_COLUMNS = 7
_MOST_BINS = 1024


class Cutters(NamedTuple):
    """What the core needs to know of each tool, one row a tool."""

    bands: Floats
    """(t, s, 7) stretches of the edge from the tip up: z low and high, r low and high, sin and cos of the
    edge angle, contact width."""
    used: Ints
    """(t,) bands in use."""
    wall_bins: Ints
    """(t,) points all around the rim, a multiple of 4."""
    ring_bins: Ints
    """(t,) points all around a ring between two bands, a multiple of 4."""
    teeth: Floats
    lag_mm: Floats
    """(t,) distance by which the field lags behind the cutter."""
    above: Floats
    """(t, 4) shank: radius, height of its lower end; holder: the same; radius 0 = not checked."""


class Work(NamedTuple):
    """Scratch memory of one thread."""

    turn: Floats
    """(8, bins) sin and cos of the wall's and the ring's bins; over the ring's bins the integrals of sin,
    cos, sin², sin·cos."""
    heading: Floats
    """(2, bins) x and y of the directions of the bins."""
    rows: Floats
    """(5, bins) thickness above a band's lower and upper ring, each with the material's top; engaged
    fraction."""
    reach: Floats
    """(2, bins) largest radius of the edge that is engaged, 0 = none; largest height of material there."""


def new_work() -> Work:
    """Return scratch memory for one thread."""
    return Work(*(np.zeros((rows, _MOST_BINS)) for rows in (8, 2, 5, 2)))


CUTTERS = StructOf.record(Cutters)
WORK = StructOf.record(Work, written=Work._fields)
