"""The geometry of an arm from its poses: one fit of all small errors, judged on places left out of it."""

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.cluster.vq import kmeans2

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.identify.estimate import LEVEL, Estimate, around, student
from gcode2krl.identify.kinematics.alignment import Alignment, aligned
from gcode2krl.identify.kinematics.arms import Arm, all_arms
from gcode2krl.identify.kinematics.curves import Curves, curves_of
from gcode2krl.identify.kinematics.fit import Fit, fitted, steps_of
from gcode2krl.identify.kinematics.parameters import GEOMETRY, GROUPS, ArmPoses, Model, flange_of, model_of
from gcode2krl.identify.kinematics.readings import Readings, approach_by_order
from gcode2krl.units import MM_PER_M, RAD_PER_DEG

_FOLDS = 5
_SAME_RAD = 1e-4
"""Joints of one pose when the robot comes back to it (as in `gap.fit.pose_noise`)."""
_LEAST_AGAIN = 8
"""Readings of poses visited again from which they tell the noise (as in `gap.fit.pose_noise`)."""
_STRANGE = 0.03
"""Off by more of its reach, an arm is not the one that was measured, or its joints are not what they seem."""
_TOLD = 0.5
"""A number is told by the poses where they alone know it to this part of its width, or of 1 mm or 1 mrad."""
_ALIKE = 0.98
"""Canonical correlation from which two groups are hardly told apart."""
_OF_CONDITION = ("base", "tool", "zeros", "lengths", "axes", "wrist", "play")
"""Groups without twins of one another by their form."""
_LIKE_THE_CONTROLLER_MM = 2e-3


@dataclass(frozen=True)
class Options:
    """What a person states of the measurement."""

    groups: Sequence[str] = tuple(GROUPS)
    """Keys of `GROUPS` that are fitted; base and tool always are."""
    noise_mm: float = 0.0
    """1-sigma of a coordinate; 0: learnt from poses visited again, else from what is left."""
    by_order: bool = True
    """Without columns of approach, joints came from the row before."""
    gravity_root: tuple[float, float, float] = (0.0, 0.0, -1.0)
    masses_kg: Sequence[float] | None = None
    """Of the upper arm, the forearm, and of hand and tool; None: each link's weight is fitted."""
    curves: bool = True
    """Look for an error curve of each joint over its angle."""
    only: Container[str] | None = None
    """Names of the arm's numbers that are fitted; None: all of the groups."""
    folds: int = _FOLDS
    level: float = LEVEL


@dataclass(frozen=True)
class ArmNumber:
    """One small number: its estimate in its unit, and whether the poses tell it."""

    name: str
    group: str
    unit: str
    estimate: Estimate
    width: float
    """1-sigma before any pose was seen, in the unit; inf where nothing was known."""
    is_told: bool
    like: tuple[str, ...] = ()
    """Groups without which it would be told: their numbers do the same."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """What the poses say of the arm."""

    source: str
    robot: str
    parts: tuple[ArmNumber, ...]
    before_mm: Floats
    """(n,) distance of each point from the arm without errors, with base and tool fitted."""
    after_mm: Floats
    """(n,) the same with all errors, of points that were left out of the fit."""
    within_mm: Floats
    """(n,) the same of the fit to all points."""
    is_outlier: Bools
    """(n,)"""
    row: Ints
    """(n,) line in the table."""
    place: Ints
    """(n,) the place that each belongs to, one of `Options.folds`."""
    position_mm: Floats
    """(n, 3) measured."""
    sigma_mm: float
    """1-sigma of a coordinate as the fit leaves it."""
    noise_mm: float | None
    """1-sigma of a coordinate, stated or learnt; None: unknown."""
    noise_from: str
    condition: float
    """Of the slopes of the told numbers of frames and axes, each in units of its own length."""
    alike: tuple[tuple[str, str, float], ...]
    """Groups whose effects are hardly told apart, with their canonical correlation."""
    level: float
    issues: tuple[Issue, ...]
    alignment: Alignment
    theta: Floats
    repeatability_mm: float | None = None
    """ISO 9283's RP, mean + 3 sigma, over poses visited three times or more; None where there are none."""
    curves: Curves | None = None
    """What each joint errs by over its angle beside the numbers, where that is a fifth and more."""

    @property
    def rms_before_mm(self) -> float:
        """Root mean square over the points that are no outliers."""
        return _rms(self.before_mm[~self.is_outlier])

    @property
    def rms_after_mm(self) -> float:
        """The same, of points that were left out."""
        return _rms(self.after_mm[~self.is_outlier])

    @property
    def rms_with_curves_mm(self) -> float | None:
        """The same with the curves of the joints; None where there are none."""
        return None if self.curves is None else _rms(self.curves.after_mm[~self.is_outlier])

    @property
    def told_numbers(self) -> tuple[ArmNumber, ...]:
        """The arm's own numbers that the poses tell and whose interval leaves out 0."""
        return tuple(
            part
            for part in self.parts
            if part.group in GEOMETRY and part.is_told and not part.estimate.contains(0.0)
        )


