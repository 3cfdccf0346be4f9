"""Cutting-force coefficients from measured forces: the linear edge law is linear in its six coefficients.

Measured forces are averaged over the samples of the prediction (nothing faster than a revolution is in the
model). The delay of the measuring chain and a constant force of each axis (zero of the sensor, weight) are
nuisance parameters: the delay is searched, the zero is solved for with the coefficients. Intervals are valid
for residuals that are correlated in time (Newey & West 1987, Bartlett weights).
"""

import math
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.errors import Issue, RefusedError
from gcode2krl.identify.estimate import QUANTILE_90

NAMES = ("Ktc", "Krc", "Kac", "Kte", "Kre", "Kae")
LEAST_SAMPLES = 30
LONGEST_DELAY_S = 0.25
_WIDEST = 0.5
"""A coefficient whose half interval is a larger fraction of the typical size of its kind is not
determined."""
_MEMORY_S = 0.12
"""Residuals further apart in time count as independent."""
_STEADY = 0.02
"""Relative change of the predicted force over two samples above which a sample is left out: at entries and
exits an error of the clock or of the stock's place would count as force."""


@dataclass(frozen=True)
class ForceFit:
    """Coefficients with their 90 % intervals."""

    value: Floats
    """(6,) Ktc, Krc, Kac in N/mm² and Kte, Kre, Kae in N/mm."""
    half: Floats
    """(6,) half-widths of the 90 % intervals; infinite where the data do not determine it."""
    zero_N: Floats
    """(3,) constant force of each axis."""
    delay_s: float
    """Delay of the measured force."""
    rms_N: float
    """Residual of one axis while cutting."""
    relative_band: float
    """Half-width of the 90 % band of forces with these coefficients, relative."""
    samples: int
    time_s: Floats
    measured_N: Floats
    fitted_N: Floats
    determined: Bools

    def require_all(self, source: str) -> None:
        """Raise `RefusedError` that names the coefficients which the data do not determine."""
        if self.determined.all():
            return
        missing = ", ".join(name for name, good in zip(NAMES, self.determined, strict=True) if not good)
        raise RefusedError(
            Issue(
                "error",
                "not-determined",
                0,
                f"the data do not determine {missing}",
                "cut slots at three feeds per tooth at least, from 0.03 to 0.15 mm, at one depth and more",
            ),
            source,
        )


def fit_force(time_s: Floats, basis_N: Floats, measured_s: Floats, measured_N: Floats) -> ForceFit:
    """Fit the coefficients to a measured force.

    Parameters
    ----------
    time_s : (m,) times of the prediction, evenly spaced.
    basis_N : (m, 3, 6) force that each coefficient brings (`cutting.force_basis`), along the
        sensor's axes.
    sensor. measured_s, measured_N : (n,), (n, 3) the force on the tool, on the prediction's clock.

    Raises
    ------
    RefusedError
        Where too little of the run is in cut.
    """
    step_s = float(time_s[1] - time_s[0]) if len(time_s) > 1 else 0.0
    delays = np.arange(-LONGEST_DELAY_S, LONGEST_DELAY_S + step_s / 2, step_s)
    trials = [_solve(time_s, basis_N, measured_s, measured_N, float(delay)) for delay in delays]
    best = int(np.argmin([trial[0] for trial in trials]))
    delay_s = float(delays[best])
    if 0 < best < len(delays) - 1:  # vertex of the parabola through the three best
        left, middle, right = (trials[best + offset][0] for offset in (-1, 0, 1))
        bend = left - 2.0 * middle + right
        if bend > 0.0:
            delay_s += 0.5 * step_s * (left - right) / bend
    _, rows, design, wanted, solution = _solve(time_s, basis_N, measured_s, measured_N, delay_s, True)
    return _fit_of(time_s, rows, design, wanted, solution, delay_s, step_s)


def _solve(
    time_s: Floats,
    basis_N: Floats,
    measured_s: Floats,
    measured_N: Floats,
    delay_s: float,
    steady_only: bool = False,
) -> tuple[float, Ints, Floats, Floats, Floats]:
    """Return (mean square, rows, design (3r, 9), wanted (3r,), solution (9,)) for one delay."""
    rows, mean_N = _averaged(time_s, measured_s - delay_s, measured_N)
    if steady_only:
        steady = _steady(basis_N)[rows]
        rows, mean_N = rows[steady], mean_N[steady]
    rows_in_cut = np.abs(basis_N[rows]).max(axis=(1, 2)) > 0.0
    if np.count_nonzero(rows_in_cut) < LEAST_SAMPLES:
        raise RefusedError(
            Issue(
                "error",
                "not-determined",
                0,
                f"{np.count_nonzero(rows_in_cut)} samples in cut, at least {LEAST_SAMPLES} are needed",
                "record force.csv over a whole slot; do prediction and run belong together?",
            )
        )
    design = np.zeros((len(rows), 3, 9))
    design[:, :, :6] = basis_N[rows]
    design[:, [0, 1, 2], [6, 7, 8]] = 1.0
    flat, wanted = design.reshape(-1, 9), mean_N.reshape(-1)
    scale = np.maximum(np.linalg.norm(flat, axis=0), 1e-12)
    solution = np.linalg.lstsq(flat / scale, wanted, rcond=1e-8)[0] / scale
    residual = wanted - flat @ solution
    return float(np.mean(residual**2)), rows, flat, wanted, solution


