"""The fit of the controller's closed forms to a trace: rest-to-rest pieces, derivatives, Gauss-Newton steps.

Trace and program are cut at standstills and matched in order. The start of each piece is a nuisance
parameter and is projected out of residuals and derivatives (Frisch-Waugh-Lovell), which leaves two unknowns:
k, and the ratio of effective to programmed CDIS.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.errors import input_error
from gcode2krl.krc4.motion import Chain
from gcode2krl.krc4.profile import Profile, plan_profile
from gcode2krl.krc4.sampling import sample
from gcode2krl.runs import ControllerTrace, program_rests
from gcode2krl.tables import Targets

Law = Literal["averages", "trapezoid"]
LEAST_DWELL_S = 0.15
"""Program: an exact stop with at least this dwell ends a section."""
_LEAST_STILL_S = 0.1
"""Trace: a rest of at least this ends a section; less than the dwell, because noise and tails shorten it."""
_K_STARTS_CYCLES = (4, 8, 11, 14, 18, 24)
_RATIO_STARTS = (0.3, 0.6, 1.0, 1.7)
_MARGIN_SAMPLES = 8


@dataclass(frozen=True)
class Settings:
    """Quantities that are not fitted."""

    moves_in_view: int
    cycle_s: float


@dataclass(frozen=True)
class Piece:
    """A section during the fit: moves of the chain and samples of the trace."""

    start_mm: Floats
    end_mm: Floats
    length_mm: Floats
    speed_mm_s: Floats
    acceleration_mm_s2: Floats
    angle_rad: Floats
    """(n,) by which the tool turns during the move."""
    wanted_mm_s: Floats
    """(n,) programmed speeds, before `$VEL.ORI`."""
    wait_s: Floats
    stop: Bools
    cdis_mm: Floats
    """(n,) programmed."""
    half_mm: Floats
    """(n,) half of the shorter line at each vertex."""
    cos_half: Floats
    source_line: Ints
    fitted: bool
    time_s: Floats
    position_mm: Floats
    middle_s: float
    """Middle of the motion on the trace's clock."""
    still: Bools
    """(m,) True on samples at rest."""

    def blend_mm(self, cdis_mm: Floats) -> Floats:
        """Return d = min(CDIS, half lines) (n,), 0 at exact stops."""
        return np.where(self.stop, 0.0, np.minimum(cdis_mm, self.half_mm))

    def profile(self, k_s: float, blend_mm: Floats, law: Law, settings: Settings) -> Profile:
        """Plan the section."""
        return plan_profile(
            self.length_mm,
            self.speed_mm_s,
            blend_mm,
            self.stop,
            self.wait_s,
            self.acceleration_mm_s2,
            k_s,
            settings.moves_in_view,
            law == "averages",
        )


@dataclass(frozen=True)
class Fit:
    """A state of the fit under one law."""

    law: Law
    k_s: float
    ratio: float
    """Effective over programmed CDIS."""
    start_s: Floats
    """(s,) start of each section."""
    squares_mm2: float
    """Sum of squared residuals of the fitted sections."""


# --- sections -------------------------------------------------------------------------------------------


def cut_pieces(trace: ControllerTrace, targets: Targets, chain: Chain) -> tuple[list[Piece], int]:
    """Return the sections of the program with their samples, and how many others the trace has."""
    if len(chain.length_mm) == 0:
        raise input_error("trace-sections", "the program has no move", source=targets.source)
    bounds = _program_bounds(chain)
    last = [end - 1 for _, end in bounds]
    wanted = np.concatenate([chain.start_mm[:1], chain.end_mm[last]])
    lines = np.append(chain.source_line[[first for first, _ in bounds]], chain.source_line[last[-1]])
    rests, others = program_rests(trace, wanted, lines.astype(np.int64), _LEAST_STILL_S)
    pieces = [
        _piece(trace, targets, chain, bound, before, after)
        for bound, before, after in zip(bounds, rests[:-1], rests[1:], strict=True)
    ]
    if not any(piece.fitted for piece in pieces):
        pieces = [replace(piece, fitted=True) for piece in pieces]
    return pieces, others


def _program_bounds(chain: Chain) -> list[tuple[int, int]]:
    """Return (first, end) rows of the chain of each section that moves."""
    ends = np.flatnonzero(chain.stop & (chain.wait_s >= LEAST_DWELL_S)) + 1
    ends = np.unique(np.append(ends, len(chain.length_mm)))
    starts = np.concatenate([[0], ends[:-1]])
    moved = [float(chain.length_mm[first:end].sum()) > 0 for first, end in zip(starts, ends, strict=True)]
    return [(int(first), int(end)) for first, end, moves in zip(starts, ends, moved, strict=True) if moves]


