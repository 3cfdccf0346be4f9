"""Tools that a program names and does not change to: diameters in comments, T without M6.

The tool in the comment is the one that the path was made for; another in the cell gives another part, and
wrong forces. The forms that posts write (`_DIAMETER`) are read, where it is certain which tool is meant;
other comments are ignored. A search for a few words comes first, so that a file without them takes almost no
time.
"""

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import Issue
from gcode2krl.tables import Toolpath
from gcode2krl.units import MM_PER_INCH

if TYPE_CHECKING:  # a cell file costs its library a noticeable start
    from gcode2krl.cell import Cell

_WORDS = (b"D=", b"DIA", b"MILL", b"M6", b"M06")
_NUMBER = r"(\d+(?:\.\d*)?|\.\d+|\d+/\d+)"
_UNIT = r"""(MM|INCH(?:ES)?|IN\b|")?"""
_MILL = r"(?:(?:FLAT|BALL|BULL|SQUARE|CARBIDE|HSS|SPIRAL|UPCUT|DOWNCUT|\dF|\d-FLUTE)[- ]*){0,3}"
_DIAMETER = tuple(
    re.compile(pattern)
    for pattern in (
        rf"\bT\s*\d+\b.*?\bD\s*=\s*{_NUMBER}\s*{_UNIT}",  # Fusion, HSM: T1 D=10. CR=0. - flat end mill
        rf"\b(?:TOOL|CUTTER|MILL|BIT)[ _]*DIA(?:METER|M)?\b\.?\s*[-:=]*\s*{_NUMBER}\s*{_UNIT}",
        rf"\bTOOL\b.*\bDIAMETER\s*[:=]\s*{_NUMBER}\s*{_UNIT}",  # FreeCAD: Tool Path. Diameter: 4.0
        rf"\bEND\s?MILL\s*[\[{{]\s*{_NUMBER}\s*{_UNIT}\s*[\]}}]",  # Vectric: End Mill {6 mm}
        rf"(?<![\d./]){_NUMBER}\s*(MM|INCH|IN\b|\")[- ]*{_MILL}END\s?MILL\b",  # FreeCAD: 5mm Endmill
        rf"(?<![\d./])(\d+\.\d*|\.\d+|\d+/\d+)()[- ]*{_MILL}END\s?MILL\b",  # Mastercam: 10. FLAT ENDMILL
    )
)
_TOOL = re.compile(r"\bT(?:OOL)?\s*[-#:=]?\s*(\d+)\b(?!\s*(?:MM|IN\b|INCH|\"|[./]\d))")
_CHANGE = re.compile(r"\bM0?6\s*T\s*(\d+)\b|\bT\s*(\d+)\s*M0?6\b")
_OTHER = re.compile(r"\b(?:STOCK|HOLE|BORE|POCKET|HOLDER|SHANK|OFFSET|TAPER)\b")
_COMMENT = re.compile(rb"\(([^)\n]*)\)|;([^\n]*)")
_SLACK, _SLACK_MM = 0.02, 0.05
"""Comments round; a worn or reground mill is this far off."""
_SURE = ("verified", "checked")
"""What the cell says of a tool that a person has looked at."""


class NamedTool(NamedTuple):
    """What a comment says of a tool."""

    line: int
    tool: int | None
    value: float = 0.0
    """Its diameter, 0 where none is named."""
    unit: str = ""
    """``mm``, ``inch`` or empty."""
    is_change: bool = False
    """The comment is a tool change that a post has left out: ``( M6 T2 )``."""


def named_tools(text: bytes, first_line: int) -> Iterator[NamedTool]:
    """Yield the tools that the comments of some whole lines name; the first line has this number.

    A diameter without a tool behind a change in a comment is that of its tool.
    """
    if b"(" not in text and b";" not in text:
        return
    capitals = text.upper()
    at, changed_to = -1, None
    for place in sorted({at for word in _WORDS for at in _places(capitals, word)}):
        if place < at:
            continue
        begin, at = capitals.rfind(b"\n", 0, place) + 1, capitals.find(b"\n", place)
        at = at if at >= 0 else len(capitals)
        for comment in _COMMENT.finditer(capitals[begin:at]):
            words = (comment[1] or comment[2] or b"").decode("latin-1")
            change, said = _CHANGE.search(words), _said(words)
            line = first_line + capitals.count(b"\n", 0, begin) if change or said else 0
            if change is not None:
                changed_to = int(change[1] or change[2])
                yield NamedTool(line, changed_to, is_change=True)
            if said is not None:
                tool, value, unit = said
                yield NamedTool(line, changed_to if tool is None else tool, value, unit)


