"""What a program is seen to be before it is translated: control, CAM, unit, tools, offsets, extents.

It is read in the dialect of the control whose marks it has. What the reader refuses is told beside what the
text shows; nothing of it needs a cell.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import Issue, NotUnderstoodError
from gcode2krl.gcode.dialect_marks import PROGRAMS_FANUC
from gcode2krl.gcode.dialects import DEFAULT, DIALECTS
from gcode2krl.gcode.origin import cam_of, control_of
from gcode2krl.gcode.read import read_gcode
from gcode2krl.gcode.text import beginning
from gcode2krl.gcode.tool_comments import NamedTool, named_tools
from gcode2krl.tables import Toolpath
from gcode2krl.units import RAD_PER_REV, S_PER_MIN

_MOST_BYTES = 1_000_000
_FLAGS = re.IGNORECASE | re.MULTILINE
_COMMENT = re.compile(rb"\([^()\n]*\)|;[^\n]*")
_UNITS = {b"20": "inches", b"70": "inches", b"700": "inches", b"21": "mm", b"71": "mm", b"710": "mm"}
_UNIT = re.compile(rb"G *0*(20|21|700|710|70|71)(?![\d.])", _FLAGS)
_OFFSET = re.compile(rb"G *(54\.1 *P *\d+|5[4-9](?:\.[123])?|500|154 *P *\d+)(?![\d.])", _FLAGS)
_SHIFT = re.compile(rb"G *(10|52|92)(?![\d.])|\bA?(TRANS|ROT|MIRROR|SCALE)\b", _FLAGS)
_CALL = re.compile(
    rb"M *9[78] *P *(\d+)|G *6[56] *P *(\d+)|\bO *(<[^>\n]+>|\d+) *call\b|\b(?:EXT)?CALL *\"([^\"\n]+)\"",
    _FLAGS,
)
_TOOL = re.compile(rb"(?<![A-Z])T *(\d+)|\bT *= *\"([^\"\n]*)\"", _FLAGS)
_LENGTH = re.compile(rb"(?<![A-Z])H *(\d+)", _FLAGS)
_CUTTER = re.compile(rb"G *4[12](?![\d.])", _FLAGS)


@dataclass(frozen=True)
class Overview:
    """What is seen in a program; lengths in mm."""

    control: str
    """Whose program it is, empty where no mark tells."""
    mark: str
    """The mark and its line."""
    dialect: str
    """In which it was read."""
    cam: str
    unit: str
    tools: tuple[str, ...]
    comments: tuple[str, ...]
    """What comments say of tools."""
    offsets: tuple[str, ...]
    subprograms: tuple[str, ...]
    moves: int | None
    """None where the reader refuses the program, as in what follows."""
    extent_mm: tuple[tuple[float, float], ...] | None
    """Least and largest X, Y, Z of all positions that the program states."""
    feeds_mm_min: tuple[float, float] | None
    speeds_rpm: tuple[float, float] | None
    asked_of_cell: tuple[str, ...]
    """Keys of the cell file that a translation will ask for."""
    issues: tuple[Issue, ...] = field(default=())


def overview_of(path: str | Path, dialect: str | None = None, search: tuple[str, ...] = ()) -> Overview:
    """Look at a program; raises `NotUnderstoodError` where it is no program for a milling machine.

    ``dialect`` is that of its own marks where none is given.
    """
    name = str(path)
    text = beginning(path, name, _MOST_BYTES)
    mark = control_of(text)
    spoken = dialect or (mark.control.dialects[0] if mark is not None else DEFAULT)
    toolpath, issues = _read(path, spoken, search)
    if toolpath is None and dialect is None and any(issue.code == "decimal-point" for issue in issues):
        spoken = "fanuc-calculator"
        toolpath, doubts = _read(path, spoken, search)
        issues = (*doubts, *(issue for issue in issues if issue.code == "decimal-point"))
    code = _COMMENT.sub(b" ", text) if spoken != "sinumerik" else re.sub(rb";[^\n]*", b" ", text)
    named = list(named_tools(text, 1))
    return Overview(
        control=mark.control.title if mark is not None else "",
        mark=f"{mark.text} (line {mark.line})" if mark is not None else "",
        dialect=spoken,
        cam=cam_of(text),
        unit=", ".join(dict.fromkeys(_UNITS[found] for found in _UNIT.findall(code))),
        tools=_tools(code),
        comments=tuple(_comment(said) for said in named),
        offsets=_offsets(code),
        subprograms=_distinct(next(filter(None, groups)).decode() for groups in _CALL.findall(code)),
        asked_of_cell=_asked(code, named, toolpath, spoken),
        issues=issues,
        **_figures(toolpath),
    )


def _read(
    path: str | Path, dialect: str, search: tuple[str, ...]
) -> tuple[Toolpath | None, tuple[Issue, ...]]:
    """Return the table of moves, None where it is refused, and the findings; what is foreign raises."""
    try:
        toolpath = read_gcode(path, dialect=dialect, search=search)
    except NotUnderstoodError as error:
        if error.issues[0].code in (
            "not-a-part",
            "dialect-unknown",
            "file-unreadable",
            "empty",
            "binary-file",
        ):
            raise
        return None, tuple(error.issues)
    return toolpath, tuple(
        i for i in toolpath.issues if i.code not in ("tool-undeclared", "work-offset-unknown")
    )


def _figures(toolpath: Toolpath | None) -> dict[str, Any]:
    names = ("moves", "extent_mm", "feeds_mm_min", "speeds_rpm")
    if toolpath is None:
        return dict.fromkeys(names)
    sure = toolpath.known.all(axis=1) & ~toolpath.machine
    places = toolpath.position_mm[sure]
    extent = (
        tuple(zip(places.min(axis=0).tolist(), places.max(axis=0).tolist(), strict=True))
        if len(places)
        else None
    )
    feeds = toolpath.feed_mm_s[~toolpath.rapid & (toolpath.feed_mm_s > 0.0)] * S_PER_MIN
    speeds = np.abs(toolpath.spindle_rad_s[toolpath.spindle_rad_s != 0.0]) / RAD_PER_REV * S_PER_MIN
    return dict(zip(names, (len(toolpath) - 1, extent, _range(feeds), _range(speeds)), strict=True))


def _range(values: Floats) -> tuple[float, float] | None:
    return (float(values.min()), float(values.max())) if len(values) else None


def _distinct(words: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(words))


def _tools(code: bytes) -> tuple[str, ...]:
    return _distinct(
        f"T{int(number)}" if number else f'T="{name.decode("latin-1")}"'
        for number, name in _TOOL.findall(code)
    )


def _comment(said: NamedTool) -> str:
    tool = f"T{said.tool}" if said.tool is not None else "a tool"
    if said.is_change:
        return f"changes to {tool} (line {said.line}), in a comment alone"
    return f"{tool} has a diameter of {said.value:g}{' ' + said.unit if said.unit else ''} (line {said.line})"


def _offsets(code: bytes) -> tuple[str, ...]:
    zeros = [f"G{found.decode().replace(' ', '')}" for found in _OFFSET.findall(code)]
    shifts = [
        f"G{number.decode()}" if number else word.decode().upper() for number, word in _SHIFT.findall(code)
    ]
    return _distinct([*zeros, *shifts])


def _asked(code: bytes, named: list[NamedTool], toolpath: Toolpath | None, dialect: str) -> tuple[str, ...]:
    """Return the keys of the cell that a translation will ask for, with what they are for."""
    in_code = {int(number) for number, _ in _TOOL.findall(code) if number}
    numbers = sorted((in_code or {said.tool for said in named if said.tool is not None}) - {0})
    changes = re.search(rb"M *0*6(?!\d)", code, _FLAGS) is not None
    said = {s.tool: s for s in named if s.value > 0.0}
    asked = [f"[tool.{n}] diameter_mm, teeth, length_mm" + _as_said(said.get(n)) for n in numbers]
    if changes:
        asked.append("tool_change: what the robot does at M6")
    else:
        asked.append("mounted_tool: no M6 says which is in the spindle")
    if not re.search(rb"M *0*[34](?!\d)", code, _FLAGS):
        asked.append("[program.start] spindle_rpm: no M3 switches the spindle on")
    if not _LENGTH.search(code) and not re.search(rb"G *43|\bD *1\b", code, _FLAGS):
        asked.append('[program] tool_length = "from_table": nothing in the program selects a length')
    asked += [f"[work_offsets] {zero}" for zero in _offsets(code) if zero.startswith("G5") and zero != "G52"]
    if toolpath is not None:
        codes = sorted({int(e.values["m"]) for e in toolpath.events if e.values.get("m", -1) >= 0})
        asked += [f"[m_code] M{m}" for m in codes if m not in (2, 6, 30)]
    if _CUTTER.search(code):
        asked.append("the diameter of the tool that D names: the program offsets the path itself (G41, G42)")
        if DIALECTS[dialect].programs == PROGRAMS_FANUC:
            asked.append("[program.cutter] lead_in, d: how this control leads in and out, and what D holds")
    if re.search(rb"(?<![A-Z])[ABC] *=? *-?\d*\.?\d", code, _FLAGS):
        asked.append("[machine]: the machine with rotary axes that the program is for")
    return tuple(asked)


def _as_said(said: NamedTool | None) -> str:
    return (
        f" (a comment says {said.value:g}{' ' + said.unit if said.unit else ''})" if said is not None else ""
    )
