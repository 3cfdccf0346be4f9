"""What may be hit: the table, the obstacles of the cell, and the arm itself; and who may hit what."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import Obstacle
from gcode2krl.collision import scene
from gcode2krl.collision.bodies import ELBOW, FOOT, FOREARM, UPPER_ARM, WRIST, Part

ReadMesh = Callable[[str], Floats]
"""File of a mesh → its triangles (t, 3, 3) in mm."""
TABLE = "the table"
Pair = tuple[int, int, int]


class Surroundings(NamedTuple):
    """Obstacles with their names."""

    names: tuple[str, ...]
    shapes: scene.Obstacles


def surroundings_of(cell: Cell, read_mesh: ReadMesh) -> Surroundings:
    """Return the table and all obstacles in the robot root; raises what reading a mesh raises."""
    base = cell.base_matrix()
    names, shapes = [], []
    if cell.table is not None:
        names.append(TABLE)
        shapes.append(scene.plane((base @ [0.0, 0.0, cell.table.z_mm, 1.0])[:3], base[:3, 2]))
    for obstacle in cell.obstacle:
        names.append(obstacle.name)
        shapes.append(_shape(obstacle, base if obstacle.frame == "base" else np.eye(4), read_mesh))
    return Surroundings(tuple(names), scene.joined(shapes))


def _shape(obstacle: Obstacle, frame: Floats, read_mesh: ReadMesh) -> scene.Obstacles:
    if obstacle.box_mm is not None:
        low, high = obstacle.box_mm
        return scene.box(np.array(low), np.array(high), frame)
    if obstacle.plane is not None:
        point = (frame @ [*obstacle.plane.point_mm, 1.0])[:3]
        return scene.plane(point, frame[:3, :3] @ np.array(obstacle.plane.normal))
    return scene.mesh(read_mesh(str(obstacle.mesh)) @ frame[:3, :3].T + frame[:3, 3])


def pairs_of(parts: list[Part], names: tuple[str, ...]) -> list[Pair]:
    """Return who may hit what: (part, obstacle, 0), or (part, -1, other part) of the arm itself.

    The foot hits nothing, as it stands still. The table has no edge here, and parts of the arm may be beside
    it: only wrist, spindle and holder are held against it; how deep a cutter goes is judged by its tip
    (`below-table`). Of the arm itself the wrist may hit foot, A1 and A2, the forearm foot and A1; spindle,
    holder and cutter may hit A3 too. The others are neighbours, kept apart by the limits of the joints.
    """
    pairs = [
        (number, obstacle, 0)
        for number, part in enumerate(parts)
        for obstacle, name in enumerate(names)
        if part.link != FOOT and (name != TABLE or (part.link >= WRIST and part.kind != "cutter"))
    ]
    for number, part in enumerate(parts):
        if part.link < FOREARM or part.is_face:
            continue
        last = UPPER_ARM - 1 if part.link == FOREARM else UPPER_ARM if part.kind == "arm" else ELBOW
        pairs += [(number, -1, other) for other, each in enumerate(parts) if each.link <= last]
    return pairs
