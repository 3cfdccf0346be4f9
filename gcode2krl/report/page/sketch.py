"""The robot as the page draws it: its capsules, the axes that they turn about, and what stands in the cell.

The capsules are those by which collisions are checked; where the cell states none, they are a sketch between
the joint centres of the kinematics. Everything is stated in the robot root with all joints at zero; from
there the turns about axes 1 to k, the last first, move link k (a product of exponentials), which is all that
the page needs. A stretch of cables has its ends on two links. A mesh is only named here.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.cell.carriers import root_in_world
from gcode2krl.cell.sections import Capsule, Plane, Tool
from gcode2krl.errors import RefusedError

_THICKNESS = (0.10, 0.095, 0.07, 0.065, 0.05, 0.042, 0.035)
"""Radius of each link as a share of the arm's length c2 + c3, as on robots of this build."""
_SPINDLE = 0.035
_FORWARD = np.array([1.0, 0.0, 0.0])
_FALLBACK_CUTTER_MM = 50.0
_PLANE_MM = 750.0
"""Half the side of the square that is drawn of a plane."""
LINKS = ("foot", "A1", "A2", "A3", "A4", "A5", "A6")


def robot_sketch(cell: Cell | None, tools: list[int]) -> dict[str, Any] | None:
    """Return root and world in ``$BASE``, axes, links and tools as plain numbers in mm; None if unknown."""
    if cell is None or not cell.robot.geometry.known or cell.frames.base is None:
        return None
    geometry = cell.robot.geometry.array()
    flange = _flange_at_zero(geometry)
    reach_mm = float(geometry[3] + geometry[4])
    return {
        "model": cell.robot.title,
        "root": np.linalg.inv(cell.base_matrix()).T.reshape(-1).tolist(),
        "world": np.linalg.inv(cell.base_in_world()).T.reshape(-1).tolist(),
        "axes": [{"point": p.tolist(), "along": d.tolist()} for p, d in joint_axes(geometry)],
        "is_sketch": not cell.robot.body.capsules,
        "links": list(_links(cell, geometry, flange)),
        "cables": list(_cables(cell, geometry, flange)),
        "tools": {str(number): _tool(cell, number, flange, reach_mm) for number in tools},
        "obstacles": list(_obstacles(cell)),
    }


def _links(cell: Cell, geometry: Floats, flange: Floats) -> Iterator[dict[str, Any]]:
    """Yield the capsules of arm and spindle: number of the link, name, ends and radius."""
    frames = _frames(geometry, flange)
    for capsule in cell.robot.body.capsules:
        yield _capsule(LINKS.index(capsule.link), capsule.link, capsule, frames)
    if not cell.robot.body.capsules:
        reach_mm = float(geometry[3] + geometry[4])
        for link, a, b in _sketched(geometry):
            ends = {"from": a.tolist(), "to": b.tolist(), "radius": _THICKNESS[link] * reach_mm}
            yield {"link": link, "name": LINKS[link], **ends}
    for stretch in cell.spindle.body.capsules if cell.spindle.body is not None else ():
        yield _capsule(6, "spindle", stretch, frames)


def _cables(cell: Cell, geometry: Floats, flange: Floats) -> Iterator[dict[str, Any]]:
    """Yield stretches of cables: the first end turns with A3, the second with the flange."""
    frames = _frames(geometry, flange)
    for stretch in cell.cables.capsules if cell.cables is not None else ():
        start, end = frames[3] @ [*stretch.from_mm, 1.0], frames[6] @ [*stretch.to_mm, 1.0]
        yield {"from": start[:3].tolist(), "to": end[:3].tolist(), "radius": stretch.radius_mm}


def _frames(geometry: Floats, flange: Floats) -> list[Floats]:
    """Return the frame (4, 4) of each of `LINKS` in the root, all joints at zero."""
    frames = [np.eye(4) for _ in LINKS]
    for frame, point in zip(frames[2:6], _centres(geometry), strict=True):
        frame[:3, 3] = point
    frames[6] = flange
    return frames


def _capsule(link: int, name: str, capsule: Capsule, frames: list[Floats]) -> dict[str, Any]:
    start, end = ((frames[link] @ [*point, 1.0])[:3].tolist() for point in (capsule.from_mm, capsule.to_mm))
    return {"link": link, "name": name, "from": start, "to": end, "radius": capsule.radius_mm}


