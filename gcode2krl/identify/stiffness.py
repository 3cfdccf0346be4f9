"""Stiffness of the virtual joints from pairs of measuring cubes (Hähn & Weigold 2020, section 2.5).

Six distances to each cube give its motion from unloaded to loaded; the motion of the upper cube relative
to the lower one, in the frame of the virtual joint between them, is the joint's deformation. Its angles (eq.
4) over the moments of the known load (eq. 5-6) are the compliances, 1/k (eq. 7): linear, so weighted least
squares over all loads and poses. The joint turns about the origin of its frame, so the translation there is 0
except for noise, which is correlated with that of the angles. Used in the fit (``use = "motion"``) it makes
them more accurate: a cube 300 mm from the joint shows the angle with a lever of 300 mm, while the lasers on
it are 80 mm apart.

Assumptions: the noise of all distances is independent and equal; force, pose and places are without error
(an error of 1 % in the force is one of 1 % in k); the controller holds the joint angles; the load acts on the
undeformed arm, as in the model. Valid while the angles are small enough for eq. 7, some milliradians.
"""

import math
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.identify.estimate import LEVEL, Estimate, chance_above, inverse, student
from gcode2krl.identify.joint_deformation import JointReadings, Known, joint_readings
from gcode2krl.identify.measurements import Measurements

KEYS = ("k_c", "k_b", "k_a")
AXES = "xyz"

_WIDEST = 0.5
"""A compliance whose half interval is a larger fraction of it is not determined."""
_IDLE = 0.01
"""A joint is not turned about an axis where the moment stays below this fraction of its largest one."""
_IMPROBABLE = 1e-3
_STRAY = 1e-6
_MEDIAN_OF_SIX = 5.348
_MOST_STRAY = 5
_FEW = 0.25
_FLOOR_MM = 1e-6
"""Smaller residuals are rounding, not readings."""


@dataclass(frozen=True)
class JointFit:
    """One virtual joint: its three stiffnesses and what they were fitted to."""

    joint: str
    k_Nmm_rad: tuple[Estimate | None, Estimate | None, Estimate | None]
    """k_C, k_B, k_A; None where the readings do not determine it."""
    known: tuple[str, ...]
    """Joints between the same cubes whose stiffness was taken as known."""
    row: Ints
    """(m,) lines in the file."""
    moment_Nmm: Floats
    """(m, 3) on the joint, along its x, y and z."""
    angle_rad: Floats
    """(m, 3) measured."""
    model_rad: Floats
    """(m, 3) of the fit."""
    angle_sigma_rad: Floats
    """(m, 3) 1-sigma of a measured angle, for the noise of the intervals."""
    residual: Floats
    """(m, 6 or 3) in 1-sigma of the noise of the intervals, uncorrelated."""
    noise_mm: float
    """1-sigma of one distance as the residuals show it."""
    noise_used_mm: float
    """The larger of that and the stated one, used for the intervals."""

    def complete(self) -> bool:
        """Tell whether all three stiffnesses are determined."""
        return all(estimate is not None for estimate in self.k_Nmm_rad)


@dataclass(frozen=True)
class StiffnessIdentification:
    """What the readings say."""

    joints: tuple[JointFit, ...]
    level: float
    """Probability of the intervals."""
    stated_noise_mm: float
    known: Known
    """Stiffness taken as known, and its source."""
    issues: tuple[Issue, ...]
    source: str

    def joint(self, name: str) -> JointFit:
        """Return the fit of one virtual joint; `KeyError` where it was not measured."""
        return {fit.joint: fit for fit in self.joints}[name]

    def errors(self) -> list[Issue]:
        """Return one finding for each stiffness that is not determined."""
        return [issue for issue in self.issues if issue.severity == "error"]

    def require_all(self) -> None:
        """Raise `RefusedError` where a stiffness is not determined."""
        if self.errors():
            raise RefusedError(self.errors(), self.source)


