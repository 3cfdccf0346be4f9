"""Where a test program runs in a cell, how large it is and how fast."""

from dataclasses import dataclass

from gcode2krl.cell import Cell
from gcode2krl.cell.carried import require_still
from gcode2krl.errors import input_error
from gcode2krl.identify.trial_program import most_rpm, mounted_tool, origin_of

Point = tuple[float, float, float]
SIZE_MM = 100.0
"""Side of the square that a program stays in by default: small enough to be air in most cells."""
_LEAST_SIZE_MM, _MOST_SIZE_MM = 20.0, 600.0
_MOST_PERCENT = 100.0
_IDLE_RPM = 1000.0
"""Turns the spindle for feed moves, which nothing may make with a standing one."""


@dataclass(frozen=True, kw_only=True)
class ProgramPlace:
    """Where a program runs, how large it is and how fast."""

    origin_mm: Point
    """In ``$BASE``."""
    size_mm: float
    percent: float
    """Of the program's own feeds."""
    tool: int
    most_rpm: float
    idle_rpm: float

    @property
    def share(self) -> float:
        """Return the percentage as a share."""
        return self.percent / _MOST_PERCENT


def place_of(
    cell: Cell,
    at_mm: Point | None = None,
    size_mm: float = SIZE_MM,
    percent: float = _MOST_PERCENT,
) -> ProgramPlace:
    """Return the place of a program in a cell, by default that of the controller's test.

    Raises
    ------
    RefusedError
        Where the cell has no clearance plane, or no mounted tool.
    NotUnderstoodError
        Where the place lies above the clearance plane, or size or speed are out of range.
    """
    require_still(cell, "a test program")
    if not _LEAST_SIZE_MM <= size_mm <= _MOST_SIZE_MM:
        allowed = f"{_LEAST_SIZE_MM:g} to {_MOST_SIZE_MM:g} mm"
        raise input_error(
            "option-value", f"--size {size_mm:g} mm: allowed are {allowed}", "choose another size"
        )
    if not 0.0 < percent <= _MOST_PERCENT:
        raise input_error(
            "option-value", f"--speed {percent:g} %: allowed are up to 100", "choose another speed"
        )
    tool = mounted_tool(cell)
    most = most_rpm(cell, tool)
    return ProgramPlace(
        origin_mm=origin_of(cell, at_mm),
        size_mm=float(size_mm),
        percent=float(percent),
        tool=tool,
        most_rpm=most,
        idle_rpm=min(_IDLE_RPM, most),
    )
