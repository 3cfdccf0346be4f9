"""Gaps between single shapes, by the core's own distances; a gap is negative where they overlap."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.collision.scene import BODIES, OBSTACLES, Bodies, Obstacles
from gcode2krl.compiled.core import FLOAT, FLOATS, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import shaped

_gaps = core_function("collision_gaps", FLOATS, FLOAT, OBSTACLES, OUT_FLOATS, OUT_FLOATS)
_nearest = core_function("collision_nearest", FLOATS, OBSTACLES, OUT_FLOATS)
_segments = core_function("collision_segments", FLOATS, OUT_FLOATS)
_bodies = core_function("collision_bodies", FLOATS, FLOATS, BODIES, OUT_FLOATS)


def obstacle_gaps(ends_mm: Floats, radius_mm: float, obstacle: Obstacles) -> tuple[Floats, Floats]:
    """Return the gaps (n,) of capsules (n, 6) from an obstacle, and its places (n, 3) nearest to them.

    Exact but for rounding. Where a capsule's segment crosses a box or the surface of a mesh the gap is minus
    its radius; where it lies inside a mesh, also minus its distance from the surface.
    """
    ends = shaped("ends_mm", ends_mm, -1, 6)
    gap, place = np.empty(len(ends)), np.empty((len(ends), 3))
    _gaps(ends, float(radius_mm), obstacle, gap, place)
    return gap, place


def nearest_on(surface: Obstacles, places_mm: Floats) -> Floats:
    """Return the nearest places (n, 3) on the surface of a mesh of places (n, 3)."""
    places = shaped("places_mm", places_mm, -1, 3)
    nearest = np.empty_like(places)
    _nearest(places, surface, nearest)
    return nearest


def segment_distances(ends_mm: Floats, other_mm: Floats) -> Floats:
    """Return the distances (n,) of segments (n, 6) from others (n, 6)."""
    both = np.concatenate([shaped("ends_mm", ends_mm, -1, 6), shaped("other_mm", other_mm, -1, 6)], axis=1)
    far = np.empty(len(both))
    _segments(np.ascontiguousarray(both), far)
    return far


def placed(q_rad: Floats, geometry: Floats, bodies: Bodies) -> Floats:
    """Return the ends (n, b, 6) of bodies in the robot root for angles (n, 6) in rad."""
    q = shaped("q_rad", q_rad, -1, 6)
    ends = np.empty((len(q), 6 * len(bodies.link)))
    _bodies(q, shaped("geometry", geometry, 6), bodies, ends)
    return ends.reshape(len(q), -1, 6)
