"""The arm's geometry in runs of poses, many small errors at once; the cutter's radius in scans of a part."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects import Applied, Effect, Inputs, commanded
from gcode2krl.effects.mismatch import Mismatch, sigma
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.compare.interpolation import rms
from gcode2krl.gap.compare.links import SurfaceLink, SurfacePoints
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.trace import Context
from gcode2krl.gap.posterior.cause_tests import Interval
from gcode2krl.gap.posterior.examination import Size
from gcode2krl.gap.posterior.gram import cluster_scores, clustered_covariance
from gcode2krl.gap.posterior.judgement import Cause, Judged
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

_LIMITS = THRESHOLDS.posterior


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


def geometry_of_arm(pairs: Sequence[Pair], explaining: int, share_left: float) -> ArmGeometry | None:
    """Return the geometry of the arm that explains runs of poses; None where it brings less than a fifth.

    ``share_left``: share of the gap's rms that causes which were found already leave. None too where a frame
    and a tool alone do as well, where they are most of the gap (effects of their own are for these), or where
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
    before_mm = rms(np.concatenate(raw)[good])
    if share_left * before_mm > _LIMITS.poses_mostly_frames * fit.rms_before_mm:
        return None
    most = _LIMITS.poses_geometry_share * min(share_left * before_mm, fit.rms_before_mm)
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


@dataclass(frozen=True, kw_only=True)
class SurfaceJudgement(Judged):
    """The judgement of the part's surface, whose signal is a place; lengths in mm."""

    points: int
    held_out_shrink: float
    """On points that the cutter's radius was not fitted to."""

    @property
    def shrink(self) -> float:
        """Return the share of the gap that is gone on held-out points."""
        return self.held_out_shrink

    @property
    def reported(self) -> tuple[Cause, ...]:
        """Return the causes that the answer lists: also one that is not sure enough to be named."""
        return self.causes


def judge_surface(link: SurfaceLink, context: Context) -> SurfaceJudgement | None:
    """Return what scans say of the cutter; None without a scan, or where no wall was scanned."""
    base = link.base(context)
    clouds = [cloud for pair in context.pairs if (cloud := link.points(pair, base)) is not None]
    effect = _of_radius(link, context)
    if (
        not clouds
        or effect is None
        or sum(cloud.wall.sum() for cloud in clouds) < THRESHOLDS.compare.scan_least_points
    ):
        return None
    return _judgement(link, _finding(clouds, effect, context), context)


def _of_radius(link: SurfaceLink, context: Context) -> Effect | None:
    """Return the candidate that the part alone can show: a cause with one size, that of the cutter."""
    for effect in context.candidates():
        if effect.kind == "cause" and link.name in effect.links and len(effect.names) == 1:
            return effect
    return None


def _radius_per_size(effect: Effect, inputs: Inputs) -> float:
    """Return by how much the radius that the part shows grows with the effect's parameter."""
    start, nominal = effect.start(inputs), effect.nominal(inputs)
    larger = effect.instruments(commanded(inputs), Applied(effect, None, start)).radius_offset_mm
    (name,) = effect.names
    return larger / (start[name] - nominal[name])


@dataclass(frozen=True)
class _Finding:
    """The size of an effect of the radius, and the gap with and without it: mean squares in mm²."""

    applied: Applied
    interval: Interval
    is_gap: bool
    """The size is more than normal mismatch."""
    points: int
    before: float
    after: float
    shrink: float


def _judgement(link: SurfaceLink, finding: _Finding, context: Context) -> SurfaceJudgement:
    """Return the judgement; a cause that an earlier link has named is not repeated."""
    effect = finding.applied.effect
    sure = finding.is_gap and finding.shrink >= _LIMITS.scan_least_shrink
    named = {applied.effect.name for judged in context.judgements for applied in judged.applied}
    cause = Cause(
        applied=finding.applied,
        link=link.name,
        probability=_LIMITS.scan_probability if sure else _LIMITS.scan_probability_unsure,
        parameters={effect.names[0]: finding.interval},
        shrink=finding.shrink,
        rms_after=finding.after**0.5,
        rivals=None,
    )
    return SurfaceJudgement(
        link=link,
        verdict="explained" if sure else "no_gap",
        causes=(cause,) if finding.is_gap and effect.name not in named else (),
        size=_size(finding),
        size_with_named=None if sure else replace(_size(finding), after=finding.before),
        held_out=True,
        factor=1.0,
        points=finding.points,
        held_out_shrink=finding.shrink,
    )


def _size(finding: _Finding) -> Size:
    """Return the size of the gap; the scatter about the fitted surface counts as noise."""
    return Size(
        rows=finding.points,
        before=finding.before,
        after=finding.after,
        floor=finding.after,
        noise=finding.after,
        excess=0.0,
        excess_before=0.0,
        deviation=0.0,
        largest_before=math.nan,
        largest_after=math.nan,
    )