def _obstacles(cell: Cell) -> Iterator[dict[str, Any]]:
    """Yield table, boxes and planes: a name, a frame (4, 4) and two corners in it; of a mesh no corners.

    The frame stands in ``$BASE``, or in ``$WORLD`` where external axes do not carry what is drawn.
    """
    base, flat = np.eye(4), [-_PLANE_MM, -_PLANE_MM, -1.0, _PLANE_MM, _PLANE_MM, 0.0]
    robroot = np.eye(4) if cell.frames.robroot is None else cell.frames.robroot.matrix()
    frames = {"world": base, "robroot": root_in_world(cell.external, np.zeros((1, 6)), robroot)[0]}
    if cell.table is not None:
        at = base.copy()
        at[2, 3] = cell.table.z_mm
        yield _box("the table", at, flat)
    for obstacle in cell.obstacle:
        frame: Floats = frames.get(obstacle.frame, base)
        stands = obstacle.frame != "base"
        if obstacle.box_mm is not None:
            yield _box(obstacle.name, frame, [*obstacle.box_mm[0], *obstacle.box_mm[1]], stands=stands)
        elif obstacle.plane is not None:
            yield _box(obstacle.name, frame @ _across(obstacle.plane), flat, stands=stands)
        else:
            yield {"name": obstacle.name, "frame": frame.T.reshape(-1).tolist(), "stands": stands}


def _box(name: str, frame: Floats, corners: list[float], *, stands: bool = False) -> dict[str, Any]:
    place = frame.T.reshape(-1).tolist()
    return {"name": name, "frame": place, "low": corners[:3], "high": corners[3:], "stands": stands}


def _across(plane: Plane) -> Floats:
    """Return a frame (4, 4) on a plane whose z is its normal."""
    z = np.array(plane.normal) / np.linalg.norm(plane.normal)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2], frame[:3, 3] = x, np.cross(z, x), z, plane.point_mm
    return frame


def _centres(geometry: Floats) -> list[Floats]:
    """Return where the frames of A2 to A5 begin, all joints at zero."""
    a1, _, c1, c2, _, _ = geometry
    wrist = _wrist(geometry)
    return [np.array([a1, 0.0, c1]), np.array([a1 + c2, 0.0, c1]), wrist, wrist]


def joint_axes(geometry: Floats) -> list[tuple[Floats, Floats]]:
    """Return a point (3,) on each of the six axes and its direction (3,), with all joints at zero.

    From eq. 1 of `robot/kinematics.py`: Rz(-A1), Ry(A2), Ry(A3), Rx(-A4), Ry(A5), Rx(-A6).
    """
    a1, _, c1, c2, _, _ = geometry
    wrist = _wrist(geometry)
    down, across, back = np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0]), -_FORWARD
    points = (np.zeros(3), np.array([a1, 0.0, c1]), np.array([a1 + c2, 0.0, c1]), wrist, wrist, wrist)
    return list(zip(points, (down, across, across, back, across, back), strict=True))


def _wrist(geometry: Floats) -> Floats:
    a1, a2, c1, c2, c3, _ = geometry
    return np.array([a1 + c2 + c3, 0.0, c1 - a2])


def _flange_at_zero(geometry: Floats) -> Floats:
    """Return the flange (4, 4) in the root with all joints at zero; its z points out of it, along x."""
    flange = np.eye(4)
    flange[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    flange[:3, 3] = _wrist(geometry) + geometry[5] * _FORWARD
    return flange


def _sketched(geometry: Floats) -> list[tuple[int, Floats, Floats]]:
    """Return link (0 = the foot), start and end (3,) of each capsule."""
    a1, a2, c1, c2, c3, c4 = geometry
    shoulder, elbow = np.array([a1, 0.0, c1]), np.array([a1 + c2, 0.0, c1])
    wrist, half = _wrist(geometry), np.array([a1 + c2 + 0.5 * c3, 0.0, c1 - a2])
    return [
        (0, np.zeros(3), np.array([0.0, 0.0, 0.4 * c1])),
        (1, np.array([0.0, 0.0, 0.55 * c1]), shoulder),
        (2, shoulder, elbow),
        (3, elbow, half),
        (4, half, wrist),
        (5, wrist, wrist + 0.4 * c4 * _FORWARD),
        (6, wrist + 0.7 * c4 * _FORWARD, wrist + c4 * _FORWARD),
    ]


def _tool(cell: Cell, number: int, flange: Floats, reach_mm: float) -> dict[str, Any] | None:
    """Return tip, axis, flange and sizes of a tool, all joints at zero; None where it is not known."""
    try:
        frame = flange @ cell.tool_matrix(number)
    except RefusedError:
        return None
    tool = cell.tool[number]
    length_mm = tool.stick_out_mm or tool.length_mm or _FALLBACK_CUTTER_MM
    return {
        "tip": frame[:3, 3].tolist(),
        "axis": frame[:3, 2].tolist(),
        "flange": flange[:3, 3].tolist(),
        "cutter": f"the cutter of T{number}",
        "diameter": tool.diameter_mm,
        "length": length_mm,
        "holder": _holder(tool, number),
        "radius": None if cell.spindle.body is not None else _SPINDLE * reach_mm,
    }


def _holder(tool: Tool, number: int) -> dict[str, Any] | None:
    """Return name, diameter and upper end of a holder, None where it is not stated."""
    if tool.stick_out_mm is None or tool.holder_diameter_mm is None or tool.length_mm is None:
        return None
    name, end_mm = f"the holder of T{number}", max(tool.length_mm, tool.stick_out_mm)
    return {"name": name, "diameter": tool.holder_diameter_mm, "to": end_mm}
