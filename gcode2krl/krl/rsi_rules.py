"""Rules of a program that is corrected online, as it was read: what switches RSI, once, and where."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue
from gcode2krl.krl.read import KrlProgram, Statement
from gcode2krl.krl.rsi_files import created_name, is_file_name

_CALL = re.compile(r"\bRSI_(\w+)\(")
_NAME = re.compile(r'RSI_CREATE\(\s*"(\w+)(\.rsi)?"', re.IGNORECASE)
_ORDER = list(w.RSI_CALLS)
_SAME_HEIGHT_MM = 0.002
_REMEDY = "translate again"


def rsi_name(program: KrlProgram, folder: Path) -> str:
    """Return the name of the RSI files that a program uses, empty where it uses none of ours.

    Spelled as beside the program, as a controller does not tell letters by their case.
    """
    matches = (_NAME.search(statement.text) for statement in program.statements if _is_ours(statement.text))
    name = next((match[1] for match in matches if match and is_file_name(match[1])), "")
    files = _beside(folder)
    flows = (files.get(f"{name}{suffix}".casefold()) for suffix in w.SIGNAL_FLOW_SUFFIXES.values())
    spelled = next((flow for flow in flows if flow is not None), None)
    return spelled.name[: len(name)] if spelled is not None else name


def rsi_issues(program: KrlProgram, cell: Cell) -> Iterator[Issue]:
    """Yield what is wrong with RSI in a program that uses it as ours do; others are the integrator's."""
    if not any(_is_ours(statement.text) for statement in (*program.statements, *program.declarations)):
        return
    calls = [
        (name, statement, _normal(statement.text))
        for statement in program.statements
        for name in _CALL.findall(_normal(statement.text))
    ]
    if [name for name, _, _ in calls] != _ORDER:
        line = calls[0][1].line if calls else program.def_line
        names = ", ".join(name for name, _, _ in calls) or "none"
        yield _issue("rsi-order", line, f"RSI calls are {names}; allowed: {', '.join(_ORDER)}, once each")
        return
    create, on, off = (statement for _, statement, _ in calls[:3])
    cycle = w.RSI_FAST if cell.online.cycle_s < w.RSI_SLOW_CYCLE_S else w.RSI_SLOW
    if calls[1][2] != f"{w.RSI_RESULT}=RSI_ON(#ABSOLUTE,{cycle})":
        yield _issue("rsi-mode", on.line, f"{on.text!r}; allowed: RSI_ON(#ABSOLUTE,{cycle}) only")
    named = _NAME.search(create.text)
    wanted = created_name("NAME", cell.controller.rsi_version)
    if named is None or (named[2] is not None) != wanted.endswith(".rsi"):
        text = f"{create.text!r}; RSI {cell.controller.rsi_version} takes RSI_CREATE({wanted!r}, …)"
        yield _issue("rsi-version", create.line, text.replace("…", "..."))
    yield from _place_issues(program, cell, create, on, off)
    yield from _ready_issues(program, cell, create, on, off)


def rsi_file_issues(path: Path, expected: Mapping[str, bytes]) -> Iterator[Issue]:
    """Yield where the RSI files beside a program are not those that program and cell ask for."""
    files = _beside(path.parent)
    flows = tuple(w.SIGNAL_FLOW_SUFFIXES.values())
    for file_name in (each for each in expected if each.endswith((w.ETHERNET_SUFFIX, *flows))):
        file = files.get(file_name.casefold())
        if file is None:
            yield _issue("rsi-file", 0, f"{file_name} is missing beside the program")
        elif file.read_bytes().split() != expected[file_name].split():
            yield _issue("rsi-file", 0, f"{file.name} is not as the cell asks for")


