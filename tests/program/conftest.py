"""G-code to Targets, printed as a plan that a test can compare."""

import io

import pytest

from gcode2krl import set_targets
from gcode2krl.gcode import read_stream
from tests.cells import over_demonstration


class Plan:
    """The Targets of a piece of G-code, with short ways to look at them."""

    def __init__(self, text: str, data: dict, tolerance_mm: float | None):
        self.text = text
        self.cell = over_demonstration(data)
        self.toolpath = read_stream(io.BytesIO(text.encode()), "part.nc", self.cell)
        self.targets = set_targets(self.toolpath, self.cell, tolerance_mm)

    @property
    def steps(self) -> list:
        """``HOME``, or the kind and the point of each motion."""
        targets, steps = self.targets, []
        for row in range(len(targets)):
            if targets.home[row]:
                steps.append("HOME")
            else:
                kind = "PTP" if targets.ptp[row] else "LIN"
                steps.append((kind, *(round(float(v), 6) for v in targets.position_mm[row])))
        return steps

    def row_of(self, *point) -> int:
        """Return the row of the only motion to a point."""
        (row,) = [k for k, step in enumerate(self.steps) if step[1:] == point]
        return row

    def events_at(self, row: int) -> list:
        """Return kind and value of the events at a row."""
        value = {"tool": "tool", "spindle": "rpm", "coolant": "flood", "message": "text"}
        return [(e.kind, e.values[value[e.kind]]) for e in self.targets.events if e.row == row]

    def codes(self) -> dict:
        """Return the errors as code → line."""
        return {issue.code: issue.line for issue in self.targets.issues if issue.severity == "error"}


@pytest.fixture
def plan():
    def plan(text: str, data: dict | None = None, tolerance_mm: float | None = None) -> Plan:
        return Plan(text, data or {}, tolerance_mm)

    return plan
