"""Write `five_axis.nc`: a tilted face and the swarf cut of a cone, for a table-table machine under TCPM.

python examples/five_axis/make.py examples/five_axis/five_axis.nc
"""

import math
import sys
from collections.abc import Iterator
from pathlib import Path

RADIUS_MM, HEIGHT_MM, HALF_ANGLE_DEG = 30.0, 15.0, 15.0
"""The cone: radius at its upper edge (Z0), height, half angle; it widens downwards."""
TOOL_RADIUS_MM = 8.0
FACE_DEG = 20.0
"""Tilt of the face about X."""
STEPS = 24


def angles_of(x: float, y: float, z: float) -> tuple[float, float]:
    """Return A and C in degrees of a tilting table whose positive angles turn the part left-handed.

    The axis in the part is Rz(C)·Rx(A)·z = (sin C·sin A, -cos C·sin A, cos A).
    """
    return math.degrees(math.acos(z)), math.degrees(math.atan2(x, -y))


def tilted_face() -> Iterator[str]:
    """Yield passes over a face that falls to the front; the tool stands upright on it."""
    tilt = math.radians(FACE_DEG)
    normal = (0.0, -math.sin(tilt), math.cos(tilt))
    a_deg, c_deg = angles_of(*normal)
    yield f"G0 X-60 Y-75 Z40 A{a_deg:.4f} C{c_deg:.4f}"
    for k in range(4):
        along = 10.0 * k
        y, z = -70.0 + along * math.cos(tilt), -12.0 + along * math.sin(tilt)
        ends = (-40.0, 40.0) if k % 2 == 0 else (40.0, -40.0)
        if k == 0:
            yield f"G0 X-52 Y{y:.4f} Z{z:.4f}"
        for x in ends:
            yield f"G1 X{1.3 * x:.4f} Y{y:.4f} Z{z:.4f} F1200"
    yield f"G0 Y{y - 40.0 * math.sin(tilt):.4f} Z{z + 40.0 * math.cos(tilt):.4f}"
    yield "G0 Z60"


def cone() -> Iterator[str]:
    """Yield the way around the cone with the flank on it: the tool lies along its side."""
    half = math.radians(HALF_ANGLE_DEG)
    foot_mm = RADIUS_MM + HEIGHT_MM * math.tan(half)
    before = None
    for k in range(STEPS + 1):
        angle = 2.0 * math.pi * k / STEPS - math.pi / 2.0
        out = (math.cos(angle), math.sin(angle))
        axis = (-math.sin(half) * out[0], -math.sin(half) * out[1], math.cos(half))
        normal = (math.cos(half) * out[0], math.cos(half) * out[1], math.sin(half))
        tip = (
            foot_mm * out[0] + TOOL_RADIUS_MM * normal[0],
            foot_mm * out[1] + TOOL_RADIUS_MM * normal[1],
            -HEIGHT_MM + TOOL_RADIUS_MM * normal[2],
        )
        a_deg, c_deg = angles_of(*axis)
        while before is not None and c_deg < before - 1e-9:  # the table goes on turning, past 360
            c_deg += 360.0
        before = c_deg
        words = f"X{tip[0]:.4f} Y{tip[1]:.4f} Z{tip[2]:.4f} A{a_deg:.4f} C{c_deg:.4f}"
        if k == 0:
            yield f"G0 X{tip[0]:.4f} Y{tip[1] - 20.0:.4f} A{a_deg:.4f} C{c_deg:.4f}"
            yield f"G0 Z{tip[2]:.4f}"
            yield f"G1 {words} F600"
        else:
            yield f"{words}"
    yield f"G1 X{tip[0]:.4f} Y{tip[1] - 20.0:.4f}"
    yield "G0 Z60"


def program() -> Iterator[str]:
    """Yield the lines of the whole program."""
    yield "%"
    yield "(FIVE AXES: A TILTED FACE AND THE SWARF CUT OF A CONE)"
    yield "(FOR cell.toml: TILTING TABLE A, C, TIP PROGRAMMED)"
    yield from ("G21 G90 G94 G17", "T1 M6", "S8000 M3", "G43.4 H1")
    yield from tilted_face()
    yield from cone()
    yield from ("G49", "G91 G28 Z0", "G90 G28 A0 C0", "M5", "M30", "%")


if __name__ == "__main__":
    Path(sys.argv[1]).write_text("\n".join(program()) + "\n", encoding="ascii", newline="\n")