def _place_issues(
    program: KrlProgram, cell: Cell, create: Statement, on: Statement, off: Statement
) -> Iterator[Issue]:
    """On and off, the robot stands on the clearance plane; every LIN lies between, and no PTP."""
    ptp = program.ptp
    joints = np.zeros(len(ptp), dtype=np.bool_)
    joints[program.joint_rows[np.isfinite(program.joint_deg[:, 0])]] = True
    for statement in (create, on, off):
        row = statement.motion - 1
        stands = row >= 0 and not joints[row] and program.cdis_mm[row] == 0.0
        if not (stands and _is_clear(float(program.position_mm[row, 2]), cell)):
            text = f"{statement.text!r} where the robot does not stand on the clearance plane"
            yield _issue("rsi-place", statement.line, text)
    outside = np.concatenate([ptp[: create.motion], ptp[off.motion :]])
    if create.motion != on.motion or not outside.all() or ptp[on.motion : off.motion].any():
        text = "RSI must be on for every LIN, from the first to the last, and for no PTP"
        yield _issue("rsi-place", on.line, text)
    if off.motion >= len(ptp) or not joints[off.motion]:
        yield _issue("rsi-place", off.line, "RSI must be off before HOME")


def _ready_issues(
    program: KrlProgram, cell: Cell, create: Statement, on: Statement, off: Statement
) -> Iterator[Issue]:
    """The program waits, standing, for readiness, is stopped without it, and nothing else sets it."""
    ready = f"{w.OUT}[{cell.online.link.ready_output}]"
    switched = (f"{w.INTERRUPT}ON{w.RSI_INTERRUPT}", f"{w.INTERRUPT}OFF{w.RSI_INTERRUPT}")
    normal = ((_normal(s.text), s) for s in program.statements)
    touching = [(text, s) for text, s in normal if ready in text or text.startswith(switched)]
    wanted = [
        f"{ready}=FALSE",
        f"{w.WAIT}{w.FOR}{ready}",
        f"{w.INTERRUPT}{w.DECL}{w.RSI_INTERRUPT}{w.WHEN}{ready}==FALSE{w.DO}{w.LOST_SUBPROGRAM}()",
        switched[0],
        f"{w.WAIT}{w.FOR}{ready}",
        switched[1],
        f"{ready}=FALSE",
    ]
    motions = [on.motion] * 5 + [off.motion] * 2
    line = [s.line for _, s in touching]
    if [text for text, _ in touching] != wanted or [s.motion for _, s in touching] != motions:
        text = (
            f"{ready} must be put out, waited for, watched by interrupt {w.RSI_INTERRUPT}, and nothing else"
        )
        yield _issue("rsi-ready", on.line, text)
    elif not (line[0] < create.line < on.line < line[1] and line[5] < off.line < line[6]):
        text = f"{ready} must be out before RSI_CREATE and after RSI_OFF, and waited for after RSI_ON"
        yield _issue("rsi-ready", on.line, text)
    yield from _lost_issues(program, on)


def _lost_issues(program: KrlProgram, on: Statement) -> Iterator[Issue]:
    """The subprogram of the interrupt stops the robot, and no subprogram outside the program touches RSI."""
    lost = program.uncalled.get(f"{program.file[0]}/{w.LOST_SUBPROGRAM}", ())
    elsewhere = (text for texts in program.uncalled.values() for text in texts)
    if w.BRAKE not in lost or any(_CALL.search(text) for text in elsewhere):
        yield _issue("rsi-ready", on.line, f"{w.LOST_SUBPROGRAM} must stop the robot and leave RSI alone")


def _beside(folder: Path) -> dict[str, Path]:
    return {file.name.casefold(): file for file in folder.iterdir() if file.is_file()}


def _is_clear(z_mm: float, cell: Cell) -> bool:
    return cell.clearance_z_mm is not None and z_mm >= cell.clearance_z_mm - _SAME_HEIGHT_MM


def _is_ours(text: str) -> bool:
    return w.RSI_PREFIX in text.upper()


def _normal(text: str) -> str:
    return re.sub(r"\s+", "", text).upper()


def _issue(code: str, line: int, text: str) -> Issue:
    return Issue("error", code, line, text, _REMEDY)
