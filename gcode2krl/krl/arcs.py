"""Runs of targets on an arc: found before a program is written as CIRC, and unrolled again when it is read.

A G-code arc reaches the targets as chords whose ends lie on it. Where the cell says ``[controller] circ``, a
run of them becomes ``CIRC {via},{end}``: the same place, speed and approximation at its end, one motion
instead of many. KUKA's CIRC goes through the point passed to the end on the circle of three points (KSS 8,
Operating and Programming Instructions for System Integrators); the orientation stays, as it is one along a
run. What time the controller takes along it has not been measured: the prediction is that of the chords
(assumption), and the blending at its end that of two LIN.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.krl.read import KrlProgram
from gcode2krl.tables import Targets

MOST_TURN_RAD = 0.95 * np.pi
"""Longest arc of one CIRC: where it ends opposite its start, three points would tell its plane badly."""
LEAST_RADIUS_MM, LEAST_CHORDS = 0.1, 3
OFF_MM = 0.0015
"""How far a target may be from the circle of the points as they are written."""
SAGITTA_MM = 0.02
"""How far the circle may go beside the chords of its targets."""
CHORD_OFF_MM = 0.005
"""How far chords may be beside an arc that is made of them again."""
_STEP_MM = 1e-3
"""What positions are written in."""
_AT_END_MM = 0.002


class Arc(NamedTuple):
    """Rows of Targets that become one CIRC."""

    first: int
    """The first chord; the arc begins where the row before ends."""
    via: int
    end: int


class _Circle(NamedTuple):
    centre: Floats
    x: Floats
    """Unit vector to its first point."""
    y: Floats
    radius: float

    def at(self, angle: Floats) -> Floats:
        """Return the points (n, 3) at angles (n, 1) from the first point on."""
        points: Floats = self.centre + self.radius * (np.cos(angle) * self.x + np.sin(angle) * self.y)
        return points

    def seen(self, points: Floats) -> tuple[Floats, Floats]:
        """Return angle (n,) from the first point on, 0 to 2 pi, and distance (n,) from the circle."""
        from_centre = points - self.centre
        u, v = from_centre @ self.x, from_centre @ self.y
        height = from_centre @ np.cross(self.x, self.y)
        angle = np.arctan2(v, u) % (2.0 * np.pi)
        return angle, np.hypot(np.hypot(u, v) - self.radius, height)


def arcs_of(targets: Targets) -> list[Arc]:
    """Return the runs of targets that lie on arcs, in their order."""
    return [arc for first, end in _runs(targets) for arc in _arcs_in(targets, first, end)]


def _runs(targets: Targets) -> Iterator[tuple[int, int]]:
    """Yield rows first..end of LIN from one line, of one speed, tool and orientation, blended but at last."""
    same = (targets.source_line[1:] == targets.source_line[:-1]) & (targets.source_line[1:] > 0)
    same &= ~targets.ptp[1:] & ~targets.ptp[:-1] & (targets.move[1:] >= 0) & (targets.move[:-1] >= 0)
    same &= (targets.speed_mm_s[1:] == targets.speed_mm_s[:-1]) & (targets.tool[1:] == targets.tool[:-1])
    same &= (targets.rotation[1:] == targets.rotation[:-1]).all(axis=1)
    if targets.external.strides[0] != 0:
        same &= (targets.external[1:] == targets.external[:-1]).all(axis=1)
    same &= (targets.cdis_mm[:-1] > 0.0) & (targets.wait_s[:-1] == 0.0)
    standing = [event.row for event in targets.events if event.row < len(same)]
    same[standing] = False
    border = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(np.int8), [0]])))
    for first, end in border.reshape(-1, 2).tolist():
        if end - first + 1 >= LEAST_CHORDS and first > 0:
            yield first, end


def _arcs_in(targets: Targets, first: int, end: int) -> Iterator[Arc]:
    """Yield the arcs of a run, none where its rows and the row before them are not on one circle."""
    turned = (targets.rotation[first - 1] != targets.rotation[first]).any() or targets.home[first - 1]
    points = targets.position_mm[first - 1 : end + 1]
    count = len(points)
    whole = _circle(points[0], points[count // 3], points[2 * count // 3])
    if whole is None or turned:
        return
    angle, off_mm = whole.seen(points)
    angle[0] = 0.0
    turn = np.diff(angle)
    turn[-1] = turn[-1] % (2.0 * np.pi)  # a full circle ends where it began
    if (off_mm > 0.02).any() or (turn <= 0.0).any() or (whole.radius < LEAST_RADIUS_MM):
        return
    pieces = int(np.ceil(turn.sum() / MOST_TURN_RAD))
    borders = np.searchsorted(np.cumsum(turn), turn.sum() * np.arange(1, pieces) / pieces).tolist()
    for start, stop in zip(
        [0, *(b + 1 for b in borders)], [*(b + 1 for b in borders), count - 1], strict=True
    ):
        arc = Arc(first + start, first + (start + stop) // 2 - 1, first + stop - 1)
        if stop - start >= LEAST_CHORDS - 1 and _fits(targets.position_mm, arc):
            yield arc


def _fits(position_mm: Floats, arc: Arc) -> bool:
    """Tell whether the circle of three points as they are written keeps to all targets."""
    start, via, end = (
        np.round(position_mm[row] / _STEP_MM) * _STEP_MM for row in (arc.first - 1, arc.via, arc.end)
    )
    circle = _circle(start, via, end)
    if circle is None:
        return False
    return _is_along(circle, position_mm[arc.first - 1 : arc.end + 1], end)


def _is_along(circle: _Circle, points: Floats, end: Floats) -> bool:
    """Tell whether points (n, 3) follow each other along a circle to its end."""
    angle, off_mm = circle.seen(points)
    to_end = circle.seen(end[None])[0][0]
    angle[0], angle[-1] = 0.0, to_end
    turn = np.diff(angle)
    sagitta_mm = circle.radius * (1.0 - np.cos(turn / 2.0))
    return bool((off_mm <= OFF_MM).all() and (turn > 0.0).all() and (sagitta_mm <= SAGITTA_MM).all())


def _circle(start: Floats, via: Floats, end: Floats) -> _Circle | None:
    """Return the circle through three points, from the first to the second; None where they are in a line."""
    a, b = via - start, end - start
    normal = np.cross(a, b)
    square = float(normal @ normal)
    if not square > 1e-12 * float(a @ a) * float(b @ b) or not square > 0.0:
        return None
    to_centre = (np.cross(normal, a) * (b @ b) + np.cross(b, normal) * (a @ a)) / (2.0 * square)
    radius = float(np.linalg.norm(to_centre))
    x = -to_centre / radius
    y = np.cross(normal / np.sqrt(square), x)
    return _Circle(start + to_centre, x, y, radius)


# what is read -------------------------------------------------------------------------------------------


def unrolled(program: KrlProgram, targets: Targets) -> KrlProgram:
    """Return a program whose arcs are rows again, one for each target that lies on them.

    The place of such a row is the point of the arc that is nearest to the target; speed and approximation
    are those of the arc, and of the target. An arc that does not end at a target, or leaves its targets,
    stays a CIRC of one row, which `verify` refuses.
    """
    if not len(program.circ_rows):
        return program
    rows, poses, own = _rows_of_arcs(program, targets)
    return _with_rows(program, rows, poses, [targets.cdis_mm[each] for each in own])


def in_chords(program: KrlProgram) -> KrlProgram:
    """Return a program whose arcs are chords, up to `CHORD_OFF_MM` beside them and blended as it blends."""
    blended = np.where(program.cdis_mm > 0.0, np.arange(len(program.cdis_mm)), 0)
    last_blended = np.maximum.accumulate(blended)
    rows, poses, cdis = [], [], []
    for row, via in zip(program.circ_rows.tolist(), program.circ_via_mm, strict=True):
        circle = _circle(program.position_mm[row - 1], via, program.position_mm[row]) if row else None
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
        each._replace(motion=int(each.motion + before[each.motion])) for each in program.statements
    )
    return replace(
        program,
        pose=pose,
        joint_rows=moved(program.joint_rows),
        circ_rows=moved(program.circ_rows[~done]),
        circ_via_mm=program.circ_via_mm[~done],
        external=program.external[order],
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
    own: list[Ints] = []
    extra = 0
    for row, via in zip(program.circ_rows.tolist(), program.circ_via_mm, strict=True):
        first = row + extra
        found = _along(program, targets, row, first, via) if 0 < first < len(targets) else None
        if found is None:
            continue
        rows.append(row)
        poses.append(found)
        own.append(np.arange(first, first + len(found)))
        extra += len(found)
    return rows, poses, own


def _along(program: KrlProgram, targets: Targets, row: int, first: int, via: Floats) -> Floats | None:
    """Return the places (k, 3) on an arc that are nearest to the targets before its end."""
    start, end = program.position_mm[row - 1], program.position_mm[row]
    line = targets.source_line[first]
    last = first
    while last < len(targets) and np.abs(targets.position_mm[last] - end).max() > _AT_END_MM:
        last += 1
        if last == len(targets) or targets.source_line[last] != line:
            return None
    circle = _circle(start, via, end)
    points = targets.position_mm[first - 1 : last + 1]
    if circle is None or not _is_along(circle, points, end):
        return None
    return circle.at(circle.seen(points[1:-1])[0][:, None])
