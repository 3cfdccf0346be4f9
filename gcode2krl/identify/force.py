"""Cutting-force coefficients from measured forces: the linear edge law is linear in its six coefficients.

Measured forces are averaged over the samples of the prediction (nothing faster than a revolution is in the
model). The delay of the measuring chain and a constant force of each axis (zero of the sensor, weight) are
nuisance parameters: the delay is searched, the zero is solved for with the coefficients unless the sensor was
zeroed. Intervals are valid for residuals that are correlated in time (Newey & West 1987, Bartlett weights).

They are those of the noise. How far the law itself is off shows on cuts that the fit has not seen: each
condition of cut is left out in turn and predicted from the others (`_misfit`); the band of forces is theirs.
"""

import math
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.errors import Issue, RefusedError
from gcode2krl.identify.estimate import QUANTILE_90, student

NAMES = ("Ktc", "Krc", "Kac", "Kte", "Kre", "Kae")
LEAST_SAMPLES = 30
LONGEST_DELAY_S = 0.25
_WIDEST = 0.5
"""A coefficient whose half interval is a larger fraction of the typical size of its kind is not
determined."""
_MEMORY_S = 0.12
"""Residuals further apart in time count as independent."""
_SAME = 0.05
"""Relative difference of the predicted force up to which two samples are of one condition of cut."""
_MOST_CONDITIONS = 24
_LEAST_CONDITIONS = 3
"""Fewer conditions that can be predicted from the others do not tell how far the law is off."""
_DEGENERATE = 1e-10
"""Eigenvalue of the scaled normal matrix, relative to the largest, of what the rows do not tell at all."""
UNTESTED_BAND = 0.4
"""Band where the data cannot test the law; an assumption."""
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
    """Half-width of the 90 % band of forces with these coefficients, relative: the larger one of what noise
    leaves open and of the misfit on conditions that were left out."""
    misfit: Floats
    """(c,) size of the error of the force on each condition of cut, predicted from the others, relative to
    the prediction; NaN where the others do not determine it."""
    zero_confounds: bool
    """True where the coefficients are told only if the sensor's zero is stated, or recorded in air."""
    samples: int
    time_s: Floats
    measured_N: Floats
    fitted_N: Floats
    determined: Bools
    rows: Ints
    """(r,) samples of the prediction in a steady cut: the range over which the fit holds is theirs."""

    def require_all(self, source: str) -> None:
        """Raise `RefusedError` that names the coefficients which the data do not determine."""
        if self.determined.all():
            return
        missing = ", ".join(name for name, good in zip(NAMES, self.determined, strict=True) if not good)
        sentence = f"the data do not determine {missing}"
        remedy = "cut slots at three feeds per tooth at least, from 0.03 to 0.15 mm, at one depth and more"
        if self.zero_confounds:
            sentence += ": the edges' force cannot be told from the sensor's zero"
            remedy = (
                "record the air before or after the cut, or state --zeroed where the sensor was zeroed there"
            )
        raise RefusedError(Issue("error", "not-determined", 0, sentence, remedy), source)


def fit_force(
    time_s: Floats, basis_N: Floats, measured_s: Floats, measured_N: Floats, *, zeroed: bool = False
) -> ForceFit:
    """Fit the coefficients to a measured force.

    Parameters
    ----------
    time_s : (m,) times of the prediction, evenly spaced.
    basis_N : (m, 3, 6) force that each coefficient brings (`cutting.force_basis`), along the sensor's axes.
    measured_s, measured_N : (n,), (n, 3) the force on the tool, on the prediction's clock.
    zeroed : the sensor shows no force in air, so no zero is fitted.

    Raises
    ------
    RefusedError
        Where too little of the run is in cut.
    """
    step_s = float(time_s[1] - time_s[0]) if len(time_s) > 1 else 0.0
    delays = np.arange(-LONGEST_DELAY_S, LONGEST_DELAY_S + step_s / 2, step_s)
    zero = not zeroed
    trials = [_solve(time_s, basis_N, measured_s, measured_N, float(delay), zero) for delay in delays]
    best = int(np.argmin([trial[0] for trial in trials]))
    delay_s = float(delays[best])
    if 0 < best < len(delays) - 1:  # vertex of the parabola through the three best
        lower, middle, upper = (trials[best + offset][0] for offset in (-1, 0, 1))
        bend = lower - 2.0 * middle + upper
        if bend > 0.0:
            delay_s += 0.5 * step_s * (lower - upper) / bend
    _, rows, design, wanted, solution = _solve(
        time_s, basis_N, measured_s, measured_N, delay_s, zero, steady_only=True
    )
    return _fit_of(time_s, rows, design, wanted, solution, delay_s, step_s)


