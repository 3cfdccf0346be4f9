"""Keys of a cell that contradict each other: what cannot be is an error, what is hardly meant a warning."""

from collections.abc import Collection, Iterator
from itertools import chain

from gcode2krl.cell.definition import Cell
from gcode2krl.cell.layout import layout_issues
from gcode2krl.cell.m_codes import m_code_issues
from gcode2krl.cell.proportions import proportion_issues
from gcode2krl.errors import Issue


def contradictory(cell: Cell, tools: Collection[int] | None = None) -> Iterator[Issue]:
    """Yield each contradiction of a resolved cell with its key; with ``tools``, of no other tools."""
    for issue in chain(m_code_issues(cell), layout_issues(cell), proportion_issues(cell)):
        of_tool = issue.key.startswith("tool.")
        if tools is None or not of_tool or int(issue.key.split(".")[1]) in tools:
            yield issue
