"""The arm's own geometry in runs of poses: many small errors at once, which no single effect is."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.identify.kinematics import (
    GEOMETRY,
    Geometry,
    Options,
    Readings,
    arm_of,
    identify_kinematics,
    tips_of,
)
from gcode2krl.runs.measured import Poses

_LIMITS = THRESHOLDS.fit


@dataclass(frozen=True, eq=False)
class ArmGeometry:
    """Small errors of the arm, fitted to the runs that explain and judged on places left out of the fit."""

    fit: Geometry
    before_mm: float
    """Root mean square of the tips beside the cell's robot, outliers left out."""
    after_mm: float
    """The same with the small errors, at places left out of the fit."""
    pairs: tuple[Pair, ...]
    """The runs with the errors taken off their measured tips: what else is at work is left in them."""


def geometry_of_arm(pairs: Sequence[Pair], explaining: int, left: float) -> ArmGeometry | None:
    """Return the geometry of the arm that explains runs of poses; None where it brings less than a fifth.

    ``left``: share of the gap's rms that causes which were found already leave. None too where a frame and a
    tool alone do as well, where they are most of the gap (effects of their own are for these), or where
    the robot is not known. Numbers that few poses do not tell are held by makers' tolerances.
    """
    if not all(_can_be_fitted(pair) for pair in pairs):
        return None
    tables = [_poses(pair) for pair in pairs]
    options = Options(groups=GEOMETRY, curves=False)
    arm = arm_of(pairs[0].inputs.cell)
    read = _readings(tables[:explaining])
    try:
        fit = identify_kinematics(read, arm, options)
    except Gcode2KrlError:  # poses of another arm, which the slips of the set-up are for
        return None
    raw = [
        np.linalg.norm(table.position_mm - pair.inputs.position_mm, axis=1)
        for pair, table in zip(pairs[:explaining], tables, strict=False)
    ]
    good: Bools = ~fit.is_outlier
    before_mm = float(np.sqrt(np.mean(np.concatenate(raw)[good] ** 2)))
    if left * before_mm > _LIMITS.poses_mostly_frames * fit.rms_before_mm:
        return None
    most = _LIMITS.poses_geometry_share * min(left * before_mm, fit.rms_before_mm)
    if fit.rms_after_mm > most:
        return None
    corrected = tuple(
        _corrected(pair, table, tips_of(fit, _readings([table]), arm, options))
        for pair, table in zip(pairs, tables, strict=True)
    )
    return ArmGeometry(fit, before_mm, fit.rms_after_mm, corrected)


def _can_be_fitted(pair: Pair) -> bool:
    head = pair.run.head
    return (
        pair.still
        and pair.known_robot
        and head.angles == "absolute"
        and head.frames.tracker == "base"
        and pair.inputs.cell.robot.geometry.known
    )


def _poses(pair: Pair) -> Poses:
    if pair.run.poses is None:
        raise ValueError("a run of poses has a table of them")
    return pair.run.poses


def _readings(tables: Sequence[Poses]) -> Readings:
    q = np.concatenate([table.q_rad for table in tables])
    row: Ints = np.arange(len(q), dtype=np.int64)
    seen = np.concatenate([table.position_mm for table in tables])
    return Readings("poses", q, seen[:, None, :], row, angle_unit="rad", length_unit="mm")


def _corrected(pair: Pair, table: Poses, tips_mm: Floats) -> Pair:
    position = pair.inputs.position_mm + table.position_mm - tips_mm
    return replace(pair, run=replace(pair.run, poses=replace(table, position_mm=position)))
