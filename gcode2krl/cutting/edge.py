"""The edges of the tools, and the memory in which the compiled core reads the material in front of them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats, Ints
from gcode2krl.compiled.core import StructOf

BAND_COLUMNS = 7
_MOST_BINS = 1024
CHUNK = 32
"""Bins that a compiled loop takes at once; rows have as many to spare."""


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

    turn: NDArray[np.float32]
    """(9, bins) sin and cos of the wall's and the ring's bins; over the ring's bins the integrals of 1,
    sin, cos, sin², sin·cos."""
    heading: NDArray[np.float32]
    """(2, bins) x and y of the directions of the bins."""
    rows: NDArray[np.float32]
    """(5, bins) thickness above a band's lower and upper ring, each with the material's top; engaged
    fraction, of a rim the depth."""
    reach: NDArray[np.float32]
    """(2, bins) largest radius of the edge that is engaged, 0 = none; largest height of material there."""


def new_work() -> Work:
    """Return scratch memory for one thread."""
    return Work(*(np.zeros((rows, _MOST_BINS + CHUNK), np.float32) for rows in (9, 2, 5, 2)))


CUTTERS = StructOf.record(Cutters)
WORK = StructOf.record(Work, written=Work._fields)