def _piece(
    trace: ControllerTrace, targets: Targets, chain: Chain, bound: tuple[int, int], before: Ints, after: Ints
) -> Piece:
    rows = slice(*bound)
    last_still, first_still = int(before[1]), int(after[0])
    low = max(int(before[0]), last_still - _MARGIN_SAMPLES)
    high = min(int(after[1]), first_still + _MARGIN_SAMPLES) + 1
    stop = np.array(chain.stop[rows])
    stop[-1] = True
    length = np.array(chain.length_mm[rows])
    half = np.append(np.minimum(length[:-1], length[1:]) / 2.0, 0.0)
    speed = np.array(chain.speed_mm_s[rows])
    angle = np.array(chain.angle_rad[rows])
    wait = np.array(chain.wait_s[rows])
    wait[-1] = 0.0
    index = np.arange(low, high)
    target_rows = slice(chain.first + 1 + bound[0], chain.first + 1 + bound[1])
    return Piece(
        start_mm=np.array(chain.start_mm[rows]),
        end_mm=np.array(chain.end_mm[rows]),
        length_mm=length,
        speed_mm_s=speed,
        acceleration_mm_s2=np.array(chain.acceleration_mm_s2[rows]),
        angle_rad=angle,
        wanted_mm_s=np.array(targets.speed_mm_s[target_rows]),
        wait_s=wait,
        stop=stop,
        cdis_mm=np.array(targets.cdis_mm[target_rows]),
        half_mm=half,
        cos_half=np.array(chain.cos_half[rows]),
        source_line=np.array(chain.source_line[rows], dtype=np.int64),
        fitted=bool((stop[:-1] | (speed[:-1] == speed[1:])).all())
        and not targets.ptp[target_rows].any()
        and not (angle > 0).any(),
        time_s=np.array(trace.time_s[low:high]),
        position_mm=np.array(trace.position_mm[low:high]),
        middle_s=0.5 * float(trace.time_s[last_still] + trace.time_s[first_still]),
        still=(index <= last_still) | (index >= first_still),
    )


# --- the fit --------------------------------------------------------------------------------------------


def modelled(
    piece: Piece, start_s: float, k_s: float, cdis_mm: Floats, law: Law, settings: Settings
) -> Floats:
    """Return the positions (m, 3) of a section that starts at ``start_s``."""
    blend = piece.blend_mm(cdis_mm)
    profile = piece.profile(k_s, blend, law, settings)
    time_s = piece.time_s - start_s
    moves = (piece.start_mm, piece.end_mm, piece.length_mm, blend)
    return sample(time_s, profile, *moves, k_s).position_mm


def residual_of(piece: Piece, fit: Fit, number: int, settings: Settings) -> Floats:
    """Return model minus trace (3m,)."""
    model = modelled(piece, float(fit.start_s[number]), fit.k_s, piece.cdis_mm * fit.ratio, fit.law, settings)
    return (model - piece.position_mm).ravel()


def slope_of(piece: Piece, fit: Fit, number: int, what: int, settings: Settings) -> Floats:
    """Return the derivative (3m,) of the model by k (0), the CDIS ratio (1) or the start (2)."""
    step = (1e-5, 1e-4, 1e-5)[what]
    steps = [0.0, 0.0, 0.0]
    ends = []
    for sign in (1.0, -1.0):
        steps[what] = sign * step
        start, cdis = float(fit.start_s[number]) + steps[2], piece.cdis_mm * (fit.ratio + steps[1])
        ends.append(modelled(piece, start, fit.k_s + steps[0], cdis, fit.law, settings))
    return ((ends[0] - ends[1]) / (2.0 * step)).ravel()


@dataclass(frozen=True)
class _Linear:
    """A linearised section, with its start projected out."""

    residual: Floats
    slopes: Floats
    """(3m, 2) by k and the CDIS ratio."""
    start_slope: Floats
    raw_residual: Floats
    raw_slopes: Floats


def linearised(piece: Piece, fit: Fit, number: int, settings: Settings) -> _Linear:
    """Return residuals and derivatives of a piece by k and CDIS, its start projected out."""
    residual = residual_of(piece, fit, number, settings)
    bends = bool((~piece.stop).any())
    by_ratio = slope_of(piece, fit, number, 1, settings) if bends else np.zeros_like(residual)
    slopes = np.stack([slope_of(piece, fit, number, 0, settings), by_ratio], axis=1)
    start = slope_of(piece, fit, number, 2, settings)
    size = max(float(start @ start), 1e-30)
    return _Linear(
        residual=residual - start * (start @ residual) / size,
        slopes=slopes - np.outer(start, start @ slopes) / size,
        start_slope=start,
        raw_residual=residual,
        raw_slopes=slopes,
    )


def sum_of_squares(pieces: list[Piece], fit: Fit, settings: Settings) -> float:
    """Return the sum of squared residuals in mm² of the pieces that are fitted."""
    return sum(
        float(np.sum(residual_of(piece, fit, number, settings) ** 2))
        for number, piece in enumerate(pieces)
        if piece.fitted
    )