def identify_stiffness(
    measurements: Measurements, cell: Cell, level: float = LEVEL
) -> StiffnessIdentification:
    """Fit k_C, k_B and k_A in N·mm/rad of every virtual joint that lies between two measured cubes.

    A stiffness that the readings do not determine is None, and an issue of severity error names it.

    Parameters
    ----------
    measurements : readings, see `read_measurements`.
    cell : its robot's geometry; the TCP where the head states no point; the sensor's stiffness where it has
        to be split from axis 6 and the head states none.
    level : probability of the intervals (Student's t; noise from the residuals or as stated, the larger).

    Raises
    ------
    NotUnderstoodError
        More than one unknown joint between two cubes; no point of the load in head and cell; distances that
        are no motion.
    """
    gathered: dict[str, list[JointReadings]] = {}
    known: dict[str, Known] = {}
    for pair in measurements.setup.pair:
        joint, others = _unknown_joint(pair, measurements, cell)
        gathered.setdefault(joint, []).append(joint_readings(pair, joint, others, measurements, cell))
        known[joint] = {**known.get(joint, {}), **others}
    fits, issues = [], []
    for joint in sorted(gathered, key=VIRTUAL_JOINTS.index):
        fit, findings = _fit(joint, tuple(known[joint]), gathered[joint], measurements, level)
        fits.append(fit)
        issues.extend(findings)
    return StiffnessIdentification(
        tuple(fits),
        level,
        measurements.setup.lasers.noise_mm,
        {name: value for others in known.values() for name, value in others.items()},
        tuple(issues),
        measurements.source,
    )


def in_cell(cell: Cell, joint: str, key: str) -> float | None:
    """Return a stiffness of the cell in N·mm/rad; None where it has none."""
    values = {str(name): value for name, value in cell.compliance.virtual_joints.items()}
    return float(getattr(values[joint], key)) if joint in values else None


# --- which joint a pair of cubes measures ----------------------------------------------------------------


def _unknown_joint(pair: str, measurements: Measurements, cell: Cell) -> tuple[str, Known]:
    """Return the joint that a pair is to determine, and those between the same cubes that are known.

    The sensor's stiffness is taken from the cell where the head leaves it and one more joint unknown.
    """
    between = measurements.setup.joints_between(pair)
    if len(between) == 1:
        return between[0], {}
    stated = {str(name): value for name, value in measurements.setup.known.items()}
    known: Known = {name: (stated[name], "stated") for name in between if name in stated}
    sensor = cell.compliance.virtual_joints.get("sensor")
    if (
        len(between) - len(known) == 2
        and "sensor" in between
        and "sensor" not in known
        and sensor is not None
    ):
        known["sensor"] = (sensor, "from the cell")
    unknown = [name for name in between if name not in known]
    if len(unknown) != 1:
        names = ", ".join(unknown) if unknown else "none"
        raise input_error(
            "pair-joints",
            f"pair.{pair}: between its cubes lie {', '.join(between)}, unknown of them {names}, allowed: one",
            "a cube in between, or [known.NAME] with k_c, k_b, k_a for all but one",
            source=measurements.source,
        )
    return unknown[0], known


# --- the fit --------------------------------------------------------------------------------------------


def _fit(
    joint: str, others: tuple[str, ...], parts: list[JointReadings], measurements: Measurements, level: float
) -> tuple[JointFit, list[Issue]]:
    """Fit the three compliances of a joint by weighted least squares."""
    size = 6 if measurements.setup.use == "motion" else 3
    stated_mm = measurements.setup.lasers.noise_mm
    row = np.concatenate([part.row for part in parts])
    angle = np.concatenate([part.angle_rad for part in parts])
    moment = np.concatenate([part.moment_Nmm for part in parts])
    measured = np.hstack([angle, np.concatenate([part.offset_mm for part in parts])])[:, :size]
    covariance = np.concatenate([part.covariance for part in parts])[:, :size, :size]
    slope = np.zeros((len(row), size, 3))
    slope[:, range(3), range(3)] = moment
    factor = np.linalg.cholesky(covariance)
    whitened = np.linalg.solve(factor, measured[:, :, None])[:, :, 0]
    slopes = np.linalg.solve(factor, slope)
    compliance, variance = _least_squares(np.asarray(slopes.reshape(-1, 3)), whitened.ravel())
    residual = whitened - slopes @ compliance
    freedom = residual.size - 3
    noise_mm = math.sqrt(float(np.sum(residual**2)) / freedom) if freedom > 0 else 0.0
    used_mm = max(noise_mm, stated_mm)
    with np.errstate(invalid="ignore"):
        half = student(level, freedom) * used_mm * np.sqrt(variance)
    stiffness = [_estimate(float(c), float(h)) for c, h in zip(compliance, half, strict=True)]
    sigma = used_mm * np.sqrt(np.einsum("nii->ni", covariance))[:, :3]
    fit = JointFit(
        joint,
        (stiffness[0], stiffness[1], stiffness[2]),
        others,
        row,
        moment,
        angle,
        moment * compliance,
        sigma,
        residual / max(used_mm, 1e-300),
        noise_mm,
        used_mm,
    )
    missing = [
        _not_determined(fit, axis, float(compliance[axis]), float(half[axis]), level, freedom)
        for axis in range(3)
        if fit.k_Nmm_rad[axis] is None
    ]
    return fit, missing + _doubts(fit, residual, stated_mm, freedom)


