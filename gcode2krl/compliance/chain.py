"""The elastic chain of Haehn & Weigold 2020, eq. 1-9: compiled loops over rows of joints and loads.

A frame follows from the one before by T_i = Rx(alpha)·Tx(a)·Tz(d)·Rz(theta) (eq. 1; their Ty(b) is zero on
every frame used here), alpha a multiple of 90 degrees. Frames 1 to 10 carry a virtual joint each; beyond
the tenth everything is rigid, so only the tip matters there. Every row passes through the same operations
wherever it is: results do not depend on how rows are cut into chunks.
"""

import math

import numpy as np

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.compiled.core import FLOATS, INTS32, OUT_FLOATS, core_function

FRAMES = 10
"""Frames with a virtual joint, in the order of `gcode2krl.cell.sections.VIRTUAL_JOINTS`."""
AXIS_FRAME = (0, 1, 3, 5, 6, 7)
"""The frame that each axis A1 to A6 turns."""
AXIS_SIGN = (-1.0, 1.0, 1.0, -1.0, 1.0, -1.0)
AXIS_ZERO = (0.0, 0.0, -math.pi / 2, 0.0, 0.0, math.pi)
"""theta = AXIS_SIGN·A + AXIS_ZERO, A with the controller's sign and zero."""

NO_SPEED, NO_VELOCITY = np.zeros((0, 6)), np.zeros((0, 3))

_displaced = core_function(
    "compliance_displaced", *(FLOATS,) * 7, INTS32, OUT_FLOATS, OUT_FLOATS, FLOATS, OUT_FLOATS
)
flexibility_rows = core_function("compliance_flexibility", *(FLOATS,) * 5, INTS32, OUT_FLOATS)
"""Write the flexibility (n, 9) in mm/N of the tip against small forces, along ``base``.

Takes ``q_rad``, ``frames``, ``softness``, ``base``, ``tips_mm`` and ``tool`` as `displaced_rows` does, and
the result.
"""
_tip = core_function("compliance_tip", *(FLOATS,) * 5, INTS32, OUT_FLOATS, OUT_FLOATS)


def displaced_rows(
    q_rad: Floats,
    force_N: Floats,
    moment_Nmm: Floats,
    frames: Floats,
    softness: Floats,
    base: Floats,
    tips_mm: Floats,
    tool: Ints32,
    shift_mm: Floats,
    turn_rad: Floats,
    qd_rad_s: Floats = NO_SPEED,
    velocity_mm_s: Floats = NO_VELOCITY,
) -> None:
    """Write how far the tip moves under a load, eq. 2-9, and how fast the rigid tip goes.

    ``q_rad`` (n, 6); force and moment (n, 3) at the tip along the axes of ``base``, whose rotation in the
    root is (3, 3); ``frames`` (10, 4) cos alpha, sin alpha, a, d; ``softness`` (10, 3) = 1/k_C, 1/k_B, 1/k_A;
    tip of row i in frame 10 is ``tips_mm[tool[i]]``. Results (n, 3) along ``base``: shift, and rotation
    vector, which is left out where ``turn_rad`` is (0, 3). So is the velocity (n, 3), from joint speeds
    ``qd_rad_s`` (n, 6).
    """
    load = (q_rad, force_N, moment_Nmm, frames, softness, base, tips_mm, tool)
    _displaced(*load, shift_mm, turn_rad, qd_rad_s, velocity_mm_s)


def tip_rows(
    q_rad: Floats,
    qd_rad_s: Floats,
    frames: Floats,
    base: Floats,
    tips_mm: Floats,
    tool: Ints32,
    position_mm: Floats,
    velocity_mm_s: Floats,
) -> None:
    """Write where the rigid tip is, seen from the foot of axis 1, and its velocity; see `displaced_rows`."""
    _tip(q_rad, qd_rad_s, frames, base, tips_mm, tool, position_mm, velocity_mm_s)
