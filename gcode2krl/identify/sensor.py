"""Weight, centre of gravity and offset of a force sensor from unloaded readings in several orientations.

With u = Rᵀ·g, gravity along the sensor's axes, the readings are linear in the unknowns (see `sensor`):

    F = W·u + F_SI,      M = s x u + M_SI,  s = W·r

so there are two least-squares fits, for any orientations with three or more directions u. Then ten quadratic
terms in the quaternion (eq. 17 without its redundant terms) are fitted to the residuals, if there are enough
orientations and if the terms predict readings that were left out of the fit better than zero does.

The paper solves three special orientations in closed form (eq. 12-15): z of the sensor vertical, downwards
(O2), z horizontal with the weight at 45° between x and y (O1), z horizontal with the weight along y (O3).
With F_G,z = F_O1,z - F_O2,z = -W (eq. 12) the balance gives eq. 14 and 15 as printed, but instead of eq. 13

    F_SI,x = F_O1,x + F_G,z/√2,   F_SI,y = F_O1,y + F_G,z/√2,   F_SI,z = F_O1,z

where the print has -√2·F_G,z: another factor, and the opposite sign of eq. 14 and 15 for the same
orientation. In eq. 16 the print has lost the difference between sines and cosines and all signs; orientations
are taken here as KUKA's A, B, C or as quaternions and converted by `frames`.
"""

import math
from dataclasses import dataclass

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.compliance.sensor import Calibration, compensate, quadratic_terms
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.identify.estimate import LEVEL, Estimate, around, student
from gcode2krl.identify.sensor_poses import SensorPoses
from gcode2krl.units import DEG_PER_RAD

Triple = tuple[Estimate, Estimate, Estimate]

LEAST_POSES = 3
LEAST_FOR_TERMS = 20
"""Orientations below which the ten terms are not fitted; the paper takes 27."""
_LEAST_SPREAD = 0.05
"""Least root mean square distance of the gravity directions from a point, and from a line."""
_MORE = "vary A, B and C, each in three steps"
_LEAST_SINGULAR = 0.005
"""Least singular value of the ten terms over the root of the number of orientations; a full turn about every
axis has some 0.2."""
_WIDEST = 0.5
_NEAR_MM = 1.0


@dataclass(frozen=True)
class SensorIdentification:
    """What the readings say."""

    calibration: Calibration
    weight_N: Estimate
    centre_mm: Triple
    force_offset_N: Triple
    moment_offset_Nmm: Triple
    level: float
    poses: int
    force_noise_N: float
    """1-sigma of one component, used for the intervals: the larger of the residuals' and the stated one."""
    moment_noise_Nmm: float
    force_rms_N: tuple[float, float]
    """Residual of one component: after weight and offset, and after the ten terms as well."""
    moment_rms_Nmm: tuple[float, float]
    force_left_out_N: float | None
    """Error of the ten terms at readings left out of their fit; None where they were not fitted."""
    moment_left_out_Nmm: float | None
    issues: tuple[Issue, ...]


