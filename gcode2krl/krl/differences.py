"""How far each motion read back is from the intended one, in one pass over chunks of motions."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl import krl_words as w
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell, controller_axes
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.core import (
    FLOATS,
    INT,
    INTS,
    OUT_INTS,
    StructOf,
    core_function,
)
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import MOST_PLACES, Issue
from gcode2krl.krl.composition import turn_bits
from gcode2krl.krl.read import KrlProgram
from gcode2krl.krl.rules import in_file
from gcode2krl.tables import Joints, Targets
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG, S_PER_MIN

POSITION_LIMIT_MM = 0.002
ROTATION_LIMIT_DEG = 0.001
SPEED_LIMIT_MM_S = 0.1 / S_PER_MIN
JOINT_LIMIT_DEG = 0.001
CDIS_LIMIT_MM = 0.0006
WAIT_LIMIT_S = 0.0006
EXTERNAL_LIMIT = 0.0006
"""In mm or degrees."""
REMEDY = "translate again"
_MOST_WORST = 10
OTHER_KIND, POSITION, NO_POSITION, ROTATION, NO_ROTATION = range(5)
SPEED, NO_SPEED, CDIS, WAIT, OTHER_BRANCH, EXTERNAL = range(5, 11)
"""What is checked of a motion; a row of `_CHECKS` each."""
_CHECKS = (
    ("verify-motion", "PTP and LIN exchanged"),
    ("verify-position", "{:.4f} mm off"),
    ("verify-position", "X, Y or Z is missing"),
    ("verify-rotation", "{:.4f} deg off"),
    ("verify-rotation", "A, B or C is missing"),
    ("verify-speed", "speed {:.3f} mm/s off"),
    ("verify-speed", "no $VEL.CP is set before it"),
    ("verify-cdis", "approximation {:.3f} mm off"),
    ("verify-wait", "dwell {:.3f} s off"),
    ("verify-status", "S or T differs from the predicted branch"),
    ("verify-external", "an external axis is {:.4f} off, or is missing"),
)
"""Code and sentence of each check."""


@dataclass(frozen=True)
class Differences:
    """Differences of all motions; a HOME is judged by its joints elsewhere."""

    largest: tuple[float, float, float]
    """Position in mm, rotation in deg, speed in mm/s; NaN where a motion lacks it."""
    worst: tuple[tuple[int, float], ...]
    """Row and deviation in mm of the motions that are furthest off, NaN first."""
    issues: tuple[Issue, ...]


class _MotionValues(NamedTuple):
    """Rows of motions, and a number of each."""

    row: Ints
    value: Floats


class _Read(NamedTuple):
    """The columns of the motions that were read."""

    pose: Floats
    ptp: Bools
    speed_mm_s: Floats
    cdis_mm: Floats
    wait_s: Floats


class _Wanted(NamedTuple):
    """The columns of their targets."""

    position_mm: Floats
    rotation: Floats
    home: Bools
    tool: Ints32
    ptp: Bools
    speed_mm_s: Floats
    cdis_mm: Floats
    wait_s: Floats


class _Noted(NamedTuple):
    """What is kept of a chunk: the largest differences, motions that are furthest off, and wrong ones."""

    largest: Floats
    """(3,)"""
    taken: Ints
    """(checks,) places that are taken in `row` and `size`."""
    row: Ints
    """(checks, places)"""
    size: Floats
    worst_count: Ints
    worst: Ints
    worst_size: Floats
    worst_key: Floats

    @classmethod
    def nothing(cls) -> "_Noted":
        places, checks = (len(_CHECKS), MOST_PLACES), len(_CHECKS)
        counts = np.zeros(checks, dtype=np.int64), np.zeros(1, dtype=np.int64)
        rows = np.empty(places, dtype=np.int64), np.empty(_MOST_WORST, dtype=np.int64)
        sizes = np.empty(_MOST_WORST), np.empty(_MOST_WORST)
        return cls(np.zeros(3), counts[0], rows[0], np.empty(places), counts[1], rows[1], *sizes)

    def wrong(self, check: int) -> _MotionValues:
        taken = slice(0, int(self.taken[check]))
        return _MotionValues(self.row[check, taken], self.size[check, taken])

    def furthest(self) -> _MotionValues:
        taken = slice(0, int(self.worst_count[0]))
        return _MotionValues(self.worst[taken], self.worst_size[taken])


READ, WANTED = StructOf.record(_Read), StructOf.record(_Wanted)
NOTED = StructOf.record(_Noted, written=_Noted._fields)
_rotation_runs = core_function("krl_rotation_runs", READ, WANTED, INT, INT, OUT_INTS, returns=INT)
_compare = core_function("krl_compare", READ, WANTED, INT, INT, INTS, FLOATS, NOTED)


def differences_of(
    program: KrlProgram, targets: Targets, joints: Joints, cell: Cell, count: int
) -> Differences:
    """Compare the first ``count`` motions of a program as read with their targets."""
    read = _Read(*(np.ascontiguousarray(getattr(program, name)) for name in _Read._fields))
    wanted = _Wanted(*(np.ascontiguousarray(getattr(targets, name)) for name in _Wanted._fields))
    of_read, of_wanted = READ(**read._asdict()), WANTED(**wanted._asdict())

    def compared(start: int, end: int) -> _Noted:
        noted = _Noted.nothing()
        begins = np.empty(end - start, dtype=np.int64)
        begins = begins[: _rotation_runs(of_read, of_wanted, start, end, begins)]
        angle_deg = _angles_deg(read, wanted, begins, cell)
        _compare(of_read, of_wanted, start, end, begins, angle_deg, noted)
        return noted

    parts = in_chunks(compared, chunk_borders(count)) if count else []
    position, rotation, speed = np.array([part.largest for part in parts]).reshape(-1, 3).max(0, initial=0.0)
    wrong = [_joined([part.wrong(check) for part in parts]) for check in range(len(_CHECKS))]
    wrong[OTHER_BRANCH] = _other_branches(program, targets, joints, count)
    wrong[EXTERNAL] = _external_off(program, targets, cell, count)
    worst = _furthest(_joined([part.furthest() for part in parts]))
    return Differences(
        largest=(float(position), float(rotation), float(speed)),
        worst=tuple(zip(worst.row.tolist(), worst.value.tolist(), strict=True)),
        issues=tuple(_issues(program, targets, wrong)),
    )


def _angles_deg(read: _Read, wanted: _Wanted, rows: Ints, cell: Cell) -> Floats:
    """Return the angles (r,) in deg between read and intended rotations; NaN where A, B or C is missing."""
    abc_deg, angle_deg = read.pose[rows, 3:6], np.empty(len(rows))
    for number in distinct(wanted.tool[rows]):
        of_tool = np.flatnonzero(wanted.tool[rows] == number)
        turn = controller_axes(cell.tool[int(number)].axis or "+z")[:3, :3]
        rotation = fr.rotation_from_abc(np.nan_to_num(abc_deg[of_tool]) * RAD_PER_DEG) @ turn
        angle = fr.angle_between(fr.quaternion_from_rotation(rotation), wanted.rotation[rows[of_tool]])
        angle_deg[of_tool] = angle * DEG_PER_RAD
    angle_deg[np.isnan(abc_deg).any(axis=1)] = np.nan
    return angle_deg


def _other_branches(program: KrlProgram, targets: Targets, joints: Joints, count: int) -> _MotionValues:
    """Return the first PTP motions whose S or T is another one than that of the joints."""
    rows = np.flatnonzero(targets.ptp[:count] & ~targets.home[:count])
    other = [
        row
        for row in rows.tolist()
        if (program.status_turn[row] != (joints.status[row], turn_bits(joints.q_rad[row]))).any()
    ]
    return _MotionValues(np.array(other[:MOST_PLACES], dtype=np.int64), np.zeros(len(other[:MOST_PLACES])))


def _external_off(program: KrlProgram, targets: Targets, cell: Cell, count: int) -> _MotionValues:
    """Return the first motions whose external axes stand elsewhere, NaN where one of the cell is missing."""
    if not cell.external:
        return _MotionValues(np.zeros(0, dtype=np.int64), np.zeros(0))
    axes = [w.EXTERNAL_KEYS.index(name) for name in sorted(cell.external)]
    off = np.abs(program.external[:count, axes] - targets.external[:count, axes]).max(axis=1)
    rows = np.flatnonzero(~(off <= EXTERNAL_LIMIT))[:MOST_PLACES]
    return _MotionValues(rows, off[rows])


def _furthest(wrong: _MotionValues) -> _MotionValues:
    order = np.argsort(-np.nan_to_num(wrong.value, nan=np.inf), kind="stable")[:_MOST_WORST]
    return _MotionValues(wrong.row[order], wrong.value[order])


def _joined(parts: list[_MotionValues]) -> _MotionValues:
    if not parts:
        return _MotionValues(np.zeros(0, dtype=np.int64), np.zeros(0))
    return _MotionValues(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _issues(program: KrlProgram, targets: Targets, wrong: list[_MotionValues]) -> Iterator[Issue]:
    for (code, sentence), values in zip(_CHECKS, wrong, strict=True):
        for row, amount in list(zip(*values, strict=True))[:MOST_PLACES]:
            gcode = f" (G-code line {targets.source_line[row]})" if targets.source_line[row] else ""
            file = in_file(program, program.file[program.file_of[row]])
            yield Issue("error", code, int(program.line[row]), file + sentence.format(amount) + gcode, REMEDY)