def identify_kinematics(readings: Readings, arm: Arm, options: Options = Options()) -> Geometry:
    """Fit frames, zeros, lengths, axes, bending, play, drift and air of an arm to its poses, all at once.

    Parameters
    ----------
    readings : poses in the joints of the arm's own controller.
    arm : lengths, signs and zeros that the controller goes by.
    options : groups that are fitted, stated noise, order of the poses.

    Raises
    ------
    RefusedError
        The poses are not those of this arm (``kinematics-strange``): a wrong robot, sign, unit or order.
    """
    readings, alignment = settled(readings, arm)
    q_rad = arm.kuka_rad(readings.q_rad)
    poses, index = _poses(readings, q_rad, arm, options)
    places = _places(poses.measured_mm, index, q_rad, options.folds)
    model = _model(poses, arm, alignment, options, tuple(options.groups))
    bare = _model(poses, arm, alignment, options, ())
    everything = np.ones(len(index), dtype=bool)
    whole = fitted(model, poses.measured_mm, everything)
    good = ~whole.is_outlier
    plain = fitted(bare, poses.measured_mm, everything, good=good)
    after = np.empty(len(index))
    for place in range(options.folds):
        out = places == place
        if out.any() and (good & ~out).any():
            part = fitted(model, poses.measured_mm, ~out, start=whole.theta, good=good)
            after[out] = _distance(model, part.theta, poses.measured_mm)[out]
    noise_mm, noise_from = _noise(options, poses, index, q_rad, good)
    parts = tuple(_parts(model, whole, options, readings.oriented))
    return Geometry(
        source=readings.source,
        robot=arm.model,
        parts=parts,
        before_mm=_distance(bare, plain.theta, poses.measured_mm),
        after_mm=after,
        within_mm=_distance(model, whole.theta, poses.measured_mm),
        is_outlier=whole.is_outlier,
        row=readings.row[index],
        place=places,
        position_mm=poses.measured_mm,
        sigma_mm=whole.sigma_mm,
        noise_mm=noise_mm,
        noise_from=noise_from,
        condition=_condition(whole, parts),
        alike=tuple(_alike(model, whole)),
        level=options.level,
        issues=tuple(_issues(readings, whole, readings.row[index], options)),
        alignment=alignment,
        theta=whole.theta,
        repeatability_mm=_repeatability(poses, index, q_rad),
        curves=curves_of(model, whole, poses, places, after, arm.signs.tolist()) if options.curves else None,
    )


def tips_of(geometry: Geometry, readings: Readings, arm: Arm, options: Options) -> Floats:
    """Return where the instrument should see the tips (n, 3) of other poses of an arm, in rad and mm."""
    poses, _ = _poses(readings, arm.kuka_rad(readings.q_rad), arm, options)
    model = _model(poses, arm, geometry.alignment, options, tuple(options.groups))
    values = {part.name: part.estimate.value for part in geometry.parts}
    return model.tips(np.array([values.get(number.name, 0.0) / number.size for number in model.numbers]))


# --- units, frames, rows --------------------------------------------------------------------------------


