"""Robust regularised least squares of the small numbers, on some rows, and what the rows tell of them.

Minimised is sum rho(|residual|²/sigma²) + sum (theta/width)², with scipy's ``least_squares`` and its soft_l1;
then rows that are far off are left out and the plain squares are minimised, since soft_l1 alone wastes some
of the good rows. Rows are of equal and independent noise, which is learnt from what they leave: numbers that
no row tells keep their width.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import chdtri

from gcode2krl.arrays import Bools, Floats
from gcode2krl.identify.kinematics.parameters import Model

_LEAST_SIGMA_MM = 1e-6
_FREE_MM = 1.0
"""Step in which a number without a width is counted: 1 mm, 1 mrad."""
_CHANCE = 0.01
"""That one good row of all is called an outlier."""
_TAILS = 1.5
"""So much further off is an outlier: a model that is not whole leaves longer tails than noise. Our choice."""
_ROUNDS = 4
_WIDTH_ROUNDS = 6
_NARROWEST, _WIDEST = 0.05, 5.0
"""By how much the widths of a group may be scaled together."""


@dataclass(frozen=True, eq=False)
class Fit:
    """The small numbers and what is left."""

    theta: Floats
    """(p,)"""
    sigma_mm: float
    """1-sigma of one coordinate, as the rows leave it."""
    covariance: Floats
    """(p, p) beside the widths."""
    by_rows: Floats
    """(p,) 1-sigma of each number by the rows and the others' widths alone; inf where it is not told."""
    is_outlier: Bools
    """(n,) among the rows that were fitted."""
    slopes: Floats
    """(3 n', p) of the good rows, in mm."""
    freedom: float
    """Coordinates less the numbers that they tell."""


def steps_of(model: Model) -> Floats:
    """Return the unit (p,) in which each number is counted: its width, or 1 mm or 1 mrad."""
    free = np.array([1e-3 if number.unit in ("deg", "mrad") else _FREE_MM for number in model.numbers])
    return np.where(np.isfinite(model.widths), model.widths, free)


def fitted(
    model: Model, measured_mm: Floats, rows: Bools, start: Floats | None = None, good: Bools | None = None
) -> Fit:
    """Return the fit to some rows (n,) of measured points (n, 3).

    ``good`` (n,): rows already known to be none too far off; no others are then looked for.
    """
    fitting = _Fitting(model, measured_mm, start)
    if good is not None:
        return fitting.plain(rows & good, rows)
    kept = rows.copy()
    sigma = fitting.robust(rows)
    for _ in range(_ROUNDS):
        before = kept
        kept = rows & ~_is_far(fitting.off(), sigma, int(rows.sum()))
        sigma = fitting.squares(kept, sigma)
        if (kept == before).all():
            break
    return fitting.plain(kept, rows)


def _is_far(off_mm: Floats, sigma: float, count: int) -> Bools:
    """Tell which points (n, 3) are further off than one of ``count`` by chance."""
    limit = _TAILS**2 * chdtri(3, _CHANCE / count)
    return np.asarray(np.sum(off_mm**2, axis=1) > limit * sigma**2)


