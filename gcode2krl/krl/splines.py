"""SPLINE blocks: read back as the points that they pass."""

from dataclasses import replace

import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.arrays import Ints
from gcode2krl.errors import MOST_PLACES, Issue
from gcode2krl.krl.read import KrlProgram
from gcode2krl.tables import Targets


def blocks_of(program: KrlProgram) -> tuple[list[tuple[int, int]], list[Issue]]:
    """Return the rows first..behind of the blocks of a program, and what is wrong with their order."""
    blocks: list[tuple[int, int]] = []
    issues: list[Issue] = []
    first: int | None = None
    for statement in program.statements:
        word = statement.text.strip().upper()
        if first is not None and word != w.ENDSPLINE:
            issues.append(_wrong(statement.line, f"{statement.text[:40]!r} stands within a SPLINE block"))
        elif word == w.SPLINE:
            first = statement.motion
        elif word == w.ENDSPLINE and first is None:
            issues.append(_wrong(statement.line, "ENDSPLINE without SPLINE"))
        elif word == w.ENDSPLINE and first is not None:
            blocks.append((first, statement.motion))
            first = None
    if first is not None:
        issues.append(_wrong(0, "SPLINE without ENDSPLINE"))
    return blocks, [*issues, *_misplaced(program, blocks)]


def _misplaced(program: KrlProgram, blocks: list[tuple[int, int]]) -> list[Issue]:
    inside = np.zeros(len(program.ptp), dtype=np.bool_)
    for first, behind in blocks:
        inside[first:behind] = True
    is_point = np.zeros(len(program.ptp), dtype=np.bool_)
    is_point[program.spl_rows] = True
    rows: Ints = np.flatnonzero(inside != is_point)[:MOST_PLACES]
    words = "SPL outside a SPLINE block", "a motion that is no SPL within a SPLINE block"
    issues = [_wrong(int(program.line[row]), words[int(inside[row])]) for row in rows.tolist()]
    return [*issues, *(_wrong(0, "a SPLINE block without a point") for a, b in blocks if a == b)]


def _wrong(line: int, sentence: str) -> Issue:
    return Issue("error", "krl-structure", line, sentence)


def at_rest_behind(program: KrlProgram) -> KrlProgram:
    """Return a program whose blocks end at rest: ENDSPLINE has no approximation here."""
    if not len(program.spl_rows):
        return program
    cdis = np.array(program.cdis_mm)
    for _, behind in blocks_of(program)[0]:
        cdis[behind - 1] = 0.0
    return replace(program, cdis_mm=cdis)


def in_points(program: KrlProgram, cdis_mm: float) -> KrlProgram:
    """Return a program whose blocks are LIN to their points, blended within ``cdis_mm``."""
    rested = at_rest_behind(program)
    cdis = np.array(rested.cdis_mm)
    cdis[program.spl_rows] = np.where(cdis[program.spl_rows] == 0.0, 0.0, cdis_mm)
    return replace(rested, cdis_mm=cdis, spl_rows=np.zeros(0, dtype=np.int64))


def passing(program: KrlProgram, targets: Targets) -> KrlProgram:
    """Return a program whose points within blocks blend as their targets do, which they pass exactly."""
    rows = program.spl_rows[program.spl_rows < len(targets)]
    if not len(rows):
        return program
    cdis = np.array(program.cdis_mm)
    within = rows[cdis[rows] != 0.0]
    cdis[within] = targets.cdis_mm[within]
    return replace(program, cdis_mm=cdis)