def _places(text: bytes, word: bytes) -> Iterator[int]:
    at = text.find(word)
    while at >= 0:
        yield at
        at = text.find(word, at + 1)


def _said(comment: str) -> tuple[int | None, float, str] | None:
    if _OTHER.search(comment):
        return None
    for pattern in _DIAMETER:
        match = pattern.search(comment)
        if match is not None:
            tool = _TOOL.search(comment)
            unit = (match[2] or "").replace('"', "IN")[:2]
            return int(tool[1]) if tool else None, _value(match[1]), {"MM": "mm", "IN": "inch"}.get(unit, "")
    return None


def _value(text: str) -> float:
    above, _, below = text.partition("/")
    return float(above) / float(below) if below and float(below) else float(above)


def other_tools(named: list[NamedTool], toolpath: Toolpath, cell: "Cell") -> Iterator[Issue]:
    """Yield a finding for each tool whose diameter in a comment is not that of the cell.

    An error where both are sure: the comment names the tool, and a person has checked the cell's. A comment
    without a tool number counts where the program has one tool.
    """
    used = {int(number) for number in distinct(toolpath.tool[1:])}
    used -= {0} if len(used) > 1 else set()
    only = next(iter(used)) if len(used) == 1 else 0
    named_once: set[int] = set()
    for said in named:
        number = said.tool if said.tool is not None else only
        tool = cell.tool.get(number)
        if number in named_once or number not in used or tool is None or tool.kind == "tapered":
            continue
        if _may_be(said, tool.diameter_mm):
            continue
        named_once.add(number)
        unit = f" {said.unit}" if said.unit else ""
        is_sure = said.tool is not None and (tool.sure in _SURE or cell.is_confirmed)
        yield Issue(
            "error" if is_sure else "warning",
            "tool-differs",
            said.line,
            f"the comment gives T{number} a diameter of {said.value:g}{unit}, the cell has "
            f"{tool.diameter_mm:g} mm",
            f"correct tool.{number}.diameter_mm in the cell, or put the right tool into the magazine",
        )


def changes_in_comments(named: list[NamedTool], toolpath: Toolpath, cell: "Cell") -> Iterator[Issue]:
    """Yield a warning where comments change to a tool that no M6 puts into the spindle."""
    changes = [said for said in named if said.is_change]
    events = [event for event in toolpath.events if event.kind == "tool"]
    there: set[int | None] = {int(event.values["tool"]) for event in events} or {cell.mounted_tool}
    missing = next((said for said in changes if said.tool not in there), None)
    numbers = {said.tool for said in changes}
    if missing is None or (len(numbers) == 1 and not events and cell.mounted_tool is None):
        return
    if len(numbers) > 1 or events:
        what = f"a comment changes to T{missing.tool}, and no M6 does: it would cut with the tool before it"
        remedy = "let the post write T and M6, or one program a tool"
    else:
        number, mounted = missing.tool, cell.mounted_tool
        what = f"a comment changes to T{number}, and no M6 does: the cell says that tool {mounted} is mounted"
        remedy = f"mount tool {number} and give mounted_tool = {number} in the cell, or let the post write M6"
    yield Issue("warning", "tool-not-changed", missing.line, what, remedy)


def tool_not_changed(number: int, line: int, toolpath: Toolpath, cell: "Cell") -> Iterator[Issue]:
    """Yield a warning where the program names one tool, changes to none, and the cell has another mounted."""
    changes = any(event.kind == "tool" for event in toolpath.events)
    if number <= 0 or changes or cell.mounted_tool in (None, number):
        return
    yield Issue(
        "warning",
        "tool-not-changed",
        line,
        f"T{number} is named, but no M6 puts it into the spindle: the cell says that tool "
        f"{cell.mounted_tool} is mounted",
        f"mount tool {number} and give mounted_tool = {number} in the cell, or let the post write M6",
    )


def _may_be(said: NamedTool, diameter_mm: float) -> bool:
    """Tell whether a comment may mean this diameter; a comment without a unit may mean mm or inches."""
    in_mm = {"mm": (1.0,), "inch": (MM_PER_INCH,), "": (1.0, MM_PER_INCH)}[said.unit]
    slack_mm = _SLACK * diameter_mm + _SLACK_MM
    return said.value <= 0.0 or any(abs(said.value * f - diameter_mm) <= slack_mm for f in in_mm)
