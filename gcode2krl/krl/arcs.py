"""Runs of targets on an arc: written as CIRC, and unrolled again when they are read.

A G-code arc reaches the targets as chords whose ends lie on it. Where the cell says ``[controller] circ``, a
run of them becomes ``CIRC {via},{end}``: the same place, speed and approximation at its end, one motion
instead of many. KUKA's CIRC goes through the point passed to the end on the circle of three points (KSS 8,
Operating and Programming Instructions for System Integrators); the orientation stays, as it is one along a
run. What time the controller takes along it has not been measured: the prediction is that of the chords
(assumption), and the blending at its end that of two LIN.
"""

from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.krl.read import KrlProgram
from gcode2krl.program.arcs import circle_through, is_along
from gcode2krl.tables import Targets

CHORD_OFF_MM = 0.005
"""How far chords may be beside an arc that is made of them again."""
_AT_END_MM = 0.002


def unrolled(program: KrlProgram, targets: Targets) -> KrlProgram:
    """Return a program whose arcs are rows again, one for each target that lies on them.

    The place of such a row is the point of the arc that is nearest to the target; speed and approximation
    are those of the arc, and of the target. An arc that does not end at a target, or leaves its targets,
    stays a CIRC of one row, which `verify` refuses.
    """
    if not len(program.circ_rows):
        return program
    rows, poses, targets_of = _rows_of_arcs(program, targets)
    return _with_rows(program, rows, poses, [targets.cdis_mm[each] for each in targets_of])


def in_chords(program: KrlProgram) -> KrlProgram:
    """Return a program whose arcs are chords, up to `CHORD_OFF_MM` beside them and blended as it blends."""
    blended = np.where(program.cdis_mm > 0.0, np.arange(len(program.cdis_mm)), 0)
    last_blended = np.maximum.accumulate(blended)
    rows, poses, cdis = [], [], []
    for row, via in zip(program.circ_rows.tolist(), program.circ_via_mm, strict=True):
        circle = circle_through(program.position_mm[row - 1], via, program.position_mm[row]) if row else None
        if circle is None:
            continue
        whole = float(circle.seen(program.position_mm[row][None])[0][0])
        step = 2.0 * np.arccos(max(1.0 - CHORD_OFF_MM / circle.radius, 0.0))
        angle = np.linspace(0.0, whole, int(np.ceil(whole / step)) + 1)[1:-1, None]
        rows.append(row)
        poses.append(circle.at(angle))
        cdis.append(np.full(len(angle), program.cdis_mm[last_blended[row]]))
    return _with_rows(program, rows, poses, cdis)


def _with_rows(
    program: KrlProgram, rows: list[int], poses: list[Floats], cdis_mm: list[Floats]
) -> KrlProgram:
    """Return a program with places (k, 3) before the ends of some of its arcs, which are then LIN."""
    at = np.array(rows, dtype=np.int64)
    done = np.isin(program.circ_rows, at)
    count = np.ones(len(program.ptp), dtype=np.int64)
    count[at] += np.array([len(pose) for pose in poses], dtype=np.int64)
    order = np.repeat(np.arange(len(count)), count)
    added = np.ones(len(order), dtype=np.bool_)
    added[np.cumsum(count) - 1] = False
    pose, cdis, wait_s = program.pose[order], program.cdis_mm[order], program.wait_s[order]
    if len(at):
        pose[added, :3], cdis[added] = np.concatenate(poses), np.concatenate(cdis_mm)
        wait_s[added] = 0.0
    before = np.concatenate([[0], np.cumsum(count - 1)])

    def moved(motions: Ints) -> Ints:
        shifted: Ints = motions + before[motions]
        return shifted

    statements = tuple(
        statement._replace(motion=int(statement.motion + before[statement.motion]))
        for statement in program.statements
    )
    return replace(
        program,
        pose=pose,
        joint_rows=moved(program.joint_rows),
        circ_rows=moved(program.circ_rows[~done]),
        circ_via_mm=program.circ_via_mm[~done],
        external=program.external[order],
        spl_rows=moved(program.spl_rows),
        ptp=program.ptp[order],
        speed_mm_s=program.speed_mm_s[order],
        cdis_mm=cdis,
        wait_s=wait_s,
        line=program.line[order],
        file_of=program.file_of[order],
        statements=statements,
        triggers=program.triggers._replace(motion=moved(program.triggers.motion)),
    )


def _rows_of_arcs(program: KrlProgram, targets: Targets) -> tuple[list[int], list[Floats], list[Ints]]:
    """Return the arcs that are unrolled, the places (k, 3) before their ends, and the targets they are of."""
    rows: list[int] = []
    poses: list[Floats] = []
    targets_of: list[Ints] = []
    extra = 0
    for row, via in zip(program.circ_rows.tolist(), program.circ_via_mm, strict=True):
        first = row + extra
        places = _along(program, targets, row, first, via) if 0 < first < len(targets) else None
        if places is None:
            continue
        rows.append(row)
        poses.append(places)
        targets_of.append(np.arange(first, first + len(places)))
        extra += len(places)
    return rows, poses, targets_of


def _along(program: KrlProgram, targets: Targets, row: int, first: int, via: Floats) -> Floats | None:
    """Return the places (k, 3) on an arc that are nearest to the targets before its end."""
    start, end = program.position_mm[row - 1], program.position_mm[row]
    line = targets.source_line[first]
    last = first
    while last < len(targets) and np.abs(targets.position_mm[last] - end).max() > _AT_END_MM:
        last += 1
        if last == len(targets) or targets.source_line[last] != line:
            return None
    circle = circle_through(start, via, end)
    points = targets.position_mm[first - 1 : last + 1]
    if circle is None or not is_along(circle, points, end):
        return None
    return circle.at(circle.seen(points[1:-1])[0][:, None])
