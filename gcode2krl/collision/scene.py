"""What can hit and what can be hit, as arrays for the core: capsules, planes, boxes, meshes with their trees.

A capsule is a segment with a radius. Everything stands in the robot root, in mm; a body stands in the frame
of its link. The frames, with eq. 1 of `robot.kinematics`: 0 foot, the robot root; 1 turns with A1 about the
root's z, 2 about A2 with x towards A3, 3 about A3 with x along the forearm, 4 about A4 and 5 about A5 with
the origin in the wrist's centre, 6 the flange with z out of it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.compiled.core import StructOf

MOST_BODIES = 96
"""Bodies at once: an arm has 15, a tool in its holder 10; the core keeps them on its stack."""
PLANE, BOX, MESH = 0, 1, 2
"""Kinds of obstacles."""
LEAF = 4
"""Triangles in a leaf of a tree."""
_NUMBERS = 18
_NOWHERE_MM = 1e30
"""Where the boxes of empty leaves are."""


class Bodies(NamedTuple):
    """Capsules of the arm and on its flange (b)."""

    link: Ints32
    """(b, 2) number of the frame of each end; cables are on two links."""
    ends_mm: Floats
    """(b, 6) both ends in their frames."""
    radius_mm: Floats
    lever_mm: Floats
    """(b, 6) how far an end can be from the axes A1 to A6 at most, 0 where the axis does not move it."""


class Obstacles(NamedTuple):
    """What stands in the cell (o)."""

    kind: Ints32
    numbers: Floats
    """(o, 18) of a plane the normal and its distance from the origin; of a box the rows of its axes, its
    origin, its low and its high corner along them."""
    tree: Ints
    """(o, 4) of a mesh: first triangle, how many, first node, levels below it."""
    triangles: Floats
    """(t, 9) corners of the triangles of all meshes."""
    boxes: Floats
    """(m, 6) low and high corners of the nodes of all trees."""


BODIES = StructOf.record(Bodies)
OBSTACLES = StructOf.record(Obstacles)


def bodies_of(
    link: Sequence[int] | Sequence[tuple[int, int]],
    ends_mm: Floats,
    radius_mm: Sequence[float],
    geometry: Floats,
) -> Bodies:
    """Return capsules with their levers.

    ``link`` (b,) numbers of frames, or (b, 2) where the ends are on two links, ``ends_mm`` (b, 6),
    ``geometry`` as in `robot.kinematics`. A lever is the sum of the lengths between an axis and the farther
    end, which no pose exceeds.
    """
    named = np.array(link, dtype=np.int32).reshape(len(link), -1)
    links = np.ascontiguousarray(np.broadcast_to(named, (len(named), 2)))
    ends = np.array(ends_mm, dtype=float).reshape(-1, 6)
    if len(links) > MOST_BODIES:
        raise ValueError(f"{len(links)} bodies, at most {MOST_BODIES} at once")
    lever = np.array([_levers_of_both(*pair, geometry) for pair in zip(links.tolist(), ends, strict=True)])
    return Bodies(links, ends, np.array(radius_mm, dtype=float), lever.reshape(-1, 6))


def _levers_of_both(links: Sequence[int], ends: Floats, geometry: Floats) -> Floats:
    pair = zip(links, ends.reshape(2, 1, 3), strict=True)
    lever: Floats = np.max([_levers(link, end, geometry) for link, end in pair], axis=0)
    return lever


def _levers(link: int, ends: Floats, geometry: Floats) -> Floats:
    a1, a2, _, c2, c3, c4 = geometry
    lever = np.zeros(6)
    if link == 0:
        return lever
    if link == 1:
        lever[0] = np.hypot(ends[:, 0], ends[:, 1]).max()
        return lever
    from_origin = ends + np.array([0.0, 0.0, c4]) if link == 6 else ends  # from the wrist's centre
    reach = float(np.linalg.norm(from_origin, axis=1).max())
    between = [abs(a1), abs(c2), float(np.hypot(c3, a2)), 0.0, 0.0]  # A1-A2, A2-A3, A3-A4, then the wrist
    lever[link - 1] = reach
    for axis in range(link - 2, -1, -1):
        lever[axis] = lever[axis + 1] + between[axis]
    return lever


def plane(point_mm: Floats, normal: Floats) -> Obstacles:
    """Return the half-space behind a plane; the normal points to the free side."""
    unit = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    numbers = np.zeros(_NUMBERS)
    numbers[:4] = *unit, unit @ np.asarray(point_mm, dtype=float)
    return _alone(PLANE, numbers)


def box(low_mm: Floats, high_mm: Floats, frame: Floats) -> Obstacles:
    """Return a box with its sides along the axes of a frame (4, 4) of the robot root."""
    numbers = np.concatenate([frame[:3, :3].T.ravel(), frame[:3, 3], low_mm, high_mm])
    return _alone(BOX, numbers)


def mesh(triangles_mm: Floats) -> Obstacles:
    """Return a mesh of triangles (t, 3, 3) with its tree of boxes.

    The triangles are put in the order of a space-filling curve (their middles, 21 bits a coordinate) and the
    tree halves this order: it is complete, so that a node's place is its name.
    """
    corners = np.ascontiguousarray(triangles_mm, dtype=float).reshape(-1, 3, 3)
    corners = corners[np.argsort(_curve(corners.mean(axis=1)), kind="stable")]
    leaves = -(-len(corners) // LEAF)
    levels = max(leaves - 1, 0).bit_length()
    low = np.full(((1 << levels) * LEAF, 3), _NOWHERE_MM)
    high = low.copy()
    low[: len(corners)], high[: len(corners)] = corners.min(axis=1), corners.max(axis=1)
    used = np.arange(len(low)).reshape(-1, LEAF) < len(corners)
    high = np.where(used[:, :, None], high.reshape(-1, LEAF, 3), -_NOWHERE_MM).max(axis=1)
    low = low.reshape(-1, LEAF, 3).min(axis=1)
    levels_of_boxes = [(low, high)]
    while len(low) > 1:
        low, high = low.reshape(-1, 2, 3).min(axis=1), high.reshape(-1, 2, 3).max(axis=1)
        levels_of_boxes.append((low, high))
    boxes = np.concatenate([np.concatenate(pair, axis=1) for pair in reversed(levels_of_boxes)])
    empty = boxes[:, 3] <= -_NOWHERE_MM
    boxes[empty] = _NOWHERE_MM
    tree = np.array([[0, len(corners), 0, levels]], dtype=np.int64)
    return _alone(MESH, np.zeros(_NUMBERS))._replace(
        tree=tree, triangles=corners.reshape(-1, 9), boxes=np.ascontiguousarray(boxes)
    )


def _curve(points: Floats) -> NDArray[np.uint64]:
    """Return the places (n,) of points (n, 3) along Morton's curve."""
    low, span = points.min(axis=0), np.ptp(points, axis=0).max()
    cells = ((points - low) * ((2**21 - 1) / max(span, 1e-9))).astype(np.uint64)
    steps = (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    )
    for shift, mask in steps:
        cells = (cells | (cells << np.uint64(shift))) & np.uint64(mask)
    x, y, z = cells.T
    place: NDArray[np.uint64] = x | (y << np.uint64(1)) | (z << np.uint64(2))
    return place


def joined(parts: Sequence[Obstacles]) -> Obstacles:
    """Return several obstacles as one record."""
    if not parts:
        return Obstacles(
            np.zeros(0, np.int32), np.zeros((0, _NUMBERS)), np.zeros((0, 4), np.int64), *_no_mesh()
        )
    tree, triangle, node = [], 0, 0
    for part in parts:
        tree.append(part.tree + np.array([triangle, 0, node, 0]))
        triangle, node = triangle + len(part.triangles), node + len(part.boxes)
    kind, numbers = (np.concatenate([getattr(p, name) for p in parts]) for name in ("kind", "numbers"))
    triangles, boxes = (np.concatenate([getattr(p, name) for p in parts]) for name in ("triangles", "boxes"))
    return Obstacles(kind, numbers, np.concatenate(tree), triangles, boxes)


def _alone(kind: int, numbers: Floats) -> Obstacles:
    return Obstacles(
        np.array([kind], dtype=np.int32),
        numbers[None, :].astype(float),
        np.zeros((1, 4), np.int64),
        *_no_mesh(),
    )


def _no_mesh() -> tuple[Floats, Floats]:
    return np.zeros((0, 9)), np.zeros((0, 6))
