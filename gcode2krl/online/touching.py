"""Where a cutter whose axis turns touches the finished part: points of its outline that leave a surface.

The tool moves as a rigid body. A point of the outline at the height z, the radius r and the edge angle kappa,
with the normal n = sin kappa·e - cos kappa·axis, moves along itself where n·(v + w x p) = 0: where e has
e·(sin kappa·v + (sin kappa·z + cos kappa·r)·axis') = cos kappa·axis·v. Of these places those stay on the part
which lie on the surface that the whole motion leaves.
"""

from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell.sections import Tool
from gcode2krl.cutting import remove
from gcode2krl.cutting.cutter import shape_of
from gcode2krl.cutting.dexels import Dexels
from gcode2krl.cutting.milling import tool_axes
from gcode2krl.prediction import Prediction

_ON_SURFACE_MM = 0.1
"""A point nearer than this to the finished surface lies on it: dexels know it to some hundredths."""
_HEIGHTS, _ANGLES = 6, 9
_HOLLOW = 0.035
"""Sine of the descent, 2°, up to which a bottom, being hollow, cuts nothing and leaves a floor."""


class Touching(NamedTuple):
    """Points (k) of the cutter that lie on the finished part, in ``$BASE``."""

    row: Ints
    """(k,) sample."""
    point_mm: Floats
    """(k, 3)"""
    normal: Floats
    """(k, 3) out of the cutter, into the part."""


def touching_of(prediction: Prediction) -> Touching | None:
    """Return where the cutter touches the finished part; None where the tool axis is constant."""
    motion, forces, cell = prediction.motion, prediction.forces, prediction.cell
    if motion is None or forces is None:
        raise ValueError("a prediction without forces")
    axis = tool_axes(motion)
    if np.abs(axis - axis[:1]).max(initial=0.0) < 1e-6:
        return None
    part = remove(prediction.toolpath, motion, cell, is_checked=False).material
    if not isinstance(part, Dexels):
        return None
    velocity, swing = (np.gradient(each, motion.time_s, axis=0) for each in (motion.position_mm, axis))
    touching = [Touching(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))]
    cuts = forces.force_base_N.any(axis=1)
    for number in np.unique(motion.tool[cuts]).tolist():
        row = np.flatnonzero(cuts & (motion.tool == number))
        for r, z, kappa in _outline(cell.tool[number], forces.a_p_mm[row]):
            touching += _sides(row, motion.position_mm, axis, velocity, swing, r, z, kappa)
    sample = np.concatenate([each.row for each in touching])
    point_mm = np.concatenate([each.point_mm for each in touching])
    normal = np.concatenate([each.normal for each in touching])
    on_part = np.abs(part.depths(point_mm)) < _ON_SURFACE_MM
    return Touching(sample[on_part], point_mm[on_part], normal[on_part])


def _outline(tool: Tool, depth_mm: Floats) -> list[tuple[Floats, Floats, float]]:
    """Return radius, height (m,) and edge angle of places on the outline, up to the depth of samples."""
    shape = shape_of(tool)
    places = [] if shape.bottom_mm == 0.0 else [(0.0 * depth_mm, 0.0 * depth_mm, 0.0)]
    if shape.corner_mm > 0.0:
        for kappa in np.linspace(0.0, shape.kappa_rad, _ANGLES).tolist():
            radius, height = (
                shape.bottom_mm + shape.corner_mm * np.sin(kappa),
                shape.corner_mm * (1.0 - np.cos(kappa)),
            )
            within = np.where(height <= depth_mm, 1.0, np.nan)
            places.append((radius * within, height * within, kappa))
    for share in np.linspace(0.0, 1.0, _HEIGHTS).tolist():
        up = share * (depth_mm - shape.arc_top_mm)
        up = np.where(up >= 0.0, up, np.nan)
        places.append(
            (shape.arc_radius_mm + up / np.tan(shape.kappa_rad), shape.arc_top_mm + up, shape.kappa_rad)
        )
    return places


def _sides(
    row: Ints, tip: Floats, axis: Floats, velocity: Floats, swing: Floats, r: Floats, z: Floats, kappa: float
) -> list[Touching]:
    """Return the places at both sides of samples at which a ring of the outline moves along itself."""
    a, v, turn = axis[row], velocity[row], swing[row]
    up = np.einsum("ij,ij->i", v, a)
    sine, cosine = np.sin(kappa), np.cos(kappa)
    if not r.any():
        level = np.abs(up) <= _HOLLOW * np.linalg.norm(v, axis=1)
        return [Touching(row[level], tip[row[level]], -a[level])]
    along = sine * (v - up[:, None] * a) + (sine * z + cosine * r)[:, None] * turn
    size = np.linalg.norm(along, axis=1)
    share = cosine * up / np.where(size > 0.0, size, np.nan)
    known = np.flatnonzero(np.abs(share) <= 1.0)
    forward = along[known] / size[known, None]
    across, share = np.cross(a[known], forward), share[known, None]
    sides = []
    for side in (-1.0, 1.0):
        radial = share * forward + side * np.sqrt(1.0 - share**2) * across
        place = tip[row[known]] + z[known, None] * a[known] + r[known, None] * radial
        sides.append(Touching(row[known], place, sine * radial - cosine * a[known]))
    return sides
