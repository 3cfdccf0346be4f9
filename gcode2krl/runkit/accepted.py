"""A written program read back into Targets, and what it switches: all that a run kit is made from.

Only a program that gcode2krl wrote for the given cell is taken: ``$BASE``, ``$TOOL``, ``$LOAD`` and HOME must
be those of the cell, or the variant in air would stand elsewhere than the program.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gcode2krl import frames as fr
from gcode2krl import robot
from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell, controller_axes
from gcode2krl.cell.carried import require_still
from gcode2krl.errors import Issue, RefusedError
from gcode2krl.krl import statements as st
from gcode2krl.krl.arcs import in_chords
from gcode2krl.krl.constructs import assumed_in
from gcode2krl.krl.differences import JOINT_LIMIT_DEG
from gcode2krl.krl.read import KrlProgram, read_krl
from gcode2krl.krl.rsi_files import Form, numbers_to_compare, rsi_texts
from gcode2krl.krl.splines import in_points
from gcode2krl.tables import Event, Targets, Toolpath
from gcode2krl.units import MM_PER_M, RAD_PER_DEG

_MADE_BY = re.compile(r"^; made by gcode2krl \S+ from (.*?)\s*$", re.MULTILINE)
_RESTART = re.compile(r"^; \*\* RESTART AT G-CODE LINE (\d+)", re.MULTILINE)
_LINE = re.compile(r"^; line (\d+)")
_CODE = re.compile(r"^; (?:line (\d+)|end of the program): (M\d+)(?: (S[\d.]+|T\d+))?$")
_NO_SWITCH = re.compile(
    r"(?:PTP|LIN|CIRC|TRIGGER|END|BAS|\$VEL|\$APO|\$TOOL|\$LOAD|GK_)\b|\$(?:VEL|APO|TOOL|LOAD)", re.IGNORECASE
)
_REMEDY = "name the cell that it was made with: --cell cell.toml; or translate again"


@dataclass(frozen=True)
class Switch:
    """What an M-code does in the program."""

    code: str
    """``M3 S12000``"""
    statements: tuple[str, ...]
    """Its KRL."""
    first_line: int
    """G-code line where it stands first, 0 = the end of the program."""
    count: int


@dataclass(frozen=True)
class Accepted:
    """A program as a run kit needs it."""

    name: str
    source: str
    """Name of the G-code."""
    targets: Targets
    switches: tuple[Switch, ...]
    corrected_online: bool
    restart_line: int
    """G-code line at which a restart begins, 0 where the program runs from its start."""
    assumed: tuple[str, ...] = ()
    """What to look at in T1: nothing public confirms what the program relies on."""
    rsi_numbers: tuple[tuple[str, str], ...] = ()
    """Kinds of objects and numbers of parameters in the signal flow of a program that is corrected online."""


def read_program(path: Path, cell: Cell) -> Accepted:
    """Return a program as written for a cell.

    Raises `NotUnderstoodError` where a file cannot be read, `RefusedError` where the program is broken, not
    written by gcode2krl, or made for another cell.
    """
    program = in_chords(in_points(read_krl(path), cell.controller.cdis_mm))
    text = program.texts[program.file[0]].decode("ascii", "replace").replace("\r\n", "\n")
    made = _MADE_BY.search(text)
    if made is None:
        raise _refused(
            path, "not written by gcode2krl: its header does not say so", "name a .src of gcode2krl"
        )
    broken = [issue for issue in program.issues if issue.severity == "error"]
    if broken:
        raise RefusedError(broken, path.name)
    require_still(cell, "a run kit")
    _refuse_other_cell(path, program, cell)
    restart = _RESTART.search(text)
    corrected = any("RSI_ON" in s.text.upper() for s in program.statements)
    assumed, numbers = _assumed(program, cell, corrected)
    return Accepted(
        name=program.name,
        source=made[1],
        targets=_targets(program, path, cell),
        switches=tuple(_switches(program)),
        restart_line=int(restart[1]) if restart is not None else 0,
        corrected_online=corrected,
        assumed=assumed,
        rsi_numbers=numbers,
    )


def toolpath_of(targets: Targets, cell: Cell) -> Toolpath:
    """Return a Toolpath whose rows are the motions of Targets that are not HOME, behind row 0."""
    rows = np.flatnonzero(~targets.home)
    start = np.concatenate([rows[:1], rows])
    speed = targets.speed_mm_s[start]
    rapid = np.isnan(speed) | (speed >= cell.controller.rapid_m_s * MM_PER_M)
    known = np.ones((len(start), 3), dtype=np.bool_)
    known[0] = False
    return Toolpath(
        position_mm=targets.position_mm[start],
        axis=fr.rotation_from_quaternion(targets.rotation[start])[:, :, 2],
        rapid=rapid,
        feed_mm_s=np.where(rapid, np.inf, speed),
        spindle_rad_s=np.zeros(len(start)),
        tool=targets.tool[start],
        exact_stop=targets.cdis_mm[start] == 0.0,
        tolerance_mm=np.full(len(start), np.nan),
        dwell_s=targets.wait_s[start],
        source_line=targets.source_line[start],
        arc=np.full(len(start), -1),
        machine=np.zeros(len(start), dtype=np.bool_),
        known=known,
        length_offset_mm=np.full(len(start), np.nan),
        length_offset_tool=np.full(len(start), -1),
        source=targets.source,
    )


def _assumed(
    program: KrlProgram, cell: Cell, corrected: bool
) -> tuple[tuple[str, ...], tuple[tuple[str, str], ...]]:
    """Return what a program and its RSI files rely on unconfirmed, and the numbers in its signal flow."""
    texts = [text.decode("ascii", "replace") for text in program.texts.values()]
    if not corrected:
        return tuple(assumed_in(texts)), ()
    flow = (cell.online, cell.pilot, _form(texts, cell), cell.controller.rsi_version)
    return tuple(assumed_in([*texts, *rsi_texts("RSI", *flow).values()])), tuple(numbers_to_compare(*flow))


def _form(texts: Sequence[str], cell: Cell) -> Form:
    """Return how a program carries the pilot force."""
    if any(f"{cell.pilot.index_variable}=" in text for text in texts):
        return "index"
    return "values" if any(f"{cell.pilot.value_variable}[1]=" in text for text in texts) else "none"


# --- motions ----------------------------------------------------------------------------------------------


def _targets(program: KrlProgram, path: Path, cell: Cell) -> Targets:
    home = program.ptp & ~np.isnan(program.q_deg).any(axis=1)
    events, tool = _tools(program, path, cell)
    position, rotation = program.position_mm.copy(), np.zeros((len(home), 4))
    for number in np.unique(tool).tolist():
        rows = np.flatnonzero((tool == number) & ~home)
        turn = controller_axes(cell.tool[number].axis or "+z")[:3, :3]
        written = fr.rotation_from_abc(program.abc_deg[rows] * RAD_PER_DEG)
        rotation[rows] = fr.quaternion_from_rotation(written @ turn)
        at_home = np.flatnonzero((tool == number) & home)
        position[at_home], rotation[at_home] = robot.forward(
            program.q_deg[at_home] * RAD_PER_DEG, cell, number
        )
    if np.isnan(position).any() or np.isnan(rotation).any():
        raise _refused(path, "a motion states no whole position", "translate again")
    move = np.cumsum(~home) * ~home
    return Targets(
        position_mm=position,
        rotation=rotation,
        ptp=program.ptp,
        home=home,
        speed_mm_s=program.speed_mm_s,
        cdis_mm=program.cdis_mm,
        wait_s=program.wait_s,
        move=np.where(home, -1, move),
        source_line=_source_lines(program),
        tool=tool,
        external=np.broadcast_to(cell.external_rest(), (len(home), 6)),
        events=events,
        source=path.name,
    )


def _tools(program: KrlProgram, path: Path, cell: Cell) -> tuple[tuple[Event, ...], Ints32]:
    """Return the tool changes and the tool (p,) of each motion."""
    changes: list[Event] = []
    for file, number, text in _comments(program):
        match = _CODE.match(text)
        if match is None or match[2] != "M6" or match[3] is None:
            continue
        later = np.flatnonzero((program.file_of == file) & (program.line > number))
        row = int(later[np.argmin(program.line[later])]) - 1 if len(later) else len(program.ptp) - 1
        values = {"tool": int(match[3][1:]), "line": int(match[1] or 0)}
        changes.append(Event(row, "tool", values))
    changes.sort(key=lambda event: event.row)
    tool = np.full(len(program.ptp), _first_tool(program, changes, path, cell), dtype=np.int32)
    for event in changes:
        if event.values["tool"] not in cell.tool:
            raise _other_cell(path, f"T{event.values['tool']}")
        tool[event.row + 1 :] = event.values["tool"]
    _refuse_other_tools(program, tool, changes, path, cell)
    return tuple(changes), tool


def _first_tool(program: KrlProgram, changes: list[Event], path: Path, cell: Cell) -> int:
    """Return the tool of the settings at the start: of those with its frame the one that is mounted first."""
    stated = {_normal(s.text) for s in program.statements if s.motion == 0}
    alike = [number for number in cell.tool if _tool_texts(cell, number) <= stated]
    wanted = [*(event.values["tool"] for event in changes[:1]), cell.mounted_tool]
    best = next((number for number in wanted if number in alike), alike[0] if alike else None)
    if best is None:
        raise _other_cell(path, "$TOOL or $LOAD")
    return int(best)


def _refuse_other_tools(
    program: KrlProgram, tool: Ints32, changes: list[Event], path: Path, cell: Cell
) -> None:
    """Raise where the program sets a tool frame that is not that of its tool."""
    last = changes[-1].values["tool"] if changes else int(tool[-1])
    for statement in program.statements:
        text = _normal(statement.text)
        if not text.startswith(("$TOOL=", "$LOAD=", "BAS(#TOOL,")):
            continue
        number = int(tool[statement.motion]) if statement.motion < len(tool) else last
        if text not in _tool_texts(cell, number):
            raise _other_cell(path, "$TOOL or $LOAD")


def _tool_texts(cell: Cell, number: int) -> set[str]:
    if cell.missing_of_tool(number):
        return {"?"}
    return {_normal(text) for text in st.tool_statements(cell, number).split("\n")}


def _base_texts(cell: Cell) -> set[str]:
    return {_normal(text) for text in st.base_statement(cell, cell.external_rest()).split("\n")}


def _refuse_other_cell(path: Path, program: KrlProgram, cell: Cell) -> None:
    stated = {_normal(s.text) for s in program.statements if s.motion == 0}
    if cell.frames.base is None or not _base_texts(cell) <= stated:
        raise _other_cell(path, "$BASE")
    home = program.q_deg[~np.isnan(program.q_deg).any(axis=1)]
    if cell.home.q_deg is None or (np.abs(home - np.array(cell.home.q_deg)) > JOINT_LIMIT_DEG).any():
        raise _other_cell(path, "HOME")


# --- text -------------------------------------------------------------------------------------------------


def _comments(program: KrlProgram) -> Iterator[tuple[int, int, str]]:
    """Yield file, line and text of each line that is a comment about the G-code."""
    for file, name in enumerate(program.file):
        for number, line in enumerate(program.texts[name].decode("ascii", "replace").splitlines(), start=1):
            if line.startswith(("; line ", "; end of the program")):
                yield file, number, line.rstrip()


def _source_lines(program: KrlProgram) -> Ints32:
    """Return the G-code line (p,) that the last comment before each motion names, 0 before the first."""
    lines = np.zeros(len(program.ptp), dtype=np.int32)
    marks = [
        (file, number, int(match[1]))
        for file, number, text in _comments(program)
        if (match := _LINE.match(text))
    ]
    for file in range(len(program.file)):
        own_marks = np.array([(number, line) for at, number, line in marks if at == file]).reshape(-1, 2)
        rows = np.flatnonzero(program.file_of == file)
        before = np.searchsorted(own_marks[:, 0], program.line[rows]) - 1
        lines[rows] = np.where(before >= 0, own_marks[np.maximum(before, 0), 1] if len(own_marks) else 0, 0)
    return lines


def _switches(program: KrlProgram) -> Iterator[Switch]:
    """Yield what the M-codes switch, each text once, in the order of the files."""
    switches: dict[tuple[str, tuple[str, ...]], list[int]] = {}
    for name in program.file:
        code, line, texts = "", 0, list[str]()
        for text in [*program.texts[name].decode("ascii", "replace").splitlines(), "END"]:
            mark = _CODE.match(text.rstrip())
            bare = text.split(";")[0].strip()
            if not mark and not (bare and _NO_SWITCH.match(bare)):
                texts += [text.strip()] if bare and code else []
                continue
            if code and texts:
                switches.setdefault((code, tuple(texts)), []).append(line)
            code, texts = "", []
            if mark:
                code, line = f"{mark[2]} {mark[3] or ''}".strip(), int(mark[1] or 0)
    for (code, statements), lines in switches.items():
        yield Switch(code, statements, lines[0], len(lines))


def _normal(text: str) -> str:
    return re.sub(r"\s+", "", text).upper()


def _other_cell(path: Path, what: str) -> RefusedError:
    return _refused(path, f"{what} of the program is not that of the cell", _REMEDY)


def _refused(path: Path, sentence: str, remedy: str) -> RefusedError:
    return RefusedError(Issue("error", "runkit-program", 0, sentence, remedy), path.name)


def position_text(position_mm: Floats) -> str:
    """Return a position as ``X 1.00 Y 2.00 Z 3.00``."""
    return " ".join(f"{axis} {value:.2f}" for axis, value in zip("XYZ", position_mm, strict=True))