def settled(readings: Readings, arm: Arm) -> tuple[Readings, Alignment]:
    """Return the readings in rad and mm with the frames that fit them; raise where the arm is another one."""
    target = np.tile(np.arange(readings.measured.shape[1]), len(readings))
    points = readings.measured.reshape(-1, 3)
    is_seen = np.isfinite(points).all(axis=1)
    tries = []
    for unit in (readings.angle_unit,) if readings.angle_unit else ("deg", "rad"):
        q = readings.q_rad * (RAD_PER_DEG if unit == "deg" and not readings.angle_unit else 1.0)
        flange, rotation = flange_of(arm.kuka_rad(q), arm.mm)
        of_pose = np.repeat(np.arange(len(q)), readings.measured.shape[1])[is_seen]
        alignment = aligned(points[is_seen], target[is_seen], flange[of_pose], rotation[of_pose])
        size = 1.0
        if not readings.length_unit and alignment.scale > np.sqrt(MM_PER_M):
            size = MM_PER_M
            alignment = aligned(points[is_seen] * size, target[is_seen], flange[of_pose], rotation[of_pose])
        tries.append((alignment.off_mm, unit, q, size, alignment))
    tries.sort(key=lambda one: one[0])
    off_mm, unit, q, size, alignment = tries[0]
    reach_mm = float(arm.mm[[0, 4, 5, 6]].sum())
    if not (0.97 < alignment.scale < 1.03) or alignment.is_mirrored or off_mm > _STRANGE * reach_mm:
        raise RefusedError(_strange(readings, arm, alignment), readings.source)
    if len(tries) > 1 and tries[1][0] < 3.0 * off_mm:
        words = "the joints are in deg or in rad: both fit"
        raise input_error("run-layout", words, "--unit angle=deg|rad", source=readings.source)
    return replace(
        readings, q_rad=q, measured=readings.measured * size, angle_unit=unit, length_unit="mm"
    ), alignment


def _strange(readings: Readings, arm: Arm, alignment: Alignment) -> Issue:
    """Say what does not fit, and which arm would."""
    off_mm = f"{alignment.off_mm:.0f} mm"
    words = f"not the poses of {arm.model}: points are {off_mm} off (median) with any base and tool"
    if alignment.is_mirrored:
        words = f"not the poses of {arm.model}: the points are mirrored, as by a joint's wrong sign"
    elif not 0.97 < alignment.scale < 1.03:
        times = 1.0 / max(alignment.scale, 1e-9)
        words = f"not the poses of {arm.model}: the points are {times:.3g} times as far apart"
    return Issue(
        "error", "kinematics-strange", 0, words, f"{_which_fits(readings)}; --unit, --columns, --robot"
    )


def _which_fits(readings: Readings) -> str:
    """Return which known arm fits best, in words."""
    target = np.zeros(len(readings), dtype=int)
    points = readings.measured[:, 0]
    is_seen = np.isfinite(points).all(axis=1)
    best = ("", np.inf)
    for name, arm in all_arms().items():
        for size in (1.0, RAD_PER_DEG) if not readings.angle_unit else (1.0,):
            flange, rotation = flange_of(arm.kuka_rad(readings.q_rad * size), arm.mm)
            alignment = aligned(points[is_seen], target[is_seen], flange[is_seen], rotation[is_seen])
            if alignment.off_mm < best[1] and not alignment.is_mirrored and 0.97 < alignment.scale < 1.03:
                best = (name, alignment.off_mm)
    return f"{best[0]} would be {best[1]:.1f} mm off" if best[1] < 20.0 else "no arm that is known fits"


def _poses(readings: Readings, q_rad: Floats, arm: Arm, options: Options) -> tuple[ArmPoses, Ints]:
    """Return the rows, one a target that was seen, and the pose (m,) of each."""
    count = readings.measured.shape[1]
    is_seen = np.isfinite(readings.measured).all(axis=2)
    index, target = np.nonzero(is_seen)
    approach = readings.approach
    if approach is None:
        approach = approach_by_order(readings.q_rad) if options.by_order else np.zeros_like(q_rad)
    time = readings.time_s if readings.time_s is not None else np.arange(len(q_rad), dtype=float)
    span = float(np.ptp(time))
    course = 2.0 * (time - time.min()) / span - 1.0 if span > 0.0 else np.zeros(len(time))
    target = np.asarray(target if count > 1 else np.zeros(len(index), dtype=int))
    poses = ArmPoses(
        q_rad=q_rad[index],
        measured_mm=readings.measured[is_seen],
        target=target,
        approach=approach[index],
        time=course[index],
        own_rad=readings.q_rad[index],
        a3_by_a2=arm.a3_by_a2,
    )
    return poses, np.asarray(index)


