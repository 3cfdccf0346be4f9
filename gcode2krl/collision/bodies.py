"""What may hit: the capsules of the arm, the spindle, the holder and the cutter of a tool.

A capsule has round ends, a tool and its holder have flat ones. Their cylinder is one capsule that begins its
own radius behind the face, and four across the face whose ends lie on its rim: together they hold the
cylinder but for its edge, which they round by up to 0.1 of the radius, and reach beyond it sideways by 0.08.
"""

import math
from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import Tool
from gcode2krl.collision.scene import Bodies, bodies_of

Kind = Literal["arm", "spindle", "cables", "holder", "cutter"]
CABLES = "the cables"
FOOT, UPPER_ARM, ELBOW, FOREARM, WRIST, FLANGE = 0, 2, 3, 4, 5, 6
"""Numbers of links; 1 turns with A1."""
_LINKS = {"foot": 0, "A1": 1, "A2": 2, "A3": 3, "A4": 4, "A5": 5, "A6": 6}
_SPOKES = 4
_RIM = 1.0 / math.cos(math.pi / (2 * _SPOKES))
"""So much farther out the ends of the spokes are, so that the rim between two of them lies within."""
_EDGE_SHARE = 0.25
"""Radius of a spoke over that of the cylinder."""


class Capsule(NamedTuple):
    """One capsule."""

    name: str
    kind: Kind
    link: int
    ends_mm: Floats
    """(2, 3) in the frame of the link."""
    radius_mm: float
    is_face: bool = False
    """Across the flat end of a cylinder."""
    second_link: int | None = None
    """The link of the second end, where that is another one."""


def parts_of(cell: Cell, tool: int) -> list[Capsule]:
    """Return the capsules of the arm, its cables, and what is on its flange with a tool in the spindle."""
    return [*arm_and_spindle(cell), *_cables(cell), *_tool(cell, tool)]


def arm_and_spindle(cell: Cell) -> list[Capsule]:
    """Return the capsules of the arm and of what is on its flange whatever the tool."""
    return [*_arm(cell), *_spindle(cell)]


def capsules_of(parts: list[Capsule], geometry: Floats) -> Bodies:
    """Return capsules as the core takes them."""
    ends = np.array([part.ends_mm for part in parts]).reshape(-1, 6)
    links = [(each.link, each.link if each.second_link is None else each.second_link) for each in parts]
    return bodies_of(links, ends, [part.radius_mm for part in parts], geometry)


def _arm(cell: Cell) -> Iterator[Capsule]:
    for capsule in cell.robot.body.capsules:
        ends = np.array([capsule.from_mm, capsule.to_mm])
        yield Capsule(capsule.link, "arm", _LINKS[capsule.link], ends, capsule.radius_mm)


def _spindle(cell: Cell) -> Iterator[Capsule]:
    if cell.spindle.body is not None:
        for capsule in cell.spindle.body.capsules:
            ends = np.array([capsule.from_mm, capsule.to_mm])
            yield Capsule("spindle", "spindle", FLANGE, ends, capsule.radius_mm)


def _cables(cell: Cell) -> Iterator[Capsule]:
    if cell.cables is not None:
        for capsule in cell.cables.capsules:
            ends = np.array([capsule.from_mm, capsule.to_mm])
            yield Capsule(CABLES, "cables", ELBOW, ends, capsule.radius_mm, second_link=FLANGE)


def _tool(cell: Cell, number: int) -> Iterator[Capsule]:
    """Yield the cutter up to its holder, and the holder up to the gauge line, as far as they are stated."""
    tool = cell.tool.get(number)
    if tool is None or cell.missing_of_tool(number):
        return
    frame = cell.tool_matrix(number)
    end_mm = cutter_length_mm(tool)
    if end_mm is not None:
        radius_mm = tool.diameter_mm / 2
        name = f"the cutter of T{number}"
        if tool.kind in ("ball", "tapered"):
            yield _along_axis(name, "cutter", frame, min(radius_mm, end_mm), end_mm, radius_mm)
        else:
            yield from _cylinder(name, "cutter", frame, 0.0, end_mm, radius_mm)
    span = holder_span_mm(tool)
    if span is not None and tool.holder_diameter_mm is not None:
        name = f"the holder of T{number}"
        yield from _cylinder(name, "holder", frame, *span, tool.holder_diameter_mm / 2)


def cutter_length_mm(tool: Tool) -> float | None:
    """Return how far the cutter sticks out, as far as the cell tells."""
    return tool.stick_out_mm or tool.length_mm or tool.flute_length_mm


def holder_span_mm(tool: Tool) -> tuple[float, float] | None:
    """Return from where to where above the tip the holder is, None where it is not stated."""
    if tool.stick_out_mm is None or tool.holder_diameter_mm is None or tool.length_mm is None:
        return None
    return tool.stick_out_mm, max(tool.length_mm, tool.stick_out_mm)


def _cylinder(
    name: str, kind: Kind, frame: Floats, low_mm: float, high_mm: float, radius_mm: float
) -> Iterator[Capsule]:
    wide_mm, edge_mm = radius_mm * _RIM, radius_mm * _EDGE_SHARE
    yield _along_axis(name, kind, frame, low_mm + wide_mm, max(high_mm, low_mm + wide_mm), wide_mm)
    for spoke in range(_SPOKES):
        angle = math.pi * spoke / _SPOKES
        out = (wide_mm - edge_mm) * np.array([math.cos(angle), math.sin(angle), 0.0])
        middle = np.array([0.0, 0.0, low_mm + edge_mm])
        yield Capsule(
            name, kind, FLANGE, _moved(frame, np.stack([middle - out, middle + out])), edge_mm, True
        )


def _along_axis(name: str, kind: Kind, frame: Floats, low: float, high: float, radius_mm: float) -> Capsule:
    ends = _moved(frame, np.array([[0.0, 0.0, low], [0.0, 0.0, high]]))
    return Capsule(name, kind, FLANGE, ends, radius_mm)


def _moved(frame: Floats, points: Floats) -> Floats:
    moved: Floats = points @ frame[:3, :3].T + frame[:3, 3]
    return moved
