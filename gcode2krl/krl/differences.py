"""How far each motion read back is from the intended one, in one pass over chunks of motions."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell, controller_axes
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
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
REMEDY = "translate again"
_MOST_WORST = 10
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
)
"""Code and sentence of each check of a motion, in the order of `_Compared.wrong`."""


@dataclass(frozen=True)
class Differences:
    """Differences of all motions; a HOME is judged by its joints elsewhere."""

    largest: tuple[float, float, float]
    """Position in mm, rotation in deg, speed in mm/s; NaN where a motion lacks it."""
    worst: tuple[tuple[int, float], ...]
    """Row and deviation in mm of the motions that are furthest off, NaN first."""
    issues: tuple[Issue, ...]


class _Rows(NamedTuple):
    """Rows of motions, and a number of each."""

    row: Ints
    value: Floats


class _Compared(NamedTuple):
    """What is kept of a chunk."""

    largest: tuple[float, float, float]
    worst: _Rows
    wrong: tuple[_Rows, ...]


def differences_of(
    program: KrlProgram, targets: Targets, joints: Joints, cell: Cell, count: int
) -> Differences:
    """Compare the first ``count`` motions of a program as read with their targets."""

    def compared(start: int, end: int) -> _Compared:
        return _compared(program, targets, joints, cell, slice(start, end))

    parts = in_chunks(compared, chunk_borders(count))
    position, rotation, speed = np.array([part.largest for part in parts]).reshape(-1, 3).max(0, initial=0.0)
    wrong = [_joined([part.wrong[check] for part in parts]) for check in range(len(_CHECKS))]
    worst = _furthest(_joined([part.worst for part in parts]))
    return Differences(
        largest=(float(position), float(rotation), float(speed)),
        worst=tuple(zip(worst.row.tolist(), worst.value.tolist(), strict=True)),
        issues=tuple(_issues(program, targets, wrong)),
    )


def _compared(program: KrlProgram, targets: Targets, joints: Joints, cell: Cell, rows: slice) -> _Compared:
    home, ptp = targets.home[rows], targets.ptp[rows]
    deviation = np.linalg.norm(program.position_mm[rows] - targets.position_mm[rows], axis=1)
    rotation = _rotation_deg(program, targets, cell, rows)
    deviation[home], rotation[home] = 0.0, 0.0
    speed = np.where(ptp, 0.0, np.abs(program.speed_mm_s[rows] - targets.speed_mm_s[rows]))
    cdis = np.abs(program.cdis_mm[rows] - targets.cdis_mm[rows])
    wait = np.abs(program.wait_s[rows] - targets.wait_s[rows])
    other_kind = program.ptp[rows] != ptp
    other_branch = np.zeros(len(ptp), dtype=np.bool_)
    for row in np.flatnonzero(ptp & ~home):
        at = rows.start + row
        branch = joints.status[at], turn_bits(joints.q_rad[at])
        other_branch[row] = (program.status_turn[at] != branch).any()
    none = np.zeros(len(ptp))
    wrong = (
        (other_kind, none),
        (deviation > POSITION_LIMIT_MM, deviation),
        (np.isnan(deviation), none),
        (rotation > ROTATION_LIMIT_DEG, rotation),
        (np.isnan(rotation), none),
        (speed > SPEED_LIMIT_MM_S, speed),
        (np.isnan(speed) & ~other_kind, none),
        (~(cdis <= CDIS_LIMIT_MM), cdis),
        (~(wait <= WAIT_LIMIT_S), wait),
        (other_branch, none),
    )
    return _Compared(
        (float(deviation.max()), float(rotation.max()), float(speed.max())),
        _furthest(_Rows(np.arange(rows.start, rows.stop), deviation)),
        tuple(_first(mask, values, rows.start) for mask, values in wrong),
    )


def _rotation_deg(program: KrlProgram, targets: Targets, cell: Cell, rows: slice) -> Floats:
    """Return the angles between read and intended rotations in deg; NaN where A, B or C is missing.

    Equal rotations in a row are compared once.
    """
    tool, abc_deg = targets.tool[rows], program.abc_deg[rows]
    first, run = fr.equal_runs(np.column_stack([abc_deg, targets.rotation[rows], tool]))
    own, angle = rows.start + first, np.zeros(len(first))
    for number in np.unique(targets.tool[own]):
        runs = np.flatnonzero(targets.tool[own] == number)
        turn = controller_axes(cell.tool[int(number)].axis or "+z")[:3, :3]
        read = fr.rotation_from_abc(np.nan_to_num(program.abc_deg[own[runs]]) * RAD_PER_DEG) @ turn
        angle[runs] = fr.angle_between(fr.quaternion_from_rotation(read), targets.rotation[own[runs]])
    angle[np.isnan(program.abc_deg[own]).any(axis=1)] = np.nan
    result: Floats = angle[run] * DEG_PER_RAD
    return result


def _first(mask: Bools, values: Floats, start: int) -> _Rows:
    rows = np.flatnonzero(mask)[:MOST_PLACES]
    return _Rows(start + rows, values[rows])


def _furthest(found: _Rows) -> _Rows:
    order = np.argsort(-np.nan_to_num(found.value, nan=np.inf), kind="stable")[:_MOST_WORST]
    return _Rows(found.row[order], found.value[order])


def _joined(parts: list[_Rows]) -> _Rows:
    if not parts:
        return _Rows(np.zeros(0, dtype=np.int64), np.zeros(0))
    return _Rows(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _issues(program: KrlProgram, targets: Targets, wrong: list[_Rows]) -> Iterator[Issue]:
    for (code, sentence), found in zip(_CHECKS, wrong, strict=True):
        for row, amount in list(zip(*found, strict=True))[:MOST_PLACES]:
            gcode = f" (G-code line {targets.source_line[row]})" if targets.source_line[row] else ""
            file = in_file(program, program.file[program.file_of[row]])
            yield Issue("error", code, int(program.line[row]), file + sentence.format(amount) + gcode, REMEDY)
