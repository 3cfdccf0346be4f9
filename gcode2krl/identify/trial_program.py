"""The test program whose trace `identify_controller` reads: air moves at one height, G-code.

Rest-to-rest sections, each ended by an exact stop and a dwell, so that a trace can be cut at its standstills:
single lines of 1-50 mm at three speeds (they decide k and the law), two lines at unequal speeds, and
corners of 30-170° (they decide the effective CDIS). Lines on which the tool turns cannot be written in
three-axis G-code: `with_turning_lines` adds them to the targets, for a program that is written as KRL.
"""

import math
from dataclasses import fields, replace
from typing import Any

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import missing
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.tables import Targets
from gcode2krl.units import MM_PER_M, RAD_PER_DEG, S_PER_MIN

LENGTHS_MM = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
SPEEDS_MM_S = (25.0, 100.0, 200.0)
ANGLES_DEG = (30.0, 60.0, 90.0, 120.0, 150.0, 170.0)
CDIS_MM = 5.0
CORNER_LINE_MM = 40.0
DWELL_S = 0.3
TURNS = ((20.0, 5.0), (40.0, 10.0), (40.0, 20.0), (80.0, 30.0))
"""Lines that turn the tool: length in mm and angle in degrees, there and back."""
BELOW_CLEARANCE_MM = 40.0
_SPINDLE_RPM = 1000.0
_ROW_MM = 10.0
_P_GRID_MM = 1e-4
Point = tuple[float, float]


def controller_test_program(cell: Cell, origin_mm: tuple[float, float, float] | None = None) -> str:
    """Return the G-code of the test program.

    Parameters
    ----------
    cell : its tool, clearance plane and largest path speed are used.
    origin_mm : where the lines begin, in ``$BASE``; by default (100, 0) and 40 mm below the clearance plane.
        The program stays within x 0..+88, y -50..+40 of it and at its height.

    Raises
    ------
    RefusedError
        Where the cell has no clearance plane or no mounted tool.
    NotUnderstoodError
        Where the origin lies above the clearance plane.
    """
    x0, y0, z0 = origin_of(cell, origin_mm)
    tool = mounted_tool(cell)
    speeds = _speeds(cell)
    program = _Writer(x0, y0, z0)
    program.head(tool, min(_SPINDLE_RPM, most_rpm(cell, tool)))
    for row, speed in enumerate(speeds):
        _single_lines(program, speed, y_mm=-_ROW_MM * (row + 1), forward=row % 2 == 0)
    _unequal_speeds(program, speeds[0], speeds[-1], y_mm=-_ROW_MM * (len(speeds) + 2))
    program.line_to(0.0, 0.0, speeds[-1])
    program.stop()
    for angle in ANGLES_DEG:
        _corner(program, angle, speeds)
    program.tail()
    return "\n".join(program.lines) + "\n"


def with_turning_lines(targets: Targets, cell: Cell) -> Targets:
    """Return the test program's targets with lines at its end on which the tool turns, there and back.

    They begin and end where the last line ended, along x, turning about -y, which bends the wrist more;
    each ends with an exact stop and a dwell. They carry row and line of the last programmed motion.
    """
    last = int(np.flatnonzero(targets.move >= 0)[-1])
    count = 2 * len(TURNS)
    turns = np.array(TURNS)
    away = np.arange(count) % 2 == 0
    position = np.repeat(targets.position_mm[last : last + 1], count, axis=0)
    position[away, 0] += turns[:, 0]
    rotation = np.repeat(targets.rotation[last : last + 1], count, axis=0)
    turned = fr.rotation_from_quaternion(rotation[away])
    abc = np.zeros((len(turns), 3))
    abc[:, 1] = -turns[:, 1] * RAD_PER_DEG
    rotation[away] = fr.quaternion_from_rotation(fr.rotation_from_abc(abc) @ turned)
    speed = np.full(count, _speeds(cell)[-1])
    added: dict[str, Any] = {"position_mm": position, "rotation": rotation, "speed_mm_s": speed}
    columns: dict[str, Any] = {}
    for spec in fields(targets):
        if "tail" not in spec.metadata:
            continue
        values = getattr(targets, spec.name)
        new = added.get(spec.name, np.repeat(values[last : last + 1], count, axis=0))
        columns[spec.name] = np.concatenate([values[: last + 1], new, values[last + 1 :]])
    events = tuple(
        event._replace(row=event.row + count) if event.row >= last else event for event in targets.events
    )
    return replace(targets, **columns, events=events)


def corner_tolerance_mm(angle_deg: float, cdis_mm: float = CDIS_MM) -> float:
    """Return the P of G64 that gives a CDIS at a corner: CDIS·cos(alpha/2)/2 (Bigliardi et al., eq. 1-3)."""
    exact = cdis_mm * math.cos(0.5 * angle_deg * RAD_PER_DEG) / 2.0
    return math.ceil(exact / _P_GRID_MM) * _P_GRID_MM


