"""Rules that a controller would enforce on any program, whatever it was made from."""

import itertools
import re
from collections.abc import Iterator

import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import MOST_PLACES, Issue
from gcode2krl.krl.controller_state import ControllerState
from gcode2krl.krl.names import name_problem
from gcode2krl.krl.read import KrlProgram, Statement
from gcode2krl.krl.rsi_rules import rsi_issues
from gcode2krl.krl.splines import blocks_of
from gcode2krl.krl.statements import frame_text, written_tool
from gcode2krl.units import MM_PER_M

_FIRST_WORD = re.compile(r"\$?[A-Z_][A-Z0-9_]*", re.IGNORECASE)
_KNOWN_WORDS = frozenset(
    [
        *(w.BLOCKS.keys() | w.BLOCKS.values() | set(w.BRANCHES)),
        *(
            "THEN",
            "RETURN",
            w.BAS,
            w.HALT,
            w.WAIT,
            w.EXIT,
            w.PULSE,
            w.INTERRUPT,
            w.GLOBAL,
            w.TRIGGER,
            w.CONTINUE,
            w.SPLINE,
            w.ENDSPLINE,
        ),
    ]
)
_WITHOUT_STOP = re.compile(rf"({w.TRIGGER}\b|{w.CONTINUE}\b|\$(VEL|ACC|APO|ORI_TYPE)\b)", re.IGNORECASE)
"""Statements known to leave the advance run alone."""
_SETTING = re.compile(
    r"(\$(?:BASE|TOOL|LOAD\w*|ADVANCE|IPO_MODE|ACC\w*|ORI_TYPE|OV_\w+|ACT_\w+|VEL_\w+|RED_\w+)|(?:BASE|TOOL|LOAD)_DATA)"
    r"[\[\].A-Z0-9_]*=(?!=)|BAS\(#(?!TOOL)"
)
_SET_WITH_THE_TOOL = frozenset([w.LOAD, w.ACT_TOOL, w.ACT_BASE])
_REMEDY = "take it out of the template in the cell (m_code, tool_change, program.epilogue)"
_REMEDY_OF_TOOL = f"translate again, with the cell it was made with; or {_REMEDY}"
_REMEDY_OF_STATE = "translate again: behind a call or a HALT everything is set again and the arm compared"
_JUMP = re.compile(r"(GOTO|RESUME|ASYPTP)")


def rule_issues(program: KrlProgram, cell: Cell) -> list[Issue]:
    """Return what a controller would refuse, and what would stop the robot in a blended corner."""
    issues = []
    problem = name_problem(program.name)
    if problem:
        issues.append(Issue("error", "krl-name", 0, f"program name {program.name!r}: {problem}"))
    if len(program.ptp) == 0:
        return [*issues, Issue("error", "krl-no-motion", 0, "the program has no motion")]
    if not program.ptp[0]:
        issues.append(Issue("error", "krl-first-motion", int(program.line[0]), "the first motion is not PTP"))
    issues += _motion_issues(program, cell)
    issues += blocks_of(program)[1]
    issues += _statement_rules(program, cell)
    issues += _setting_issues(program, cell)
    issues += rsi_issues(program, cell)
    return [*issues, *_blend_issues(program)]