def _solve(
    time_s: Floats,
    basis_N: Floats,
    measured_s: Floats,
    measured_N: Floats,
    delay_s: float,
    zero: bool,
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
    design[:, [0, 1, 2], [6, 7, 8]] = float(zero)
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
    inverse, is_told, _ = _inverse(design.T @ design)
    score = np.einsum("rai,ra->ri", design.reshape(len(rows), 3, 9), residual)
    spread = _long_run(score, max(1, round(_MEMORY_S / max(step_s, 1e-6))))
    covariance = inverse @ spread @ inverse
    half = np.where(is_told, QUANTILE_90 * np.sqrt(np.maximum(np.diag(covariance), 0.0)), np.inf)[:6]
    fitted = (design @ solution).reshape(-1, 3)
    cut_N = design.reshape(len(rows), 3, 9)[:, :, :6]
    in_cut = np.abs(cut_N).max(axis=(1, 2)) > 0.0
    typical = np.repeat([np.abs(solution[:3]).max(), np.abs(solution[3:6]).max()], 3)
    determined = half <= _WIDEST * typical
    _, told_if_zeroed, _ = _inverse(design[:, :6].T @ design[:, :6])
    misfit = _misfit(design, wanted, _conditions(cut_N))
    return ForceFit(
        value=solution[:6],
        half=half,
        zero_N=solution[6:],
        delay_s=delay_s,
        rms_N=float(np.sqrt(np.mean(residual[in_cut] ** 2))),
        relative_band=max(
            _band(design, covariance, fitted, in_cut) if determined.all() else math.inf, _band_of(misfit)
        ),
        misfit=misfit,
        zero_confounds=bool(not determined.all() and design[:, 6:].any() and told_if_zeroed.all()),
        samples=int(np.count_nonzero(in_cut)),
        time_s=time_s[rows],
        measured_N=wanted.reshape(-1, 3),
        fitted_N=fitted,
        determined=determined,
        rows=rows[in_cut],
    )


def _inverse(normal: Floats) -> tuple[Floats, Bools, int]:
    """Return the inverse (p, p) of a normal matrix on what its rows tell, the numbers (p,) told, the rank.

    A combination that no row tells takes no number with it that has no part in it.
    """
    scale = np.sqrt(np.maximum(np.diag(normal), 0.0))
    used = scale > 1e-9
    scale = np.where(used, scale, 1.0)
    size, axis = np.linalg.eigh(normal / np.outer(scale, scale))
    kept = size > _DEGENERATE * size.max(initial=1.0)
    inverse = (axis[:, kept] / size[kept]) @ axis[:, kept].T / np.outer(scale, scale)
    is_told = used & (np.linalg.norm(axis[:, ~kept], axis=1) < 1e-3)
    return inverse, np.asarray(is_told), int(np.count_nonzero(kept & (size > 0.0)))


def _conditions(cut_N: Floats) -> Ints:
    """Return the condition of cut (r,) of rows (r, 3, 6), -1 in air; one condition is one force (`_SAME`)."""
    flat = cut_N.reshape(len(cut_N), -1)
    size = np.linalg.norm(flat, axis=1)
    condition = np.where(size > 0.0, _MOST_CONDITIONS - 1, -1)
    unassigned = size > 0.0
    for number in range(_MOST_CONDITIONS - 1):
        if not unassigned.any():
            break
        first = int(np.argmax(unassigned))
        alike = unassigned & (_apart(flat, flat[first]) <= _SAME)
        condition[alike] = number
        unassigned &= ~alike
    return condition


def _apart(rows: Floats, row: Floats) -> Floats:
    """Return by how much rows (r, p) differ from one of them (p,), each column in its own unit."""
    unit = np.maximum(np.abs(row), 1e-3 * np.abs(row).max())
    apart: Floats = np.abs((rows - row) / unit).max(axis=1)
    return apart


def _misfit(design: Floats, wanted: Floats, condition: Ints) -> Floats:
    """Return the relative error (c,) of the mean force of each condition, predicted from all other rows."""
    normal, right = design.T @ design, design.T @ wanted
    rank = _inverse(normal)[2]
    misfit = np.full(int(condition.max(initial=-1)) + 1, np.nan)
    for number in range(len(misfit)):
        rows = np.repeat(condition == number, 3)
        block, seen = design[rows], wanted[rows]
        others = normal - block.T @ block
        inverse, _, rank_of_others = _inverse(others)
        if rank_of_others < rank:
            continue
        solution = inverse @ (right - block.T @ seen)
        error_N = np.mean((seen - block @ solution).reshape(-1, 3), axis=0)
        force_N = np.mean((block[:, :6] @ solution[:6]).reshape(-1, 3), axis=0)
        misfit[number] = np.linalg.norm(error_N) / max(float(np.linalg.norm(force_N)), 1e-9)
    return misfit


def _band_of(misfit: Floats) -> float:
    """Return the half-width of the 90 % band of another condition's force, from the errors of some (c,)."""
    judged = misfit[np.isfinite(misfit)]
    if len(judged) < _LEAST_CONDITIONS:
        return UNTESTED_BAND
    return float(student(0.90, len(judged)) * np.sqrt(np.mean(judged**2)))


def _long_run(score: Floats, memory: int) -> Floats:
    """Return the sum of the autocovariances of the score (r, p) with Bartlett weights."""
    spread: Floats = score.T @ score
    for lag in range(1, min(memory, len(score) - 1) + 1):
        cross = score[lag:].T @ score[:-lag]
        spread += (1.0 - lag / (memory + 1.0)) * (cross + cross.T)
    return spread


def _band(design: Floats, covariance: Floats, fitted: Floats, in_cut: Bools) -> float:
    """Return the half-width of the 90 % band of the force, relative to its size, where it is largest."""
    cut = design.reshape(len(in_cut), 3, 9)[in_cut][:, :, :6]
    variance = np.einsum("rai,ij,raj->r", cut, covariance[:6, :6], cut)
    size = np.linalg.norm(fitted[in_cut], axis=1)
    strong = size > 0.5 * size.max(initial=0.0)
    return float(np.max(QUANTILE_90 * np.sqrt(np.maximum(variance[strong], 0.0)) / size[strong]))