class _Writer:
    """Lines of G-code; positions are relative to the origin."""

    def __init__(self, x_mm: float, y_mm: float, z_mm: float) -> None:
        self.origin = np.array([x_mm, y_mm])
        self.z_mm = z_mm
        self.lines: list[str] = []

    def head(self, tool: int, rpm: float) -> None:
        x, y = self.origin
        self.lines += [
            "%",
            "(TEST OF THE CONTROLLER: RECORD THE COMMANDED POSITION AT THE INTERPOLATION CYCLE)",
            "(AIR MOVES: NO WORK, NO CLAMPS BELOW THE TOOL, OVERRIDE 100 PERCENT)",
            "(LINES THAT TURN THE TOOL ARE ONLY IN THE KRL FORM OF THIS TEST)",
            "G21 G90 G17 G40 G49 G80 G94",
            f"T{tool} M6",
            f"S{rpm:.0f} M3",
            f"G0 G43 H{tool} Z{self.z_mm:.3f}",
            f"G0 X{x:.3f} Y{y:.3f}",
            "G61",
            f"G4 P{DWELL_S}",
        ]

    def comment(self, text: str) -> None:
        self.lines.append(f"({text})")

    def line_to(self, x_mm: float, y_mm: float, speed_mm_s: float) -> None:
        x, y = self.origin + np.array([x_mm, y_mm])
        self.lines.append(f"G1 X{x:.3f} Y{y:.3f} F{speed_mm_s * S_PER_MIN:g}")

    def blend(self, tolerance_mm: float) -> None:
        self.lines.append(f"G64 P{tolerance_mm:.4f}")

    def stop(self) -> None:
        self.lines.append(f"G4 P{DWELL_S}")

    def exact(self) -> None:
        self.lines.append("G61")

    def tail(self) -> None:
        self.lines += ["M5", "M30", "%"]


def _single_lines(program: _Writer, speed_mm_s: float, y_mm: float, forward: bool) -> None:
    """Write the lines of one speed, end to end along x."""
    program.comment(f"SINGLE LINES AT {speed_mm_s:g} MM/S")
    ends = np.concatenate([[0.0], np.cumsum(LENGTHS_MM)])
    if not forward:
        ends = ends[::-1]
    for x_mm in ends.tolist():
        program.line_to(x_mm, y_mm, speed_mm_s)
        program.stop()


def _unequal_speeds(program: _Writer, slow_mm_s: float, fast_mm_s: float, y_mm: float) -> None:
    """Write two lines at 170° with a change of speed, up on the way there and down on the way back."""
    program.comment(f"TWO LINES, {slow_mm_s:g} THEN {fast_mm_s:g} MM/S, AND BACK FROM FAST TO SLOW")
    start, vertex, end = _bent(ANGLES_DEG[-1], y_mm)
    program.line_to(*start, slow_mm_s)
    program.stop()
    _through_corner(program, (vertex, end), (slow_mm_s, fast_mm_s), ANGLES_DEG[-1])
    _through_corner(program, (vertex, start), (fast_mm_s, slow_mm_s), ANGLES_DEG[-1])


def _corner(program: _Writer, angle_deg: float, speeds_mm_s: tuple[float, ...]) -> None:
    """Write a corner, there at the middle and back at the lowest of the speeds."""
    program.comment(f"CORNER OF {angle_deg:g} DEG, CDIS {CDIS_MM:g} MM")
    start, vertex, end = _bent(angle_deg, 0.0)
    _through_corner(program, (vertex, end), (speeds_mm_s[1], speeds_mm_s[1]), angle_deg)
    _through_corner(program, (vertex, start), (speeds_mm_s[0], speeds_mm_s[0]), angle_deg)


def _bent(angle_deg: float, y_mm: float) -> tuple[Point, Point, Point]:
    """Return start, vertex and end of two lines with an interior angle."""
    turn = (180.0 - angle_deg) * RAD_PER_DEG
    end = (CORNER_LINE_MM * (1.0 + math.cos(turn)), y_mm + CORNER_LINE_MM * math.sin(turn))
    return (0.0, y_mm), (CORNER_LINE_MM, y_mm), end


def _through_corner(
    program: _Writer, points: tuple[Point, Point], speeds_mm_s: tuple[float, float], angle_deg: float
) -> None:
    """Write one way through a corner: blended at the vertex, an exact stop and a dwell at the end."""
    program.blend(corner_tolerance_mm(angle_deg))
    program.line_to(*points[0], speeds_mm_s[0])
    program.exact()
    program.line_to(*points[1], speeds_mm_s[1])
    program.stop()


def origin_of(cell: Cell, origin_mm: tuple[float, float, float] | None) -> tuple[float, float, float]:
    """Return where a test program begins in ``$BASE``; errors as for `controller_test_program`."""
    clearance = cell.clearance_z_mm
    if clearance is None:
        raise RefusedError(
            Issue(
                "error",
                "no-clearance",
                0,
                "the cell has no clearance plane to approach and leave on",
                "give [clearance] z_mm in the cell",
            )
        )
    x, y, z = origin_mm if origin_mm is not None else (100.0, 0.0, clearance - BELOW_CLEARANCE_MM)
    if z > clearance:
        raise input_error(
            "option-value",
            f"the height {z:g} mm lies above the clearance plane at {clearance:g} mm",
            "choose a lower Z with --at",
        )
    return x, y, z


def mounted_tool(cell: Cell) -> int:
    """Return the tool to call: the mounted one, so that no tool change is needed."""
    number = cell.mounted_tool
    if number is None or number not in cell.tool:
        raise RefusedError(
            Issue(
                "error",
                "tool-missing",
                0,
                "the cell does not say which tool is mounted",
                "give mounted_tool in the cell",
            )
        )
    return number


def most_rpm(cell: Cell, tool: int) -> float:
    """Return the largest speed of spindle and tool. Raises where the cell does not state the spindle's."""
    of_tool, most = cell.tool[tool].max_rpm, cell.spindle.max_rpm
    if most is None:
        raise missing("spindle.max_rpm")
    return most if of_tool is None else min(of_tool, most)


def _speeds(cell: Cell) -> tuple[float, ...]:
    """Return the three speeds in mm/s, lowered in proportion where the cell allows less."""
    most = cell.controller.vel_cp_m_s * MM_PER_M
    share = min(1.0, most / SPEEDS_MM_S[-1])
    return tuple(speed * share for speed in SPEEDS_MM_S)