def _motion_issues(program: KrlProgram, cell: Cell) -> Iterator[Issue]:
    """Yield targets that lack a component, then speeds that are missing or too high."""
    fastest_m_s = cell.controller.vel_cp_m_s
    by_joints = program.joint_rows[~np.isnan(program.joint_deg).any(axis=1)]

    def wrong(start: int, end: int) -> tuple[Ints, Ints]:
        rows = slice(start, end)
        ptp = program.ptp[rows]
        incomplete = _lacks(program.position_mm[rows], program.abc_deg[rows])
        incomplete |= ptp & _lacks(program.status_turn[rows])
        first, behind = np.searchsorted(by_joints, (start, end))
        incomplete[by_joints[first:behind] - start] = False
        speed_m_s = program.speed_mm_s[rows] / MM_PER_M
        allowed = (speed_m_s > 0) & (speed_m_s <= fastest_m_s * (1 + 1e-6))
        return start + np.flatnonzero(incomplete), start + np.flatnonzero(~ptp & ~allowed)

    parts = in_chunks(wrong, chunk_borders(len(program.ptp)))
    incomplete, not_allowed = (np.concatenate(rows)[:MOST_PLACES] for rows in zip(*parts, strict=True))
    for row in incomplete:
        yield Issue("error", "krl-incomplete", int(program.line[row]), "the target lacks a component")
    yield from _external_issues(program, cell)
    for row in not_allowed:
        speed_m_s = program.speed_mm_s[row] / MM_PER_M
        sentence = f"$VEL.CP is {speed_m_s:g} m/s, allowed above 0 to {fastest_m_s:g}"
        yield Issue("error", "krl-velocity", int(program.line[row]), sentence)


def _external_issues(program: KrlProgram, cell: Cell) -> Iterator[Issue]:
    """Yield targets without an external axis of the cell, or with one that it has not."""
    if program.external.strides[0] == 0 and not cell.external:
        return
    for column, key in enumerate(w.EXTERNAL_KEYS):
        stated = ~np.isnan(program.external[:, column])
        known = key in cell.external
        wrong = np.flatnonzero(stated != known)[:MOST_PLACES]
        text = f"the target lacks {key}" if known else f"{key} is no external axis of the cell"
        for row in wrong.tolist():
            yield Issue("error", "krl-external", int(program.line[row]), text)


def _lacks(*columns: Floats) -> Bools:
    """Return (n,) where one of the columns (n, k) has no number."""
    numbers = [column for part in columns for column in part.T]
    result: Bools = np.isnan(numbers[0])
    for column in numbers[1:]:
        result |= np.isnan(column)
    return result


def _setting_issues(program: KrlProgram, cell: Cell) -> list[Issue]:
    """Behind the first motion only speeds, the tool of a tool change, and what was set before are set."""
    tools = {_squeezed(f"{w.TOOL}={frame_text(written_tool(cell, number))}") for number in _tools(cell)}
    tools |= {_squeezed(statement.text) for statement in program.statements if statement.motion == 0}
    issues = []
    for statement in program.statements:
        text = _squeezed(statement.text)
        set_here = _SETTING.match(text)
        with_tool = set_here is not None and (set_here[1] in _SET_WITH_THE_TOOL or text in tools)
        if statement.motion > 0 and (_JUMP.match(text) or (set_here is not None and not with_tool)):
            issues.append(
                Issue(
                    "error",
                    "krl-setting-changed",
                    statement.line,
                    in_file(program, statement.file) + f"{statement.text[:50]!r} behind the first motion",
                    _REMEDY_OF_TOOL if set_here and set_here[1] == w.TOOL else _REMEDY,
                )
            )
    return issues[:MOST_PLACES]


def state_issues(program: KrlProgram, tool: Ints32, cell: Cell) -> list[Issue]:
    """Return the motions at which the controller's state is not known, or another tool is set.

    ``tool`` (p,) are the tools of the motions; fewer than the program has where these cannot be paired.
    """
    state = ControllerState.at_start(has_arcs=len(program.circ_rows) > 0)
    issues: list[Issue] = []
    in_force: frozenset[int] | None = None
    numbers = _numbers_of_tools(cell)
    count = len(program.ptp)
    begin = Statement(0, "", program.file[0], program.def_line)
    statements = [begin, *program.statements, begin._replace(motion=count)]
    for statement, until in itertools.pairwise(statements):
        state.take(statement.text)
        in_force = numbers.get(_squeezed(statement.text), in_force)
        rows = slice(statement.motion, until.motion)
        if rows.start == rows.stop:
            continue
        issues += _unknown_at(program, state, rows.start)
        wrong = [number for number in distinct(tool[rows]).tolist() if in_force and number not in in_force]
        if wrong:
            row = rows.start + int(np.argmax(tool[rows] == wrong[0]))
            text = f"this motion is of T{wrong[0]}, and $TOOL is another one"
            issues.append(_at_motion(program, row, text))
        state.move()
    return issues[:MOST_PLACES]