def _steady(basis_N: Floats) -> Bools:
    """Return (m,) True where the engagement hardly changes within two samples to both sides."""
    flat = basis_N.reshape(len(basis_N), -1)
    change = np.zeros(len(flat))
    for shift in (-2, -1, 1, 2):
        other = np.roll(flat, shift, axis=0)
        change = np.maximum(change, np.abs(flat - other).max(axis=1))
    steady: Bools = change <= _STEADY * np.maximum(np.abs(flat).max(axis=1), 1e-12)
    return steady


def _averaged(time_s: Floats, measured_s: Floats, measured_N: Floats) -> tuple[Ints, Floats]:
    """Return the prediction's samples that were measured (r,) and the measured mean around each (r, 3).

    Where the sensor is slower than the prediction, the nearest sample counts.
    """
    step_s = time_s[1] - time_s[0]
    at = np.rint((measured_s - time_s[0]) / step_s).astype(np.int64)
    inside = (at >= 0) & (at < len(time_s))
    count = np.bincount(at[inside], minlength=len(time_s))
    total = np.stack(
        [np.bincount(at[inside], measured_N[inside, axis], len(time_s)) for axis in range(3)], axis=1
    )
    rows = np.flatnonzero(count)
    return rows, total[rows] / count[rows, None]


def _fit_of(
    time_s: Floats,
    rows: Ints,
    design: Floats,
    wanted: Floats,
    solution: Floats,
    delay_s: float,
    step_s: float,
) -> ForceFit:
    residual = (wanted - design @ solution).reshape(-1, 3)
    used = np.linalg.norm(design, axis=0) > 1e-9
    covariance = np.full((9, 9), np.inf)
    normal = design[:, used].T @ design[:, used]
    if np.linalg.cond(normal / np.outer(*2 * [np.sqrt(np.diag(normal))])) < 1e10:
        inverse = np.linalg.inv(normal)
        score = np.einsum("rai,ra->ri", design[:, used].reshape(len(rows), 3, -1), residual)
        spread = _long_run(score, max(1, round(_MEMORY_S / max(step_s, 1e-6))))
        covariance[np.ix_(used, used)] = inverse @ spread @ inverse
    half = np.where(used, QUANTILE_90 * np.sqrt(np.maximum(np.diag(covariance), 0.0)), np.inf)[:6]
    fitted = (design @ solution).reshape(-1, 3)
    in_cut = np.abs(design.reshape(len(rows), 3, 9)[:, :, :6]).max(axis=(1, 2)) > 0.0
    typical = np.repeat([np.abs(solution[:3]).max(), np.abs(solution[3:6]).max()], 3)
    return ForceFit(
        value=solution[:6],
        half=half,
        zero_N=solution[6:],
        delay_s=delay_s,
        rms_N=float(np.sqrt(np.mean(residual[in_cut] ** 2))),
        relative_band=_band(design, covariance, fitted, in_cut),
        samples=int(np.count_nonzero(in_cut)),
        time_s=time_s[rows],
        measured_N=wanted.reshape(-1, 3),
        fitted_N=fitted,
        determined=half <= _WIDEST * typical,
    )


def _long_run(score: Floats, memory: int) -> Floats:
    """Return the sum of the autocovariances of the score (r, p) with Bartlett weights."""
    spread: Floats = score.T @ score
    for lag in range(1, min(memory, len(score) - 1) + 1):
        cross = score[lag:].T @ score[:-lag]
        spread += (1.0 - lag / (memory + 1.0)) * (cross + cross.T)
    return spread


def _band(design: Floats, covariance: Floats, fitted: Floats, in_cut: Bools) -> float:
    """Return the half-width of the 90 % band of the force, relative to its size, where it is largest."""
    if not np.isfinite(covariance[:6, :6]).all():
        return math.inf
    cut = design.reshape(len(in_cut), 3, 9)[in_cut][:, :, :6]
    variance = np.einsum("rai,ij,raj->r", cut, covariance[:6, :6], cut)
    size = np.linalg.norm(fitted[in_cut], axis=1)
    strong = size > 0.5 * size.max(initial=0.0)
    return float(np.max(QUANTILE_90 * np.sqrt(np.maximum(variance[strong], 0.0)) / size[strong]))
