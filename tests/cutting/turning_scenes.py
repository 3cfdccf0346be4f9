"""Ways of a cutter whose axis turns, and what exact geometry says of them.

Volume by booleans of manifold3d (hulls of the cutter at fine steps), area of contact by points all over the
edge that no earlier pose has contained.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np

from gcode2krl.cell.sections import Tool
from gcode2krl.cutting.cutter import shape_of
from gcode2krl.cutting.turned import TurnedPoints

TOOLS = (
    Tool(diameter_mm=16, teeth=3, flute_length_mm=30),
    Tool(kind="ball", diameter_mm=12, corner_radius_mm=6, teeth=2, flute_length_mm=24),
    Tool(kind="bull-nose", diameter_mm=16, corner_radius_mm=3, teeth=3, flute_length_mm=30),
    Tool(kind="tapered", diameter_mm=8, corner_radius_mm=2, taper_deg=6, teeth=2, flute_length_mm=24),
)
STOCK = np.array([[0.0, 0.0, -30.0], [60.0, 50.0, 0.0]])
F_Z_MM = 0.1
STEP_MM = 0.3
"""Between two samples: 25 mm/s at 12 ms."""
HOLLOW = math.sin(math.radians(2.0))
"""A flat bottom is hollow: what it descends to more gently it does not touch."""


class Case(NamedTuple):
    """A motion: tips and axes (n, 3), the tool."""

    name: str
    tool: Tool
    tip: np.ndarray
    axis: np.ndarray


def tilted(lead_deg, tilt_deg):
    """Return an axis leaning forward (x) and to the side (y)."""
    axis = np.array([math.tan(math.radians(lead_deg)), math.tan(math.radians(tilt_deg)), 1.0])
    return axis / np.linalg.norm(axis)


def along(corners, axes):
    """Return tips and axes between corners, the axis turning evenly in a plane."""
    tips, turned = [np.array(corners[:1], float)], [np.array(axes[:1], float)]
    for (a, b), (u, v) in zip(
        itertools.pairwise(np.array(corners, float)), itertools.pairwise(axes), strict=True
    ):
        count = max(2, math.ceil(np.linalg.norm(b - a) / STEP_MM))
        share = np.linspace(0.0, 1.0, count + 1)[1:, None]
        angle = math.acos(float(np.clip(np.dot(u, v), -1.0, 1.0)))
        if angle < 1e-9:
            axis = np.repeat([v], count, axis=0)
        else:
            axis = (np.sin((1 - share) * angle) * u + np.sin(share * angle) * v) / math.sin(angle)
        tips.append(a + share * (b - a))
        turned.append(axis)
    return np.concatenate(tips), np.concatenate(turned)


def points_of(case):
    """Return the case as the core takes it: a tooth in F_Z_MM of the way, turns in proportion."""
    step = np.gradient(case.tip, axis=0)
    size = np.linalg.norm(step, axis=1, keepdims=True)
    swing = np.gradient(case.axis, axis=0) / np.maximum(size, 1e-9) * F_Z_MM
    count = len(case.tip)
    none = np.zeros(count, bool)
    columns = (case.tip, case.axis, F_Z_MM * step / np.maximum(size, 1e-9), swing)
    return TurnedPoints(*columns, np.zeros(count, np.int32), none, ~none)


def profile(shape):
    """Return radii and heights (k,) of the outline of a cutter up to its top, from the axis to the axis."""
    kappa = np.linspace(0.0, shape.kappa_rad, 24 if shape.corner_mm > 0 else 1)
    r = [0.0, *(shape.bottom_mm + shape.corner_mm * np.sin(kappa)), shape.radius_mm, 0.0]
    z = [0.0, *(shape.corner_mm * (1.0 - np.cos(kappa))), shape.flute_mm, shape.flute_mm]
    return np.array(r), np.array(z)


def exact_volume(case, every=1):
    """Return the volume (mm³) that hulls of the cutter at two samples each take from the block.

    ``every``: so many samples of one straight way on which the axis turns evenly are one step.
    """
    import manifold3d

    r, z = profile(shape_of(case.tool))
    cutter = manifold3d.Manifold.revolve(manifold3d.CrossSection([np.stack([r, z], axis=1)]), 96)
    part = manifold3d.Manifold.cube(list(STOCK[1] - STOCK[0])).translate(list(STOCK[0]))
    whole = part.volume()
    way = np.diff(np.hstack([case.tip, case.axis]), axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    # one hull covers a straight way of a constant axis
    bends = np.abs(np.diff(way, axis=0)).max(axis=1) > 1e-9
    bends |= np.abs(way[1:, 3:]).max(axis=1) > 0.0
    rows = [0, *(np.flatnonzero(bends)[every - 1 :: every] + 1), len(case.tip) - 1]
    bodies = [cutter.transform(np.column_stack([frame(case.axis[row]), case.tip[row]])) for row in rows]
    sweeps = [manifold3d.Manifold.batch_hull([a, b]) for a, b in itertools.pairwise(bodies)]
    for first in range(0, len(sweeps), 16):
        part -= manifold3d.Manifold.batch_boolean(sweeps[first : first + 16], manifold3d.OpType.Add)
    return whole - part.volume()


def frame(axis):
    """Return a rotation (3, 3) whose third column is the axis."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across = np.cross(axis, helper)
    across /= np.linalg.norm(across)
    return np.column_stack([np.cross(across, axis), across, axis])


