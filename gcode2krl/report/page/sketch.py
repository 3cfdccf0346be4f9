"""The robot as the page draws it: capsules between its joint centres, and the axes that they turn about.

No robot of the library states the shape of its links, so the thickness is a sketch; the joint centres are
those of the kinematics. Everything is stated in the robot root with all joints at zero; from there the turns
about axes 1 to k, the last first, move link k (a product of exponentials), which is all that the page needs.
"""

from typing import Any

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.errors import RefusedError

_THICKNESS = (0.10, 0.095, 0.07, 0.065, 0.05, 0.042, 0.035)
"""Radius of each link as a share of the arm's length c2 + c3, as on robots of this build."""
_SPINDLE = 0.035
_FORWARD = np.array([1.0, 0.0, 0.0])
_FALLBACK_CUTTER_MM = 50.0


def robot_sketch(cell: Cell | None, tools: list[int]) -> dict[str, Any] | None:
    """Return root, axes, links and tools of the robot as plain numbers in mm; None where it is not known."""
    if cell is None or not cell.robot.geometry.known or cell.frames.base is None:
        return None
    geometry = cell.robot.geometry.array()
    flange = _flange_at_zero(geometry)
    reach_mm = float(geometry[3] + geometry[4])
    return {
        "model": cell.robot.model,
        "root": np.linalg.inv(cell.base_matrix()).T.reshape(-1).tolist(),
        "axes": [{"point": p.tolist(), "along": d.tolist()} for p, d in joint_axes(geometry)],
        "links": [
            {"link": link, "from": a.tolist(), "to": b.tolist(), "radius": _THICKNESS[link] * reach_mm}
            for link, a, b in _capsules(geometry)
        ],
        "tools": {str(number): _tool(cell, number, flange, reach_mm) for number in tools},
    }


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


def _capsules(geometry: Floats) -> list[tuple[int, Floats, Floats]]:
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
        "diameter": tool.diameter_mm,
        "length": length_mm,
        "radius": _SPINDLE * reach_mm,
    }