class _Fitting:
    """The state of a fit: numbers in units of their steps."""

    def __init__(self, model: Model, measured_mm: Floats, start: Floats | None) -> None:
        self._model, self._measured = model, measured_mm
        self._steps = steps_of(model)
        self._has_width = np.isfinite(model.widths)
        self._precision = self._has_width.astype(float)
        """(p,) 1/width² in units of the steps."""
        groups = np.array([number.group for number in model.numbers])
        self._groups = [self._has_width & (groups == group) for group in dict.fromkeys(groups)]
        self._u = np.zeros(len(self._steps)) if start is None else start / self._steps

    def off(self) -> Floats:
        """Return by how much all points (n, 3) are off."""
        off: Floats = self._model.tips(self._u * self._steps) - self._measured
        return off

    def robust(self, rows: Bools) -> float:
        """Minimise soft_l1; return the noise by the median of what is left."""
        sigma = self._spread(rows)
        for _ in range(3):
            self._minimise(rows, sigma, "soft_l1")
            sigma, before = self._spread(rows), sigma
            if sigma > 0.9 * before:
                break
        return sigma

    def squares(self, rows: Bools, sigma: float) -> float:
        """Minimise squares; return the noise by what is left and the freedom that is left."""
        for _ in range(3):
            self._minimise(rows, sigma, "linear")
            sigma, before = self._noise(rows, sigma)[0], sigma
            if abs(sigma / before - 1.0) < 0.02:
                break
        return sigma

    def plain(self, rows: Bools, all_rows: Bools) -> Fit:
        """Minimise squares and return the fit."""
        sigma = self.squares(rows, self._spread(rows))
        for _ in range(_WIDTH_ROUNDS):
            self._widen(self._noise(rows, sigma)[2])
            self._minimise(rows, sigma, "linear")
            sigma = self._noise(rows, sigma)[0]
        sigma, freedom, covariance, slopes = self._noise(rows, sigma)
        variance = np.diag(covariance) / self._steps**2
        precision = 1.0 / variance - self._precision
        by_rows = np.where(
            precision > 1e-3 / variance, self._steps / np.sqrt(np.maximum(precision, 1e-300)), np.inf
        )
        return Fit(self._u * self._steps, sigma, covariance, by_rows, all_rows & ~rows, slopes, freedom)

    def _widen(self, covariance: Floats) -> None:
        """Scale the widths of each group together to what its numbers are (expectation maximisation)."""
        power = self._u**2 + np.diag(covariance) / self._steps**2
        for group in self._groups:
            if group.sum() > 1:
                scale = np.clip(power[group].mean(), _NARROWEST**2, _WIDEST**2)
                self._precision[group] = 1.0 / scale

    def _spread(self, rows: Bools) -> float:
        """Return the noise of a coordinate by the median of their sizes."""
        return max(float(np.median(np.abs(self.off()[rows]))) / 0.6745, _LEAST_SIGMA_MM)

    def _noise(self, rows: Bools, sigma: float) -> tuple[float, float, Floats, Floats]:
        """Return the noise, the freedom, the covariance of the numbers and their slopes (3 n', p)."""
        _, slopes = self._model.slopes(self._u * self._steps)
        flat = slopes[rows].reshape(-1, slopes.shape[2])
        scaled = flat * self._steps
        normal = scaled.T @ scaled
        inverse = np.linalg.inv(
            normal + sigma**2 * np.diag(self._precision) + 1e-9 * np.diag(np.diag(normal))
        )
        spent = float(np.trace(inverse @ normal))
        freedom = max(len(flat) - spent, 1.0)
        residual = self.off()[rows]
        sigma = max(float(np.sqrt(np.sum(residual**2) / freedom)), _LEAST_SIGMA_MM)
        covariance = sigma**2 * inverse * np.outer(self._steps, self._steps)
        return sigma, freedom, covariance, flat

    def _minimise(self, rows: Bools, sigma: float, loss: str) -> None:
        weight = np.sqrt(self._precision)
        measured = self._measured[rows]

        def residual(u: Floats) -> Floats:
            off = (self._model.tips(u * self._steps)[rows] - measured) / sigma
            return np.concatenate([off.reshape(-1), weight * u])

        def jacobian(u: Floats) -> Floats:
            _, slopes = self._model.slopes(u * self._steps)
            flat = slopes[rows].reshape(-1, len(u)) * (self._steps / sigma)
            return np.concatenate([flat, np.diag(weight)])

        solution = least_squares(
            residual,
            self._u,
            jac=jacobian,
            loss=loss,
            f_scale=1.5,
            xtol=1e-8,
            ftol=1e-8,
            gtol=1e-8,
            max_nfev=30,
        )
        self._u = np.asarray(solution.x)