def _model(poses: ArmPoses, arm: Arm, alignment: Alignment, options: Options, groups: Sequence[str]) -> Model:
    base = (alignment.place_mm, alignment.rotation)
    gravity = np.array(options.gravity_root) / np.linalg.norm(options.gravity_root)
    return model_of(
        poses,
        arm.mm,
        base,
        alignment.targets_mm,
        groups=groups,
        gravity=gravity,
        masses_kg=options.masses_kg,
        only=options.only,
    )


def _places(position_mm: Floats, index: Ints, q_rad: Floats, folds: int) -> Ints:
    """Return the place (0 to folds - 1) of each row; a pose visited again is one place."""
    same = _same_pose(q_rad)
    middle = np.zeros((len(q_rad), 3))
    first = np.searchsorted(index, np.arange(len(q_rad)))
    middle[:] = position_mm[np.minimum(first, len(index) - 1)]
    _, label = kmeans2(middle, folds, minit="++", rng=np.random.default_rng(1))
    return np.asarray(label[same][index], dtype=np.int64)


def _same_pose(q_rad: Floats) -> Ints:
    """Return for each pose (n,) the first one with the same joints."""
    rounded = np.round(q_rad / _SAME_RAD).astype(np.int64)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return np.asarray(first[inverse.ravel()], dtype=np.int64)


# --- what is told ---------------------------------------------------------------------------------------


def _parts(model: Model, fit: Fit, options: Options, oriented: bool) -> list[ArmNumber]:
    steps = steps_of(model)
    deviation = np.sqrt(np.diag(fit.covariance)) * (np.sqrt(3.0) if oriented else 1.0)
    half = student(options.level, int(fit.freedom)) * deviation
    shares = _shared(fit, steps)
    groups = np.array([number.group for number in model.numbers])
    parts = []
    for at, number in enumerate(model.numbers):
        is_told = bool(fit.by_rows[at] < _TOLD * steps[at])
        like = () if is_told else tuple(GROUPS[g] for g in _partners(at, shares, groups))
        estimate = around(float(fit.theta[at] * number.size), float(half[at] * number.size))
        parts.append(
            ArmNumber(
                number.name, number.group, number.unit, estimate, number.width * number.size, is_told, like
            )
        )
    return parts


def _shared(fit: Fit, steps: Floats) -> Floats:
    """Return the correlations (p, p) of the slopes of all numbers."""
    unit = fit.slopes * steps
    unit = unit / np.maximum(np.linalg.norm(unit, axis=0), 1e-12)
    shared: Floats = unit.T @ unit
    return shared


def _partners(at: int, shares: Floats, groups: np.ndarray) -> list[str]:
    """Return up to two other groups that can do what one number does, the better one first."""
    partners = []
    for group in dict.fromkeys(groups):
        others = np.flatnonzero((groups == group) & (np.arange(len(groups)) != at))
        if len(others):
            inner = shares[np.ix_(others, others)] + 1e-9 * np.eye(len(others))
            r2 = float(shares[at, others] @ np.linalg.solve(inner, shares[others, at]))
            partners.append((r2, group))
    partners.sort(reverse=True)
    return [group for r2, group in partners[:2] if r2 > _ALIKE**2]


def _alike(model: Model, fit: Fit) -> list[tuple[str, str, float]]:
    """Return the pairs of groups whose slopes have a canonical correlation near 1, the most alike first."""
    groups = np.array([number.group for number in model.numbers])
    names = [group for group in dict.fromkeys(groups) if group in GEOMETRY or group in ("base", "tool")]
    bases = {}
    for group in names:
        columns = fit.slopes[:, groups == group]
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
        bases[group] = np.linalg.qr(columns)[0]
    pairs = []
    for number, first in enumerate(names):
        for second in names[number + 1 :]:
            largest = float(np.linalg.svd(bases[first].T @ bases[second], compute_uv=False)[0])
            if largest > _ALIKE:
                pairs.append((GROUPS[first], GROUPS[second], min(largest, 1.0)))
    return sorted(pairs, key=lambda pair: -pair[2])


def _condition(fit: Fit, parts: Sequence[ArmNumber]) -> float:
    counted = np.array([part.is_told for part in parts])
    counted &= np.array([part.group in _OF_CONDITION for part in parts])
    columns = fit.slopes[:, counted]
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    sizes = np.linalg.svd(columns, compute_uv=False)
    return float(sizes[0] / max(float(sizes[-1]), 1e-300)) if len(sizes) else 1.0


# --- noise and doubts -----------------------------------------------------------------------------------