def _least_squares(slopes: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return the solution (3,) and its variances (3,) for noise 1; infinite for a column of zeros."""
    scale = np.linalg.norm(slopes, axis=0)
    used = scale > 1e-9 * max(float(scale.max(initial=0.0)), 1e-300)
    solution, variance = np.zeros(3), np.full(3, math.inf)
    scaled = slopes[:, used] / scale[used]
    inverse_normal = np.linalg.pinv(scaled.T @ scaled)
    solution[used] = inverse_normal @ scaled.T @ values / scale[used]
    variance[used] = np.diag(inverse_normal) / scale[used] ** 2
    return solution, variance


def _estimate(compliance: float, half: float) -> Estimate | None:
    """Return the stiffness of a compliance with its interval; None where that is too wide."""
    determined = math.isfinite(half) and half <= _WIDEST * compliance
    return inverse(compliance, half) if determined and compliance > 0 else None


def _not_determined(
    fit: JointFit, axis: int, compliance: float, half: float, level: float, freedom: int
) -> Issue:
    """Say which stiffness the readings do not determine, and why."""
    head = f"{KEYS[axis]} of {fit.joint}: not determined: "
    largest = np.abs(fit.moment_Nmm).max(axis=0, initial=0.0)
    about = f"about its {AXES[axis]}"
    remedy = f"load it {about}: a force with a lever to that axis, or a moment by a bar"
    if len(fit.row) == 0:
        text, remedy = (
            "the file has no row of its pair of cubes",
            "measure it, or take the pair out of the head",
        )
    elif largest[axis] <= _IDLE * largest.max():
        text = f"no load case turns this joint {about} (largest moment {largest[axis]:.3g} N·mm)"
    elif freedom < 1:
        text, remedy = "too few readings to see their noise", "at least two rows a pair"
    elif compliance <= -half:
        text = f"it turns {about} against the load"
        remedy = "check the signs of force and moment, the angles, and loaded against unloaded"
    else:
        text = (
            f"the largest moment {about}, {largest[axis]:.3g} N·mm, turns it by "
            f"{compliance * largest[axis] * 1e6:.1f} ± {half * largest[axis] * 1e6:.1f} µrad ({level:.0%})"
        )
        remedy += "; more readings"
    return Issue("error", "not-determined", 0, head + text, remedy)


def _doubts(fit: JointFit, residual: Floats, stated_mm: float, freedom: int) -> list[Issue]:
    """Return warnings where the readings do not fit the model and the stated noise."""
    squares = np.sum(residual**2, axis=1)
    issues = []
    if stated_mm > 0 and chance_above(float(squares.sum()) / stated_mm**2, freedom) < _IMPROBABLE:
        issues.append(
            Issue(
                "warning",
                "model-misfit",
                0,
                f"{fit.joint}: residuals are those of {fit.noise_mm * 1e3:.1f} µm a distance, "
                f"{stated_mm * 1e3:.1f} µm are stated; the intervals are widened",
                'look at the rows named; a joint that turns about another point: use = "rotation"',
            )
        )
    return issues + (_stray(fit, squares, stated_mm, residual.shape[1]) if len(squares) > 2 else [])


def _stray(fit: JointFit, squares: Floats, stated_mm: float, freedom: int) -> list[Issue]:
    """Name the readings (m,) whose residuals stand out from the noise, the worst ones first."""
    noise_mm = stated_mm or math.sqrt(float(np.median(squares)) / _MEDIAN_OF_SIX)
    off = squares / max(noise_mm, _FLOOR_MM) ** 2
    stray = [i for i in np.argsort(-off) if chance_above(float(off[i]), freedom) < _STRAY]
    if len(stray) > _FEW * len(off):
        return []  # single readings are not the cause
    return [
        Issue(
            "warning",
            "stray-reading",
            int(fit.row[i]),
            f"{fit.joint}: this reading is off by {math.sqrt(off[i]):.0f} sigma",
            "a cube that was touched, a load noted wrongly, lasers mixed up?",
        )
        for i in stray[:_MOST_STRAY]
    ]