def identify_sensor(
    poses: SensorPoses,
    gravity_root: tuple[float, float, float] = (0.0, 0.0, -1.0),
    noise_N: float = 0.0,
    noise_Nmm: float = 0.0,
    level: float = LEVEL,
) -> SensorIdentification:
    """Fit weight, centre of gravity, offsets and the remaining offset of an unloaded force sensor.

    Parameters
    ----------
    poses : three or more orientations, see `sensor_poses`; 20 or more for the remaining offset.
    gravity_root : direction of gravity in the robot root, of any length.
    noise_N, noise_Nmm : stated 1-sigma of one component; the larger of it and that of the residuals is used.
    level : probability of the intervals (Student's t).

    Raises
    ------
    RefusedError
        Orientations or noise do not determine weight, centre or offset; the message names which.
    """
    gravity = np.array(gravity_root, dtype=float)
    if not np.linalg.norm(gravity) > 0:
        raise input_error(
            "option-value", "gravity: a direction of length 0", "0 0 -1 for a robot on the floor"
        )
    gravity /= np.linalg.norm(gravity)
    down = np.einsum("nji,j->ni", fr.rotation_from_quaternion(poses.rotation), gravity)
    _require_spread(down, poses.source)
    force = _Weighed.of(_force_slope(down), poses.force_N, noise_N, level)
    moment = _Weighed.of(_moment_slope(down), poses.moment_Nmm, noise_Nmm, level)
    weight = force.estimate(0)
    if weight.high - weight.value > _WIDEST * abs(weight.value):
        raise _refused(
            f"the weight: {weight.value:.1f} N, interval {weight.low:.1f} to {weight.high:.1f} N, "
            "is lost in the noise",
            "more orientations, further apart",
            poses.source,
        )
    centre = _centre(force, moment)
    plain = Calibration(
        gravity_root=_three(gravity),
        weight_N=weight.value,
        centre_mm=_three([c.value for c in centre]),
        force_offset_N=_three(force.value[1:]),
        moment_offset_Nmm=_three(moment.value[3:]),
        source=poses.source,
    )
    calibration, left_out, issues = _with_terms(plain, poses)
    before, after = (
        compensate(poses.force_N, poses.moment_Nmm, poses.rotation, c) for c in (plain, calibration)
    )
    return SensorIdentification(
        calibration,
        weight,
        centre,
        force.triple(1),
        moment.triple(3),
        level,
        len(down),
        force.noise,
        moment.noise,
        (_rms(before[0]), _rms(after[0])),
        (_rms(before[1]), _rms(after[1])),
        left_out[0],
        left_out[1],
        (*_doubts(weight, centre), *issues),
    )


# --- weight, centre, offset -----------------------------------------------------------------------------


@dataclass(frozen=True)
class _Weighed:
    """A linear least squares with the interval of each value."""

    value: Floats
    half: Floats
    noise: float

    @classmethod
    def of(cls, slope: Floats, readings: Floats, stated: float, level: float) -> "_Weighed":
        """Fit (n, 3) readings with slopes (n, 3, p)."""
        rows = slope.reshape(-1, slope.shape[2])
        value, *_ = np.linalg.lstsq(rows, readings.ravel(), rcond=None)
        freedom = len(rows) - len(value)
        noise = max(math.sqrt(float(np.sum((readings.ravel() - rows @ value) ** 2)) / freedom), stated)
        half = student(level, freedom) * noise * np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
        return cls(np.asarray(value, dtype=float), half, noise)

    def estimate(self, index: int) -> Estimate:
        return around(float(self.value[index]), float(self.half[index]))

    def triple(self, first: int) -> Triple:
        return self.estimate(first), self.estimate(first + 1), self.estimate(first + 2)


def _force_slope(down: Floats) -> Floats:
    """Return dF/d(W, F_SI) (n, 3, 4): F = W·u + F_SI."""
    unit = np.broadcast_to(np.eye(3), (len(down), 3, 3))
    return np.concatenate([down[:, :, None], unit], axis=2)


def _moment_slope(down: Floats) -> Floats:
    """Return dM/d(s, M_SI) (n, 3, 6): M = s x u + M_SI."""
    unit = np.broadcast_to(np.eye(3), (len(down), 3, 3))
    return np.concatenate([np.cross(np.eye(3), down[:, None, :]).swapaxes(1, 2), unit], axis=2)


def _centre(force: _Weighed, moment: _Weighed) -> Triple:
    """Return r = s/W; the intervals of s and W, independent of each other, are carried over linearly."""
    weight, wide = float(force.value[0]), float(force.half[0])
    centre = []
    for s, half in zip(moment.value[:3], moment.half[:3], strict=True):
        centre.append(around(s / weight, math.hypot(half, s / weight * wide) / abs(weight)))
    return centre[0], centre[1], centre[2]


def _require_spread(down: Floats, source: str) -> None:
    """Refuse orientations in which gravity has only one or two directions in the sensor."""
    if len(down) < LEAST_POSES:
        raise _refused(
            f"{len(down)} orientations, at least {LEAST_POSES} are needed",
            "readings in three or more orientations",
            source,
        )
    spread = np.linalg.svd(down - down.mean(axis=0), compute_uv=False) / math.sqrt(len(down))
    if spread[0] < _LEAST_SPREAD:
        angle = (
            2.0 * math.asin(min(0.5 * float(np.linalg.norm(down - down[0], axis=1).max()), 1.0)) * DEG_PER_RAD
        )
        raise _refused(
            "weight, centre of gravity and offset: gravity has the same direction in the sensor in all "
            f"{len(down)} orientations (within {angle:.1f} deg)",
            "tilt the flange; turning about the vertical changes nothing",
            source,
        )
    if spread[1] < _LEAST_SPREAD:
        axis = np.abs(down - down.mean(axis=0)).max(axis=0)
        raise _refused(
            "centre of gravity and moment offset: gravity has only two directions in the sensor, which "
            f"differ mainly along its {'xyz'[int(np.argmax(axis))]}",
            "a third orientation, tilted about another axis",
            source,
        )