def _unknown_at(program: KrlProgram, state: ControllerState, row: int) -> Iterator[Issue]:
    """Yield what is not known at a motion, once."""
    if state.unknown:
        name, changed_by = next(iter(state.unknown.items()))
        more = f" and {len(state.unknown) - 1} more settings" if len(state.unknown) > 1 else ""
        why = f"{changed_by[:40]!r} may have changed" if changed_by else "nothing sets"
        yield _at_motion(program, row, f"{why} {name}{more}, on which this motion depends")
        state.unknown = {}
    if state.arm_moved_by and program.guard:
        moved_by = state.arm_moved_by[:40]
        yield _at_motion(program, row, f"{moved_by!r} may have moved the arm, which nothing compares before")
        state.arm_moved_by = ""


def _at_motion(program: KrlProgram, row: int, text: str) -> Issue:
    file = in_file(program, program.file[program.file_of[row]])
    return Issue("error", "krl-state-unknown", int(program.line[row]), file + text, _REMEDY_OF_STATE)


def _numbers_of_tools(cell: Cell) -> dict[str, frozenset[int]]:
    """Return statement without blanks → the tools that it sets."""
    numbers: dict[str, frozenset[int]] = {}
    for number in _tools(cell):
        data = cell.tool[number].tool_data
        frame = f"{w.TOOL}={frame_text(written_tool(cell, number))}"
        text = _squeezed(frame if data is None else f"{w.BAS}(#TOOL,{data})")
        numbers[text] = numbers.get(text, frozenset()) | {number}
    return numbers


def _tools(cell: Cell) -> list[int]:
    return [number for number in cell.tool if not cell.missing_of_tool(number)]


def _squeezed(text: str) -> str:
    return re.sub(r"\s+", "", text).upper()


def _blend_issues(program: KrlProgram) -> list[Issue]:
    """Nothing between a blended motion and the next may stop the advance run, and with it the robot."""
    blended = np.concatenate([[False], program.cdis_mm > 0])
    stopping = [
        statement
        for statement in program.statements
        if blended[statement.motion] and not _WITHOUT_STOP.match(statement.text)
    ]
    return [
        Issue(
            "error",
            "krl-blend-broken",
            statement.line,
            in_file(program, statement.file) + f"{statement.text[:40]!r} breaks a blended corner",
            "use a TRIGGER, or stop there",
        )
        for statement in stopping[:MOST_PLACES]
    ]


def _statement_rules(program: KrlProgram, cell: Cell) -> list[Issue]:
    issues = []
    known = _KNOWN_WORDS | {external.split("(")[0].strip().upper() for external in cell.program.externals}
    starts = 0
    for statement in program.statements:
        word = _FIRST_WORD.match(statement.text)
        first = word.group(0).upper() if word else statement.text[:10]
        behind = statement.text[len(first) :].lstrip()
        if w.INITMOV in statement.text.upper():
            starts += 1
        if first in w.MOTIONS_NOT_WRITTEN:
            issues.append(
                Issue(
                    "error",
                    "krl-motion-unknown",
                    statement.line,
                    f"{first} is a motion this program does not write",
                )
            )
        elif behind.startswith("(") and first not in known:
            issues.append(
                Issue(
                    "error",
                    "krl-call-undeclared",
                    statement.line,
                    f"{first} is called but not declared",
                    "add it to [program] externals of the cell",
                )
            )
        elif not (first.startswith("$") or first in known or behind[:1] in ("=", ".", "[", "(")):
            issues.append(
                Issue("error", "krl-unknown", statement.line, f"not understood: {statement.text[:60]!r}")
            )
    if starts != 1:
        issues.append(
            Issue("error", "krl-initmov", 0, f"BAS(#INITMOV,0) stands {starts} times, must be once")
        )
    return issues[:MOST_PLACES]


def in_file(program: KrlProgram, file: str) -> str:
    """Return the words that name a file other than the main one."""
    return "" if file == program.file[0] else f"{file}: "