def is_inside(shape, tip, axis, places):
    """Return (n,) True where places are inside a cutter, by its radius at their height."""
    off = places - tip
    z = off @ axis
    r2 = (off * off).sum(axis=1) - z * z
    height, radii = np.array(profile(shape)[::-1])[:, :-1]
    if shape.corner_mm > 0.0:
        low = np.clip(shape.corner_mm - z, 0.0, shape.corner_mm)
        arc = shape.bottom_mm + np.sqrt(shape.corner_mm**2 - low**2)
        side = shape.arc_radius_mm + (z - shape.arc_top_mm) / math.tan(shape.kappa_rad)
        radius = np.where(z < shape.arc_top_mm, arc, side)
    else:
        radius = np.interp(z, height[1:], radii[1:])
    return (z > 0.0) & (z < shape.flute_mm) & (r2 < np.maximum(radius - 1e-3, 0.0) ** 2)


def exact_contact(case, row, fine=4):
    """Return the area (mm²) of the edge that moves into material which no earlier pose has contained."""
    shape = shape_of(case.tool)
    r, z = profile(shape)
    r, z = r[:-1], z[:-1]  # the top is no edge
    parts = [16, *[2] * (len(r) - 3), 60]
    at = np.concatenate([np.linspace(0.0, 1.0, count, endpoint=False) + k for k, count in enumerate(parts)])
    radius, height = np.interp(at, np.arange(len(r)), r), np.interp(at, np.arange(len(z)), z)
    middle_r, middle_z = 0.5 * (radius[1:] + radius[:-1]), 0.5 * (height[1:] + height[:-1])
    dr, dz = np.diff(radius), np.diff(height)
    slant = np.maximum(np.hypot(dr, dz), 1e-12)
    phi = (np.arange(120) + 0.5) * math.tau / 120
    turn = frame(case.axis[row])
    around = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=1) @ turn.T
    places = case.tip[row] + middle_z[:, None, None] * case.axis[row] + middle_r[:, None, None] * around
    normal = (dz / slant)[:, None, None] * around - (dr / slant)[:, None, None] * case.axis[row]
    before, behind = max(row - 1, 0), min(row + 1, len(case.tip) - 1)
    turn = np.cross(case.axis[row], case.axis[behind] - case.axis[before])
    moved = case.tip[behind] - case.tip[before] + np.cross(turn, places - case.tip[row])
    into = (normal * moved).sum(axis=2) / np.linalg.norm(moved, axis=2)
    is_bottom = (dz == 0.0)[:, None]
    into = into > np.where(is_bottom, HOLLOW, 1e-6)
    area = np.broadcast_to((slant * middle_r)[:, None] * math.tau / 120, into.shape)[into]
    places = places[into]
    stands = ((places > STOCK[0]) & (places < STOCK[1])).all(axis=1)
    for k in range(row - 1, -1, -1):  # the last ones contain most of what is no contact
        for part in range(fine):
            share = part / fine
            tip = case.tip[k] + share * (case.tip[k + 1] - case.tip[k])
            axis = case.axis[k] + share * (case.axis[k + 1] - case.axis[k])
            left = np.flatnonzero(stands)
            if not len(left):
                return 0.0
            stands[left[is_inside(shape, tip, axis / np.linalg.norm(axis), places[left])]] = False
    return float(area[stands].sum())