def _finding(clouds: Sequence[SurfacePoints], effect: Effect, context: Context) -> _Finding:
    """Return what the points say of an effect of the radius."""
    y = np.concatenate([cloud.deviation for cloud in clouds])
    x, prior = _columns(clouds, context.mismatch)
    block = _blocks(clouds)
    good = _inliers(x, y, prior)
    x, y, block = x[good], y[good], block[good]
    b, covariance = _fit(x, y, prior, block)
    residual = y - x @ b
    others = b.copy()
    others[0] = 0.0
    before = y - x @ others
    even = block % 2 == 0
    held = [(even, ~even), (~even, even)]
    power = [_held_out(x, y, prior, chosen, test) for chosen, test in held if chosen.any() and test.any()]
    noise2 = float(np.mean(residual**2))
    gap2 = float(np.mean([p[0] for p in power])) - noise2 if power else 0.0
    left2 = float(np.mean([p[1] for p in power])) - noise2 if power else 0.0
    shrink = float(np.clip(1.0 - left2 / gap2, 0.0, 1.0)) if gap2 > 0.0 else 0.0
    deviation = float(np.hypot(np.sqrt(covariance[0, 0]), _LIMITS.scan_tip_mm))
    inputs = context.pairs[0].inputs
    per_size = _radius_per_size(effect, inputs)
    offset = Interval(*(float((b[0] + k * deviation) / per_size) for k in (0.0, -1.645, 1.645)))
    usual = effect.usual(context.mismatch, 1.0)[effect.names[0]]
    is_gap = abs(b[0] / per_size) > usual + _LIMITS.scan_certain * deviation
    return _Finding(
        applied=Applied(effect, None, {effect.names[0]: offset.value}),
        interval=offset,
        is_gap=is_gap,
        points=len(y),
        before=float(np.mean(before**2)),
        after=noise2,
        shrink=shrink,
    )


def _columns(clouds: Sequence[SurfacePoints], mismatch: Mismatch) -> tuple[Floats, Floats]:
    """Return (n, c) columns and (c,) the weight of each prior: radius; shift, floors and bend of each run."""
    rows = sum(len(cloud.deviation) for cloud in clouds)
    x = np.zeros((rows, 1 + 5 * len(clouds)))
    prior = np.zeros(x.shape[1])
    prior[0] = 1.0 / _LIMITS.scan_rough_mm**2
    at = 0
    for number, cloud in enumerate(clouds):
        rows_here, first = slice(at, at + len(cloud.deviation)), 1 + 5 * number
        x[rows_here, 0] = cloud.wall
        x[rows_here, first : first + 2] = cloud.normal[:, :2]
        x[rows_here, first + 2] = ~cloud.wall
        x[rows_here, first + 3] = cloud.deflection
        x[rows_here, first + 4] = (
            np.where(cloud.wall, 0.0, cloud.place[:, 0] - cloud.place[:, 0].mean()) / _LIMITS.scan_block_mm
        )
        prior[first : first + 2] = 1.0 / sigma(mismatch.frame_mm) ** 2
        prior[first + 2] = 1.0 / _LIMITS.scan_rough_mm**2
        prior[first + 3] = 1.0 / sigma(mismatch.stiffness) ** 2
        prior[first + 4] = 1.0 / sigma(mismatch.frame_mm) ** 2
        at += len(cloud.deviation)
    return x, prior


def _blocks(clouds: Sequence[SurfacePoints]) -> Ints:
    """Return the number (n,) of the block of the part, run by run, that each point lies in."""
    numbers = [
        np.column_stack([np.full(len(cloud.place), number), _in_blocks(cloud)])
        for number, cloud in enumerate(clouds)
    ]
    _, block = np.unique(np.concatenate(numbers), axis=0, return_inverse=True)
    return np.asarray(block, dtype=np.int64).ravel()


def _in_blocks(cloud: SurfacePoints) -> Floats:
    """Return the column and row (n, 2) of the block of each point."""
    return np.floor(cloud.place[:, :2] / _LIMITS.scan_block_mm)


def _solved(x: Floats, y: Floats, prior: Floats) -> Floats:
    """Return the coefficients; priors are worth what the scatter of the points makes them."""
    spread = max(float(np.median(np.abs(y - np.median(y)))) * 1.4826, 1e-3)
    b: Floats = np.zeros(x.shape[1])
    for _ in range(3):
        b[:] = np.linalg.solve(x.T @ x / spread**2 + np.diag(prior), x.T @ y / spread**2)
        spread = max(1.4826 * float(np.median(np.abs(y - x @ b))), 1e-4)
    return b


def _inliers(x: Floats, y: Floats, prior: Floats) -> Bools:
    residual = y - x @ _solved(x, y, prior)
    good: Bools = np.abs(residual) < _LIMITS.scan_outliers * 1.4826 * np.median(np.abs(residual))
    return good


def _fit(x: Floats, y: Floats, prior: Floats, block: Ints) -> tuple[Floats, Floats]:
    """Return coefficients and covariance, widened where blocks scatter more than points (White 1980)."""
    b = _solved(x, y, prior)
    residual = y - x @ b
    spread2 = float(np.mean(residual**2))
    inverse = np.asarray(np.linalg.inv(x.T @ x / spread2 + np.diag(prior)), dtype=np.float64)
    return b, clustered_covariance(inverse, cluster_scores(x, residual / spread2, block))


def _held_out(x: Floats, y: Floats, prior: Floats, chosen: Bools, test: Bools) -> tuple[float, float]:
    """Return the mean squares of held-out points without and with the radius of the others."""
    radius = x[test, 0] * _solved(x[chosen], y[chosen], prior)[0]
    # the other numbers belong to the held-out points themselves
    mismatch, others = _solved(x[test], y[test], prior)[1:], x[test, 1:]
    residual = y[test] - radius
    residual = residual - others @ _solved(others, residual, prior[1:])
    return float(np.mean((y[test] - others @ mismatch) ** 2)), float(np.mean(residual**2))