def fit_law(pieces: list[Piece], law: Law, settings: Settings) -> Fit:
    """Minimise the squared residuals under one law, from the best of several initial values."""
    k_starts = [cycles * settings.cycle_s for cycles in _K_STARTS_CYCLES]
    best = min(
        (_initial_fit(pieces, law, k, 1.0, settings) for k in k_starts), key=lambda fit: fit.squares_mm2
    )
    fit = _descend(pieces, best, settings)
    if any((~piece.stop).any() for piece in pieces if piece.fitted):
        others = (_initial_fit(pieces, law, fit.k_s, ratio, settings) for ratio in _RATIO_STARTS)
        better = min(others, key=lambda other: other.squares_mm2)
        if better.squares_mm2 < fit.squares_mm2:
            fit = _descend(pieces, better, settings)
    return judged_starts(pieces, fit, settings)


def _initial_fit(pieces: list[Piece], law: Law, k_s: float, ratio: float, settings: Settings) -> Fit:
    """Return a state whose sections are centred on their motions and then shifted onto the trace."""
    start = np.empty(len(pieces))
    for number, piece in enumerate(pieces):
        profile = piece.profile(k_s, piece.blend_mm(piece.cdis_mm * ratio), law, settings)
        start[number] = piece.middle_s - 0.5 * profile.total_s
    fit = Fit(law, k_s, ratio, start, math.inf)
    for number, piece in enumerate(pieces):
        if piece.fitted:
            fit.start_s[number] += _start_step(piece, fit, number, settings)
    return replace(fit, squares_mm2=sum_of_squares(pieces, fit, settings))


def _start_step(piece: Piece, fit: Fit, number: int, settings: Settings) -> float:
    slope = slope_of(piece, fit, number, 2, settings)
    residual = residual_of(piece, fit, number, settings)
    return float(-(slope @ residual) / max(float(slope @ slope), 1e-30))


def _descend(pieces: list[Piece], fit: Fit, settings: Settings) -> Fit:
    """Gauss-Newton with Levenberg's damping."""
    damping = 0.0
    for _ in range(60):
        normal, gradient = np.zeros((2, 2)), np.zeros(2)
        linears: dict[int, _Linear] = {}
        for number, piece in enumerate(pieces):
            if piece.fitted:
                linear = linears[number] = linearised(piece, fit, number, settings)
                normal += linear.slopes.T @ linear.slopes
                gradient += linear.slopes.T @ linear.residual
        while True:
            tried, step = _stepped(pieces, fit, linears, normal, gradient, damping, settings)
            if tried.squares_mm2 <= fit.squares_mm2:
                damping *= 0.1
                break
            damping = max(10.0 * damping, 1e-3)
            if damping > 1e8:
                return fit
        gained = fit.squares_mm2 - tried.squares_mm2
        fit = tried
        if gained <= 1e-10 * fit.squares_mm2 or np.abs(step).max() < 1e-10:
            break
    return fit


def _stepped(
    pieces: list[Piece],
    fit: Fit,
    linears: dict[int, _Linear],
    normal: Floats,
    gradient: Floats,
    damping: float,
    settings: Settings,
) -> tuple[Fit, Floats]:
    """Return the state after one damped step, and the step in k and the ratio."""
    used = np.diag(normal) > 0.0
    step = np.zeros(2)
    if used.any():
        damped = normal + damping * np.diag(np.diag(normal))
        step[used] = -np.linalg.solve(damped[np.ix_(used, used)], gradient[used])
    k_s = max(fit.k_s + step[0], 1e-3)
    ratio = max(fit.ratio + step[1], 1e-2)
    step = np.array([k_s - fit.k_s, ratio - fit.ratio])
    start = fit.start_s.copy()
    for number, linear in linears.items():
        slope = linear.start_slope
        wanted = linear.raw_residual + linear.raw_slopes @ step
        start[number] -= (slope @ wanted) / max(float(slope @ slope), 1e-30) / (1.0 + damping)
    tried = Fit(fit.law, k_s, ratio, start, 0.0)
    return replace(tried, squares_mm2=sum_of_squares(pieces, tried, settings)), step


def judged_starts(pieces: list[Piece], fit: Fit, settings: Settings) -> Fit:
    """Shift the sections that are not fitted onto the trace."""
    for number, piece in enumerate(pieces):
        if piece.fitted:
            continue
        profile = piece.profile(fit.k_s, piece.blend_mm(piece.cdis_mm * fit.ratio), fit.law, settings)
        fit.start_s[number] = piece.middle_s - 0.5 * profile.total_s
        for _ in range(5):
            fit.start_s[number] += _start_step(piece, fit, number, settings)
    return fit
