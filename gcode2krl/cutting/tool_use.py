"""Cuts that a kind of tool is not made for: a drill sideways, a mill straight down too fast."""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import Material, Tool
from gcode2krl.errors import Issue
from gcode2krl.tables import Forces

STEEP_RAD = np.deg2rad(20.0)
"""Descent above which a mill goes down rather than along: assumed, ramps are flatter."""
_FLAT_RAD = np.deg2rad(45.0)
"""Descent, and rise, below which a drill goes sideways: assumed."""
_MET_MM = 0.1
"""Less material below the tool is the rest of an earlier pass."""
_PLUNGE_MM, _PLUNGE_OF_DIAMETER = 0.1, 0.015
"""Feed per tooth straight down that a mill in metal takes: assumed, three times what makers of end mills
advise, a third to a half of 0.005 to 0.01 of the diameter."""
_SOFTER = 3.0
"""How much faster a mill may plunge in wood and foam: assumed."""


class Uses:
    """The first place of each tool with a cut that its kind is not made for."""

    def __init__(self, cell: Cell, tools: Sequence[int]) -> None:
        """Take the cell and the tools that move."""
        self._cell, self._tools = cell, tools
        self._found: dict[int, Issue] = {}

    def take(
        self, line: Ints32, rapid: Bools, f_z_mm: Floats, ramp_rad: Floats, centre_mm: Floats, forces: Forces
    ) -> None:
        """Judge the next samples (m,).

        The columns hold G-code line, rapid or not, programmed feed per tooth, descent, and the material below
        the tool's middle.
        """
        engaged = np.isfinite(forces.phi_rad[:, 0]) & ~rapid
        for number in self._tools:
            if number in self._found:
                continue
            tool, with_tool = self._cell.tool[number], engaged & (forces.tool == number)
            if tool.kind == "drill":
                wrong = with_tool & (np.abs(ramp_rad) < _FLAT_RAD) & (forces.a_p_mm > _MET_MM)
                if wrong.any():
                    self._found[number] = _sideways(number, int(line[np.argmax(wrong)]))
                continue
            most_mm = plunge_limit_mm(tool, self._cell.material)
            down_mm = f_z_mm * np.sin(ramp_rad)
            wrong = with_tool & (ramp_rad > STEEP_RAD) & (centre_mm > _MET_MM) & (down_mm > most_mm)
            if wrong.any():
                row = int(np.argmax(wrong))
                self._found[number] = _fast_plunge(number, tool, float(down_mm[row]), most_mm, int(line[row]))

    def issues(self) -> list[Issue]:
        """Return one warning for each such tool, by its number."""
        return [self._found[number] for number in sorted(self._found)]


def plunge_limit_mm(tool: Tool, material: Material | None) -> float:
    """Return the feed per tooth in mm above which a plunge is doubtful."""
    softer = _SOFTER if material is not None and material.is_soft else 1.0
    return softer * max(_PLUNGE_MM, _PLUNGE_OF_DIAMETER * tool.diameter_mm)


def _sideways(number: int, line: int) -> Issue:
    sentence = f"T{number} is a drill and cuts sideways: its edges are at its point, and it breaks"
    remedy = f"use a mill, or correct tool.{number}.kind (a chamfer mill is tapered)"
    return Issue("warning", "drill-sideways", line, sentence, remedy)


def _fast_plunge(number: int, tool: Tool, down_mm: float, most_mm: float, line: int) -> Issue:
    sentence = (
        f"T{number} plunges into material with a feed of {down_mm:.2g} mm a tooth, more than "
        f"{most_mm:.2g} mm for a mill of {tool.diameter_mm:g} mm"
    )
    return Issue("warning", "plunge-fast", line, sentence, "lower F for the plunge, or ramp down")
