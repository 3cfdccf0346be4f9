"""Identifies `$VEL.ORI` and `$ACC.ORI` from lines on which the tool turns.

k and the law are those that the other sections gave. Position and orientation share one time law, so the
positions of such lines show how fast the controller turns.
"""

import math
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.identify.controller_fit import Fit, Piece, Settings, residual_of, slope_of
from gcode2krl.units import MM_PER_M, RAD_PER_DEG

_STARTS = (0.4, 0.7, 1.0, 1.5, 2.5)
_STEP = 1e-4
_ROUNDS = 40


def fit_turning(
    pieces: list[Piece], fit: Fit, programmed_deg: tuple[float, float], acc_cp_m_s2: float, settings: Settings
) -> tuple[Floats, Floats, float] | None:
    """Return (values, standard errors, rms_mm) of `$VEL.ORI` and `$ACC.ORI` in deg/s and deg/s².

    ``programmed_deg`` are those of the program, from which the fit starts. A standard error is infinite where
    no line is limited by that value. None where no section turns the tool.
    """
    turning = [number for number, piece in enumerate(pieces) if (piece.angle_rad > 0).any()]
    if not turning:
        return None
    problem = _Problem(pieces, turning, fit, np.array(programmed_deg), acc_cp_m_s2, settings)
    starts = [np.array([vel, acc]) for vel in _STARTS for acc in _STARTS]
    scale = problem.descend(min(starts, key=problem.squares))
    residual = problem.residual(scale)
    slopes = problem.slopes(scale)
    used = np.linalg.norm(slopes, axis=0) > 1e-3 * math.sqrt(len(residual)) * _STEP
    error = np.full(2, math.inf)
    variance = float(residual @ residual) / max(len(residual) - len(turning) - 2, 1)
    if used.any():
        normal = slopes[:, used].T @ slopes[:, used]
        error[used] = np.sqrt(variance * np.diag(np.linalg.inv(normal)))
    return (
        problem.programmed_deg * scale,
        problem.programmed_deg * error,
        math.sqrt(float(np.mean(residual**2))),
    )


class _Problem:
    """Residuals of turning sections over (`$VEL.ORI`, `$ACC.ORI`)/programmed, starts projected out."""

    def __init__(
        self,
        pieces: list[Piece],
        turning: list[int],
        fit: Fit,
        programmed_deg: Floats,
        acc_cp_m_s2: float,
        settings: Settings,
    ) -> None:
        self.pieces, self.turning, self.fit = pieces, turning, fit
        self.programmed_deg, self.acc_cp_mm_s2, self.settings = (
            programmed_deg,
            acc_cp_m_s2 * MM_PER_M,
            settings,
        )

    def piece(self, number: int, scale: Floats) -> Piece:
        """Return a section as the controller would plan it with other limits of turning."""
        piece = self.pieces[number]
        turning = piece.angle_rad > 0
        mm_per_rad = np.where(turning, piece.length_mm / np.where(turning, piece.angle_rad, 1.0), np.inf)
        vel, acc = self.programmed_deg * scale * RAD_PER_DEG
        return replace(
            piece,
            speed_mm_s=np.minimum(piece.wanted_mm_s, vel * mm_per_rad),
            acceleration_mm_s2=np.minimum(self.acc_cp_mm_s2, acc * mm_per_rad),
        )

    def residual(self, scale: Floats) -> Floats:
        return np.concatenate([self._settled(number, scale) for number in self.turning])

    def squares(self, scale: Floats) -> float:
        residual = self.residual(scale)
        return float(residual @ residual)

    def _settled(self, number: int, scale: Floats) -> Floats:
        """Return the residuals of a section shifted to where it fits best."""
        piece = self.piece(number, scale)
        starts = self.fit.start_s.copy()
        profile = piece.profile(
            self.fit.k_s, piece.blend_mm(piece.cdis_mm * self.fit.ratio), self.fit.law, self.settings
        )
        starts[number] = piece.middle_s - 0.5 * profile.total_s
        state = replace(self.fit, start_s=starts)
        for _ in range(4):
            slope = slope_of(piece, state, number, 2, self.settings)
            residual = residual_of(piece, state, number, self.settings)
            starts[number] -= (slope @ residual) / max(float(slope @ slope), 1e-30)
        return residual_of(piece, state, number, self.settings)

    def slopes(self, scale: Floats) -> Floats:
        columns = []
        for step in _STEP * np.eye(2):
            columns.append((self.residual(scale + step) - self.residual(scale - step)) / (2.0 * _STEP))
        return np.stack(columns, axis=1)

    def descend(self, scale: Floats) -> Floats:
        """Return the scales with the least squares: Gauss-Newton with Levenberg's damping."""
        residual, damping = self.residual(scale), 1e-3
        for _ in range(_ROUNDS):
            slopes = self.slopes(scale)
            normal = slopes.T @ slopes
            ridge = damping * np.diag(np.diag(normal)) + 1e-12 * np.eye(2)
            tried = np.clip(scale - np.linalg.solve(normal + ridge, slopes.T @ residual), 0.05, 20.0)
            other = self.residual(tried)
            if other @ other < residual @ residual:
                done = np.abs(tried - scale).max() < 1e-7
                scale, residual, damping = tried, other, 0.1 * damping
                if done:
                    break
            else:
                damping *= 10.0
                if damping > 1e6:
                    break
        return scale
