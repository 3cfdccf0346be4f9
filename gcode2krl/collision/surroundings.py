"""What may be hit: the table, the obstacles of the cell, and the arm itself; and who may hit what."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell, carriers
from gcode2krl.cell.sections import Plane
from gcode2krl.collision import scene
from gcode2krl.collision.bodies import ELBOW, FOOT, FOREARM, UPPER_ARM, WRIST, Capsule

ReadMesh = Callable[[str], Floats]
"""File of a mesh → its triangles (t, 3, 3) in mm."""
TABLE, STOCK = "the table", "the stock"
Pair = tuple[int, int, int]
Corners = tuple[tuple[float, float, float], tuple[float, float, float]]


class Surroundings(NamedTuple):
    """Obstacles with their names."""

    names: tuple[str, ...]
    shapes: scene.Obstacles
    carried: frozenset[str]
    """Names of what a table under the part carries along."""


def surroundings_of(cell: Cell, read_mesh: ReadMesh) -> Surroundings:
    """Return table, obstacles and raw part in the robot root; raises what reading a mesh raises."""
    base, at_rest = cell.base_matrix(), cell.external_rest()
    root = fr.invert(root_of(cell, at_rest))
    frames = {"base": base, "world": root, "robroot": root @ root_of(cell, np.zeros(6))}
    names, shapes = [], []
    if cell.table is not None:
        names.append(TABLE)
        shapes.append(scene.plane((base @ [0.0, 0.0, cell.table.z_mm, 1.0])[:3], base[:3, 2]))
    for obstacle in cell.obstacle:
        names.append(obstacle.name)
        shape = obstacle.box_mm, obstacle.plane, obstacle.mesh
        shapes.append(_shape(*shape, frames[obstacle.frame], read_mesh))
    stock = cell.stock
    if stock is not None and (stock.box_mm is not None or stock.mesh is not None):
        names.append(STOCK)
        shapes.append(_shape(stock.box_mm, None, stock.mesh, base, read_mesh))
    free = {each.name for each in cell.obstacle if each.frame != "base"}
    carried = (
        frozenset(names) - free if carriers.tables_of(cell.external, cell.frames.base_on) else frozenset()
    )
    return Surroundings(tuple(names), scene.joined(shapes), carried)


def root_of(cell: Cell, external: Floats) -> Floats:
    """Return the robot root in ``$WORLD`` (4, 4), E1 to E6 at (6,)."""
    robroot = np.eye(4) if cell.frames.robroot is None else cell.frames.robroot.matrix()
    root: Floats = carriers.root_in_world(cell.external, external[None], robroot)[0]
    return root


def _shape(
    box_mm: Corners | None, plane: Plane | None, mesh: str | None, frame: Floats, read_mesh: ReadMesh
) -> scene.Obstacles:
    if box_mm is not None:
        low, high = box_mm
        return scene.box(np.array(low), np.array(high), frame)
    if plane is not None:
        point = (frame @ [*plane.point_mm, 1.0])[:3]
        return scene.plane(point, frame[:3, :3] @ np.array(plane.normal))
    return scene.mesh(read_mesh(str(mesh)) @ frame[:3, :3].T + frame[:3, 3])


def pairs_of(parts: list[Capsule], names: tuple[str, ...]) -> list[Pair]:
    """Return who may hit what: (part, obstacle, 0), or (part, -1, other part) of the arm itself.

    The foot hits nothing, as it stands still, or on its rail. The table has no edge here, and parts of the
    arm may be beside it: only wrist, spindle, holder and cables are held against it; how deep a cutter goes
    is judged by its tip (`below-table`). Of the arm itself the wrist may hit foot, A1 and A2, the forearm
    foot and A1;
    spindle, holder and cutter may hit A3 too. The others are neighbours, kept apart by the limits of the
    joints. Cables lie on the arm, and are held against what stands in the cell alone.
    """
    pairs = [
        (number, obstacle, 0)
        for number, part in enumerate(parts)
        for obstacle, name in enumerate(names)
        if part.link != FOOT
        and (name != TABLE or part.kind == "cables" or (part.link >= WRIST and part.kind != "cutter"))
    ]
    for number, part in enumerate(parts):
        if part.link < FOREARM or part.is_face or part.kind == "cables":
            continue
        last = UPPER_ARM - 1 if part.link == FOREARM else UPPER_ARM if part.kind == "arm" else ELBOW
        pairs += [
            (number, -1, other)
            for other, other_part in enumerate(parts)
            if other_part.link <= last and other_part.kind == "arm"
        ]
    return pairs


def is_held(
    pair: Pair,
    parts: list[Capsule],
    around: Surroundings,
    *,
    against_raw: bool,
    is_ptp: bool,
    turns: bool = False,
) -> bool:
    """Tell whether a pair counts on a way: those with the stock only where it is still the raw part.

    Where a table ``turns``, what it carries is left to `collision.turning`.

    Elsewhere it is judged as it stands, with the removal. So is the cutter on the lines of an approach,
    which may go into it.
    """
    if pair[1] < 0:
        return True
    name = around.names[pair[1]]
    if turns and name in around.carried:
        return False
    if name != STOCK:
        return True
    return against_raw and (is_ptp or parts[pair[0]].kind != "cutter")
