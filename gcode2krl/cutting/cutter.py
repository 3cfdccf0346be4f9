"""The shape of a cutter: its outline, and its edges as slices along the axis.

Every cutter is a flat bottom, a corner arc, a straight side and, above a drill's point, a cylinder.
"""

import math
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections import Tool
from gcode2krl.compiled.core import StructOf
from gcode2krl.units import RAD_PER_DEG

DRILL_POINT_DEG = 118.0
"""Point angle of a drill that states none: the usual twist drill."""
FLUTE_PER_DIAMETER = 10.0
"""Flute length over diameter of a tool that states no length: no flute is longer."""
_ARC_POINTS = 65
_NOTHING_MM = 1e-9


@dataclass(frozen=True)
class Shape:
    """Outline of a cutter from the tip up, lengths in mm, z = 0 at the tip.

    ``bottom_mm`` radius of the flat bottom · ``corner_mm`` radius of the corner arc whose centre is above
    the bottom's rim · ``kappa_rad`` edge angle of the side above it (90° = cylinder) up to ``side_mm`` ·
    from there a cylinder up to ``flute_mm``.
    """

    bottom_mm: float
    corner_mm: float
    kappa_rad: float
    side_mm: float
    flute_mm: float

    @property
    def arc_top_mm(self) -> float:
        """Height at which the corner arc meets the side."""
        return self.corner_mm * (1.0 - math.cos(self.kappa_rad))

    @property
    def arc_radius_mm(self) -> float:
        """Radius at which the corner arc meets the side."""
        return self.bottom_mm + self.corner_mm * math.sin(self.kappa_rad)

    @property
    def radius_mm(self) -> float:
        """Largest radius, at the top of the side."""
        straight = max(self.side_mm - self.arc_top_mm, 0.0)
        return self.arc_radius_mm + straight * _cot(self.kappa_rad)


SHAPE = StructOf.record(Shape)
"""A `Shape` as the compiled core takes it."""


@dataclass(frozen=True)
class CutterSlices:
    """Edges of one tooth in slices, one row each, from the tip up; `radius_mm` and kappa at their middle.

    ``z_low_mm``, ``z_high_mm``, ``radius_mm``, ``sin_kappa``, ``cos_kappa``, ``db_mm`` (s,); ``db_mm`` is the
    contact width of the whole slice, dz/sin kappa; a slice engaged over a fraction of its height counts with
    that fraction.
    """

    z_low_mm: Floats
    z_high_mm: Floats
    radius_mm: Floats
    sin_kappa: Floats
    cos_kappa: Floats
    db_mm: Floats

    def __len__(self) -> int:
        return len(self.db_mm)


def shape_of(tool: Tool) -> Shape:
    """Return the outline of a tool.

    A ball is a corner of half the diameter. The corner of a tapered mill is that of a cylinder of
    `diameter_mm`, so a tapered ball's diameter is that of its ball. A mill without flute length
    is assumed to cut over its whole length.
    """
    radius = tool.diameter_mm / 2.0
    flute = tool.flute_length_mm or tool.length_mm or FLUTE_PER_DIAMETER * tool.diameter_mm
    if tool.kind == "drill":
        half_point = (tool.point_deg or DRILL_POINT_DEG) / 2.0 * RAD_PER_DEG
        point = radius / math.tan(half_point)
        return Shape(0.0, 0.0, math.pi / 2 - half_point, point, max(flute, point))
    corner = radius if tool.kind == "ball" else tool.corner_radius_mm
    kappa = math.pi / 2 - tool.taper_deg * RAD_PER_DEG
    flute = max(flute, corner * (1.0 - math.cos(kappa)))
    return Shape(max(radius - corner, 0.0), corner, kappa, flute, flute)


def slices_of(tool: Tool, count: int = 12) -> CutterSlices:
    """Return the edges above the flat bottom: `count` slices over each stretch whose radius changes.

    A flat mill is one slice, a bull-nose or ball `count` on its corner and one on the cylinder, a drill
    `count` on its point and one on the cylinder. The flat bottom, which cuts only while the tool descends, is
    `bottom_of`.
    """
    shape = shape_of(tool)
    kappa_rad = np.linspace(0.0, shape.kappa_rad, count + 1 if shape.corner_mm > 0 else 1)
    r_mm = [shape.bottom_mm + shape.corner_mm * np.sin(kappa_rad)]
    z_mm = [shape.corner_mm * (1.0 - np.cos(kappa_rad))]
    straight = _cot(shape.kappa_rad)
    if shape.side_mm > shape.arc_top_mm + _NOTHING_MM:
        up = np.linspace(shape.arc_top_mm, shape.side_mm, (count if straight > 0 else 1) + 1)[1:]
        z_mm.append(up)
        r_mm.append(shape.arc_radius_mm + (up - shape.arc_top_mm) * straight)
    if shape.flute_mm > shape.side_mm + _NOTHING_MM:
        z_mm.append(np.array([shape.flute_mm]))
        r_mm.append(np.array([shape.radius_mm]))
    return _between(np.concatenate(r_mm), np.concatenate(z_mm))


def bottom_of(tool: Tool, count: int = 6) -> CutterSlices:
    """Return the flat bottom as `count` rings from the axis outwards, all at z = 0 with kappa = 0; none on a
    ball.

    Their ``db_mm`` is the ring's width. Assumes edges from the rim to the axis, as a centre-cutting mill has.
    """
    bottom = shape_of(tool).bottom_mm
    r_mm = np.linspace(0.0, bottom, count + 1 if bottom > 0 else 1)
    return _between(r_mm, np.zeros_like(r_mm))


def outline(tool: Tool) -> tuple[Floats, Floats]:
    """Return radii and heights above the tip (k,) in mm of the lower outline, both from the axis outwards.

    Straight between the points, which are so close on a corner arc that the error is 0.1 µm for each
    millimetre of its radius. The last radius is the largest: on a tapered mill the one at the top of its
    flutes.
    """
    shape = shape_of(tool)
    kappa_rad = np.linspace(0.0, shape.kappa_rad, _ARC_POINTS if shape.corner_mm > 0 else 1)
    r_mm = shape.bottom_mm + shape.corner_mm * np.sin(kappa_rad)
    z_mm = shape.corner_mm * (1.0 - np.cos(kappa_rad))
    if shape.bottom_mm > 0:
        r_mm, z_mm = np.insert(r_mm, 0, 0.0), np.insert(z_mm, 0, 0.0)
    if shape.radius_mm > r_mm[-1] + _NOTHING_MM:
        r_mm, z_mm = np.append(r_mm, shape.radius_mm), np.append(z_mm, shape.side_mm)
    return r_mm, z_mm


def _between(r_mm: Floats, z_mm: Floats) -> CutterSlices:
    """Slices between the points of an outline; a chord of an arc has the direction of the arc's middle."""
    dr, dz = np.diff(r_mm), np.diff(z_mm)
    db = np.hypot(dr, dz)
    middle = (r_mm[:-1] + r_mm[1:]) / 2.0
    return CutterSlices(z_mm[:-1], z_mm[1:], middle, dz / db, dr / db, db)


def _cot(kappa_rad: float) -> float:
    """Return the widening of a side per mm of height, exactly 0 on a cylinder."""
    return 0.0 if kappa_rad == math.pi / 2 else 1.0 / math.tan(kappa_rad)