def _noise(
    options: Options, poses: ArmPoses, index: Ints, q_rad: Floats, good: Bools
) -> tuple[float | None, str]:
    """Return the noise of one coordinate and where it is from."""
    if options.noise_mm > 0.0:
        return options.noise_mm, "stated"
    again = _again(poses, index, q_rad, good)
    if len(again) >= _LEAST_AGAIN:
        return float(np.sqrt(np.mean(again**2))), "poses visited again"
    rigid = _rigid(poses, index, good)
    if len(rigid) >= _LEAST_AGAIN:
        return float(np.sqrt(np.mean(rigid**2) / 2.0)), "distances between targets of the tool"
    return None, "unknown"


def _again(poses: ArmPoses, index: Ints, q_rad: Floats, good: Bools) -> Floats:
    """Return deviations (m, 3) from the mean of a pose, each with the variance of one reading."""
    key = _same_pose(q_rad)[index] * (int(poses.target.max(initial=0)) + 1) + poses.target
    deviations = [np.zeros((0, 3))]
    for pose in np.unique(key[good]):
        readings = poses.measured_mm[good & (key == pose)]
        if len(readings) > 1:
            deviations.append(
                (readings - readings.mean(axis=0)) * np.sqrt(len(readings) / (len(readings) - 1.0))
            )
    return np.concatenate(deviations)


def _rigid(poses: ArmPoses, index: Ints, good: Bools) -> Floats:
    """Return by how much distances between two targets of the tool differ from their mean."""
    differences = [np.zeros(0)]
    for other in range(1, int(poses.target.max(initial=0)) + 1):
        first = {int(i): at for at, i in enumerate(index) if poses.target[at] == 0 and good[at]}
        pairs = [
            (first[int(i)], at)
            for at, i in enumerate(index)
            if poses.target[at] == other and good[at] and int(i) in first
        ]
        if len(pairs) > 2:
            a, b = np.array(pairs).T
            distance = np.linalg.norm(poses.measured_mm[a] - poses.measured_mm[b], axis=1)
            differences.append(distance - distance.mean())
    return np.concatenate(differences)


def _repeatability(poses: ArmPoses, index: Ints, q_rad: Floats) -> float | None:
    """Return ISO 9283's RP: mean distance from the barycentre and 3 of its standard deviations."""
    key = _same_pose(q_rad)[index]
    repeatabilities = []
    for pose in np.unique(key):
        readings = poses.measured_mm[(key == pose) & (poses.target == 0)]
        if len(readings) > 2:
            distance = np.linalg.norm(readings - readings.mean(axis=0), axis=1)
            repeatabilities.append(float(distance.mean() + 3.0 * distance.std(ddof=1)))
    return float(np.mean(repeatabilities)) if repeatabilities else None


def _issues(readings: Readings, fit: Fit, rows: Ints, options: Options) -> list[Issue]:
    issues = [Issue("note", "kinematics-rows", 0, note) for note in readings.notes]
    if readings.approach is None and options.by_order and "play" in options.groups:
        words = "play: each joint is taken to have come from the row before"
        remedy = "columns approach_1 to approach_6 of -1, 0, 1, or --no-order"
        issues.append(Issue("note", "kinematics-order", 0, words, remedy))
    if fit.is_outlier.any():
        lines = [int(line) for line in rows[fit.is_outlier]]
        words = f"{len(lines)} of {len(rows)} points are no part of the fit: too far off, rows {_some(lines)}"
        remedy = "look at them: a beam that was lost, a pose noted wrongly, a reflector that was moved"
        issues.append(Issue("warning", "kinematics-outlier", lines[0], words, remedy))
    if fit.sigma_mm < _LIKE_THE_CONTROLLER_MM:
        words = (
            f"the points follow from the joints within {fit.sigma_mm:.1g} mm: the controller's own position?"
        )
        issues.append(
            Issue("warning", "kinematics-exact", 0, words, "--columns with what an instrument measured")
        )
    return issues


def _some(lines: Sequence[int]) -> str:
    """Return the first lines in words."""
    return ", ".join(map(str, lines[:8])) + (" …" if len(lines) > 8 else "")


def _distance(model: Model, theta: Floats, measured_mm: Floats) -> Floats:
    distance: Floats = np.linalg.norm(model.tips(theta) - measured_mm, axis=1)
    return distance


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