def _refused(what: str, remedy: str, source: str) -> RefusedError:
    return RefusedError(Issue("error", "not-determined", 0, f"not determined: {what}", remedy), source)


# --- what remains ---------------------------------------------------------------------------------------


def _with_terms(
    plain: Calibration, poses: SensorPoses
) -> tuple[Calibration, tuple[float | None, float | None], list[Issue]]:
    """Add the ten quadratic terms if they can be fitted and help; the issues state the decision."""
    force, moment = compensate(poses.force_N, poses.moment_Nmm, poses.rotation, plain)
    terms = quadratic_terms(poses.rotation)
    count = len(terms)
    if count < LEAST_FOR_TERMS:
        text = f"no remaining offset fitted: {count} orientations, {LEAST_FOR_TERMS} are needed (paper: 27)"
        return plain, (None, None), [Issue("note", "remaining-offset", 0, text, _MORE)]
    if np.linalg.svd(terms, compute_uv=False)[-1] < _LEAST_SINGULAR * math.sqrt(count):
        text = "no remaining offset fitted: the orientations are too similar for its ten terms"
        return (
            plain,
            (None, None),
            [Issue("warning", "remaining-offset", 0, text, _MORE)],
        )
    added: dict[str, tuple[tuple[float, float, float], ...]] = {}
    left_out, issues = [], []
    for key, what, unit, residual in (
        ("force_terms_N", "force", "N", force),
        ("moment_terms_Nmm", "moment", "N·mm", moment),
    ):
        coefficients, error = _fit_terms(terms, residual)
        left_out.append(error)
        helps = error < _rms(residual)
        if helps:
            added[key] = tuple(_three(row) for row in coefficients)
        if helps:
            text = (
                f"the {what} holds more than weight and offset, {_rms(residual):.3g} {unit} rms "
                "(hose pack?): the intervals do not cover how much of it counts as weight and offset"
            )
        else:
            text = (
                f"no remaining {what} fitted: {_rms(residual):.3g} {unit} rms without, {error:.3g} {unit} at "
                "readings left out of the fit of its ten terms"
            )
        issues.append(Issue("note", "remaining-offset", 0, text, "nothing to do: it is taken into account"))
    return plain.model_copy(update=added), (left_out[0], left_out[1]), issues


def _fit_terms(terms: Floats, residual: Floats) -> tuple[Floats, float]:
    """Return coefficients (10, 3) and the rms error at readings left out one by one (PRESS)."""
    coefficients, *_ = np.linalg.lstsq(terms, residual, rcond=None)
    leverage = np.einsum("ij,ji->i", terms, np.linalg.pinv(terms))
    error = (residual - terms @ coefficients) / np.maximum(1.0 - leverage, 1e-6)[:, None]
    return np.asarray(coefficients, dtype=float), _rms(error)


def _doubts(weight: Estimate, centre: Triple) -> list[Issue]:
    issues = []
    if weight.value < 0:
        issues.append(
            Issue(
                "warning",
                "weight-sign",
                0,
                f"the weight is {weight.value:.1f} N: the sensor states the reaction, or gravity points up",
                "change the sign of all six readings, or state --gravity",
            )
        )
    if math.hypot(*(c.value for c in centre)) < _NEAR_MM:
        issues.append(
            Issue(
                "warning",
                "moment-unit",
                0,
                "the centre of gravity is less than 1 mm from the sensor's origin: moments in N·m?",
                "the columns are in N·mm",
            )
        )
    return issues


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _three(values: object) -> tuple[float, float, float]:
    x, y, z = np.asarray(values, dtype=float).tolist()
    return x, y, z
