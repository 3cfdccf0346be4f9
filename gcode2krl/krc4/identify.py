"""What a trace of the commanded position tells about the controller: k, effective CDIS, the law.

Trace and program are cut at standstills into rest-to-rest sections, matched in order, and the closed forms of
this package are fitted to all of them at once. Unknown are k, the ratio of effective to programmed CDIS, and
for each section the moment it starts at (a nuisance). Gauss-Newton steps with damping; the starts are
projected out of residuals and derivatives (Frisch-Waugh-Lovell), so that what is solved for has two unknowns.

Intervals hold for independent noise of any variance (White's estimator with leverage correction, HC3,
MacKinnon & White 1985); they do not cover a controller that plans by another law, which shows as residuals
above the noise of the standstills and is said.

Assumptions: the acceleration is the programmed one and the override 100 %; orientation does not change; the
model for unequal speeds, which is no measurement, is judged by the fit and takes no part in it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gcode2krl.cell import Cell
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.krc4.motion import Chain, build_chain
from gcode2krl.krc4.profile import UNLIMITED, Profile, plan_profile
from gcode2krl.krc4.sampling import sample
from gcode2krl.runs import ControllerTrace, check_scale, program_rests, resolution_mm
from gcode2krl.tables import Targets
from gcode2krl.units import DEG_PER_RAD, MM_PER_M

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Law = Literal["averages", "trapezoid"]
LAWS: tuple[Law, Law] = ("averages", "trapezoid")

LEAST_DWELL_S = 0.15
"""Program: an exact stop with at least this dwell ends a section."""
_LEAST_STILL_S = 0.1
"""Trace: a rest of at least this ends a section; less than the dwell, as noise and tails take some away."""
_QUANTILE_90 = 1.6448536269514722
_DECISIVE = 20.0
"""Twice the difference of log-likelihoods above which a law is taken as decided."""
_WIDEST = 0.5
"""A value whose interval reaches further than this share of it is not determined."""
_K_STARTS_CYCLES = (4, 8, 11, 14, 18, 24)
_RATIO_STARTS = (0.3, 0.6, 1.0, 1.7)
_MARGIN_SAMPLES = 8
_FLOOR_MM = 1e-6
_MISFIT = 3.0
_MOST_CORNERS = 200


@dataclass(frozen=True)
class Estimate:
    """A fitted value and its 90 % interval."""

    value: float
    low: float
    high: float

    def contains(self, value: float) -> bool:
        """Tell whether a value lies within the interval."""
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Section:
    """A rest-to-rest piece of the program and of the trace."""

    first_line: int
    last_line: int
    moves: int
    length_mm: float
    speed_mm_s: float
    fitted: bool
    """False where unequal speeds meet: only judged."""
    start_s: float
    """Fitted time on the trace's clock at which it starts."""
    time_s: Floats
    position_mm: Floats
    """(m, 3) of the trace."""
    model_mm: Floats
    """(m, 3) of the fitted law."""
    corner_deg: float
    """Sharpest blended interior angle, 180 where there is none."""

    @property
    def rms_mm(self) -> float:
        """Root mean square of the residuals of one axis."""
        return float(np.sqrt(np.mean((self.position_mm - self.model_mm) ** 2)))

    @property
    def max_mm(self) -> float:
        """Largest distance between trace and model."""
        return float(np.linalg.norm(self.position_mm - self.model_mm, axis=1).max())


@dataclass(frozen=True)
class CornerFit:
    """One approximated corner, its effective d fitted on its own."""

    source_line: int
    angle_deg: float
    """Interior angle alpha."""
    speed_mm_s: float
    cdis_mm: float
    """Programmed ``$APO.CDIS``."""
    programmed_d_mm: float
    """min(CDIS, L1/2, L2/2)."""
    d_mm: Estimate
    error_mm: Estimate
    """Distance of the vertex to the path, d·cos(alpha/2)/2 (Bigliardi et al. 2022, eq. 1-3)."""


@dataclass(frozen=True)
class Identification:
    """What the trace says."""

    k_s: Estimate
    k_cycles: int
    """k in whole interpolation cycles, the nearest."""
    cycle_s: float
    cdis_mm: Estimate | None
    """Effective ``$APO.CDIS``; None where the trace does not determine it."""
    cdis_programmed_mm: float | None
    law: Literal["averages", "trapezoid", "undecided"]
    law_evidence: float
    """Twice the log-likelihood of ``averages`` over ``trapezoid``."""
    law_fitted: Law
    """The law of the values: the decided one, else the cell's."""
    acceleration_mm_s2: float
    """Programmed, from the cell."""
    noise_mm: float
    """1-sigma of one axis at standstill, rounding included."""
    rms_mm: float
    """Residuals of the fitted sections, one axis, without the standstills."""
    max_mm: float
    sections: tuple[Section, ...]
    corners: tuple[CornerFit, ...]
    unmatched: int
    """Sections of the trace before and after the program: approach, retract."""
    issues: tuple[Issue, ...]

    @property
    def k_whole_s(self) -> float:
        """Return k as whole cycles, in s."""
        return self.k_cycles * self.cycle_s

    @property
    def k_best_s(self) -> float:
        """Return whole cycles where the trace allows them (99.9 %: twice the interval), else the fitted k."""
        half = max(self.k_s.high - self.k_s.value, self.k_s.value - self.k_s.low)
        return self.k_whole_s if abs(self.k_s.value - self.k_whole_s) <= 2.0 * half else self.k_s.value


@dataclass(frozen=True)
class _Settings:
    """What is not fitted."""

    a_mm_s2: float
    moves_in_view: int
    cycle_s: float


@dataclass(frozen=True)
class _Piece:
    """A section while it is fitted: moves of the chain and samples of the trace."""

    start_mm: Floats
    end_mm: Floats
    length_mm: Floats
    speed_mm_s: Floats
    wait_s: Floats
    stop: NDArray[np.bool_]
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
    still: NDArray[np.bool_]
    """(m,) True on samples at rest."""

    def blend_mm(self, cdis_mm: Floats) -> Floats:
        """Return d = min(CDIS, half lines) (n,), 0 at exact stops."""
        return np.where(self.stop, 0.0, np.minimum(cdis_mm, self.half_mm))

    def profile(self, k_s: float, blend_mm: Floats, law: Law, settings: _Settings) -> Profile:
        """Plan the section."""
        return plan_profile(
            self.length_mm, self.speed_mm_s, blend_mm, self.stop, self.wait_s,
            settings.a_mm_s2, k_s, settings.moves_in_view, law == "averages",
        )  # fmt: skip


@dataclass(frozen=True)
class _Fit:
    """A state of the fit under one law."""

    law: Law
    k_s: float
    ratio: float
    """Effective over programmed CDIS."""
    start_s: Floats
    """(s,) start of each section."""
    squares_mm2: float
    """Sum of squared residuals of the fitted sections."""


def identify_controller(trace: ControllerTrace, targets: Targets, cell: Cell) -> Identification:
    """Fit k, the effective CDIS and the law to a trace of a program.

    Parameters
    ----------
    trace : commanded positions in ``$BASE``, at any sample times.
    targets : the program that was run, see `gcode2krl.predict.set_targets`.
    cell : programmed acceleration, interpolation cycle, look-ahead; its law where the trace does not decide.

    Raises
    ------
    NotUnderstoodError
        Where the trace is not one of this program: other sections, unit, ``$BASE``.
    RefusedError
        Where the trace does not determine k.
    """
    chain = build_chain(targets, cell)
    check_scale(trace, targets.position_mm[targets.move >= 0])
    pieces, unmatched = _pieces(trace, targets, chain)
    controller = cell.controller
    in_view = UNLIMITED if controller.advance == "unlimited" else int(controller.advance)
    settings = _Settings(controller.acc_cp_m_s2 * MM_PER_M, in_view, controller.cycle_s)
    fits = {law: _fit(pieces, law, settings) for law in LAWS}
    evidence = _evidence(fits, pieces)
    law: Literal["averages", "trapezoid", "undecided"] = "undecided"
    if abs(evidence) >= _DECISIVE:
        law = "averages" if evidence > 0 else "trapezoid"
    law_fitted: Law = controller.law if law == "undecided" else law
    fit = fits[law_fitted]
    k_s, ratio = _estimates(fit, pieces, settings)
    if law == "undecided":
        k_s = _union(k_s, _estimates(fits[_other(law_fitted)], pieces, settings)[0])
    _require_k(k_s, trace)
    return _result(trace, pieces, unmatched, fit, law, evidence, k_s, ratio, settings)


# --- sections -------------------------------------------------------------------------------------------


def _pieces(trace: ControllerTrace, targets: Targets, chain: Chain) -> tuple[list[_Piece], int]:
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
    ends = np.flatnonzero((chain.blend_mm <= 0.0) & (chain.wait_s >= LEAST_DWELL_S)) + 1
    ends = np.unique(np.append(ends, len(chain.length_mm)))
    starts = np.concatenate([[0], ends[:-1]])
    moved = [float(chain.length_mm[first:end].sum()) > 0 for first, end in zip(starts, ends, strict=True)]
    return [(int(first), int(end)) for first, end, moves in zip(starts, ends, moved, strict=True) if moves]


def _piece(
    trace: ControllerTrace, targets: Targets, chain: Chain, bound: tuple[int, int], before: Ints, after: Ints
) -> _Piece:
    rows = slice(*bound)
    last_still, first_still = int(before[1]), int(after[0])
    low = max(int(before[0]), last_still - _MARGIN_SAMPLES)
    high = min(int(after[1]), first_still + _MARGIN_SAMPLES) + 1
    stop = np.array(chain.blend_mm[rows] <= 0.0)
    stop[-1] = True
    length = np.array(chain.length_mm[rows])
    half = np.append(np.minimum(length[:-1], length[1:]) / 2.0, 0.0)
    speed = np.array(chain.speed_mm_s[rows])
    wait = np.array(chain.wait_s[rows])
    wait[-1] = 0.0
    index = np.arange(low, high)
    target_rows = slice(chain.first + 1 + bound[0], chain.first + 1 + bound[1])
    return _Piece(
        start_mm=np.array(chain.start_mm[rows]),
        end_mm=np.array(chain.end_mm[rows]),
        length_mm=length,
        speed_mm_s=speed,
        wait_s=wait,
        stop=stop,
        cdis_mm=np.array(targets.cdis_mm[target_rows]),
        half_mm=half,
        cos_half=np.array(chain.cos_half[rows]),
        source_line=np.array(chain.source_line[rows], dtype=np.int64),
        fitted=bool((stop[:-1] | (speed[:-1] == speed[1:])).all()) and not targets.ptp[target_rows].any(),
        time_s=np.array(trace.time_s[low:high]),
        position_mm=np.array(trace.position_mm[low:high]),
        middle_s=0.5 * float(trace.time_s[last_still] + trace.time_s[first_still]),
        still=(index <= last_still) | (index >= first_still),
    )


# --- the fit --------------------------------------------------------------------------------------------


def _model(
    piece: _Piece, start_s: float, k_s: float, cdis_mm: Floats, law: Law, settings: _Settings
) -> Floats:
    """Return the positions (m, 3) of a section that starts at ``start_s``."""
    blend = piece.blend_mm(cdis_mm)
    profile = piece.profile(k_s, blend, law, settings)
    return sample(piece.time_s - start_s, profile, piece.start_mm, piece.end_mm, piece.length_mm, blend, k_s)[
        0
    ]


def _residual(piece: _Piece, fit: _Fit, number: int, settings: _Settings) -> Floats:
    """Return model minus trace (3m,)."""
    model = _model(piece, float(fit.start_s[number]), fit.k_s, piece.cdis_mm * fit.ratio, fit.law, settings)
    return (model - piece.position_mm).ravel()


def _slope(piece: _Piece, fit: _Fit, number: int, what: int, settings: _Settings) -> Floats:
    """Return the derivative (3m,) of the model by k (0), the CDIS ratio (1) or the start (2)."""
    step = (1e-5, 1e-4, 1e-5)[what]
    steps = [0.0, 0.0, 0.0]
    ends = []
    for sign in (1.0, -1.0):
        steps[what] = sign * step
        start, cdis = float(fit.start_s[number]) + steps[2], piece.cdis_mm * (fit.ratio + steps[1])
        ends.append(_model(piece, start, fit.k_s + steps[0], cdis, fit.law, settings))
    return ((ends[0] - ends[1]) / (2.0 * step)).ravel()


@dataclass(frozen=True)
class _Linear:
    """A section linearised: what the starts explain is projected out."""

    residual: Floats
    slopes: Floats
    """(3m, 2) by k and the CDIS ratio."""
    start_slope: Floats
    raw_residual: Floats
    raw_slopes: Floats


def _linear(piece: _Piece, fit: _Fit, number: int, settings: _Settings) -> _Linear:
    residual = _residual(piece, fit, number, settings)
    bends = bool((~piece.stop).any())
    by_ratio = _slope(piece, fit, number, 1, settings) if bends else np.zeros_like(residual)
    slopes = np.stack([_slope(piece, fit, number, 0, settings), by_ratio], axis=1)
    start = _slope(piece, fit, number, 2, settings)
    size = max(float(start @ start), 1e-30)
    return _Linear(
        residual=residual - start * (start @ residual) / size,
        slopes=slopes - np.outer(start, start @ slopes) / size,
        start_slope=start,
        raw_residual=residual,
        raw_slopes=slopes,
    )


def _squares(pieces: list[_Piece], fit: _Fit, settings: _Settings) -> float:
    return sum(
        float(np.sum(_residual(piece, fit, number, settings) ** 2))
        for number, piece in enumerate(pieces)
        if piece.fitted
    )


def _fit(pieces: list[_Piece], law: Law, settings: _Settings) -> _Fit:
    """Minimise the squared residuals under one law, from the best of several starts."""
    k_starts = [cycles * settings.cycle_s for cycles in _K_STARTS_CYCLES]
    best = min((_started(pieces, law, k, 1.0, settings) for k in k_starts), key=lambda fit: fit.squares_mm2)
    fit = _descend(pieces, best, settings)
    if any((~piece.stop).any() for piece in pieces if piece.fitted):
        others = (_started(pieces, law, fit.k_s, ratio, settings) for ratio in _RATIO_STARTS)
        better = min(others, key=lambda other: other.squares_mm2)
        if better.squares_mm2 < fit.squares_mm2:
            fit = _descend(pieces, better, settings)
    return _judged_starts(pieces, fit, settings)


def _started(pieces: list[_Piece], law: Law, k_s: float, ratio: float, settings: _Settings) -> _Fit:
    """Return a state whose sections lie in the middle of their motions, then shifted onto the trace."""
    start = np.empty(len(pieces))
    for number, piece in enumerate(pieces):
        profile = piece.profile(k_s, piece.blend_mm(piece.cdis_mm * ratio), law, settings)
        start[number] = piece.middle_s - 0.5 * profile.total_s
    fit = _Fit(law, k_s, ratio, start, math.inf)
    for number, piece in enumerate(pieces):
        if piece.fitted:
            fit.start_s[number] += _start_step(piece, fit, number, settings)
    return replace(fit, squares_mm2=_squares(pieces, fit, settings))


def _start_step(piece: _Piece, fit: _Fit, number: int, settings: _Settings) -> float:
    slope = _slope(piece, fit, number, 2, settings)
    residual = _residual(piece, fit, number, settings)
    return float(-(slope @ residual) / max(float(slope @ slope), 1e-30))


def _descend(pieces: list[_Piece], fit: _Fit, settings: _Settings) -> _Fit:
    """Gauss-Newton with Levenberg's damping."""
    damping = 0.0
    for _ in range(60):
        normal, gradient = np.zeros((2, 2)), np.zeros(2)
        linears: dict[int, _Linear] = {}
        for number, piece in enumerate(pieces):
            if piece.fitted:
                linear = linears[number] = _linear(piece, fit, number, settings)
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
    pieces: list[_Piece], fit: _Fit, linears: dict[int, _Linear], normal: Floats, gradient: Floats,
    damping: float, settings: _Settings,
) -> tuple[_Fit, Floats]:  # fmt: skip
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
    tried = _Fit(fit.law, k_s, ratio, start, 0.0)
    return replace(tried, squares_mm2=_squares(pieces, tried, settings)), step


def _judged_starts(pieces: list[_Piece], fit: _Fit, settings: _Settings) -> _Fit:
    """Shift the sections that are only judged onto the trace."""
    for number, piece in enumerate(pieces):
        if piece.fitted:
            continue
        profile = piece.profile(fit.k_s, piece.blend_mm(piece.cdis_mm * fit.ratio), fit.law, settings)
        fit.start_s[number] = piece.middle_s - 0.5 * profile.total_s
        for _ in range(5):
            fit.start_s[number] += _start_step(piece, fit, number, settings)
    return fit


# --- what it means --------------------------------------------------------------------------------------


def _evidence(fits: dict[Law, _Fit], pieces: list[_Piece]) -> float:
    """Return twice the log-likelihood ratio of averages over trapezoid, noise unknown."""
    count = sum(piece.position_mm.size for piece in pieces if piece.fitted)
    floor = count * _FLOOR_MM**2
    averages, trapezoid = (fits[law].squares_mm2 + floor for law in LAWS)
    return count * math.log(trapezoid / averages)


def _estimates(fit: _Fit, pieces: list[_Piece], settings: _Settings) -> tuple[Estimate, Estimate]:
    """Return k and the CDIS ratio with 90 % intervals; infinite where the trace says nothing."""
    linears = [_linear(piece, fit, number, settings) for number, piece in enumerate(pieces) if piece.fitted]
    slopes = np.concatenate([linear.slopes for linear in linears])
    residual = np.concatenate([linear.residual for linear in linears])
    leverage = np.concatenate(
        [
            linear.start_slope**2 / max(float(linear.start_slope @ linear.start_slope), 1e-30)
            for linear in linears
        ]
    )
    normal = slopes.T @ slopes
    used = np.diag(normal) > 1e-12 * len(residual)
    half = np.full(2, math.inf)
    if used.any():
        inverse = np.linalg.inv(normal[np.ix_(used, used)])
        kept = slopes[:, used]
        leverage = leverage + np.einsum("ij,jk,ik->i", kept, inverse, kept)
        weight = (residual / np.maximum(1.0 - leverage, 0.1)) ** 2
        covariance = inverse @ (kept.T * weight @ kept) @ inverse
        half[used] = _QUANTILE_90 * np.sqrt(np.diag(covariance))
    return _around(fit.k_s, half[0]), _around(fit.ratio, half[1])


def _around(value: float, half: float) -> Estimate:
    return Estimate(float(value), float(value - half), float(value + half))


def _union(own: Estimate, other: Estimate) -> Estimate:
    return Estimate(own.value, min(own.low, other.low), max(own.high, other.high))


def _other(law: Law) -> Law:
    return "trapezoid" if law == "averages" else "averages"


def _determined(estimate: Estimate) -> bool:
    return max(estimate.high - estimate.value, estimate.value - estimate.low) <= _WIDEST * estimate.value


def _require_k(k_s: Estimate, trace: ControllerTrace) -> None:
    if _determined(k_s):
        return
    raise RefusedError(
        Issue("error", "not-determined", 0,
              f"k is not determined: {k_s.value:.3f} s, 90 % interval {k_s.low:.3f} to {k_s.high:.3f} s; "
              "the moves are too slow or too few for this noise",
              "record the program of `gcode2krl make-test controller`"),
        trace.source,
    )  # fmt: skip


def _result(
    trace: ControllerTrace, pieces: list[_Piece], unmatched: int, fit: _Fit,
    law: Literal["averages", "trapezoid", "undecided"], evidence: float, k_s: Estimate, ratio: Estimate,
    settings: _Settings,
) -> Identification:  # fmt: skip
    sections = tuple(_section(piece, fit, number, settings) for number, piece in enumerate(pieces))
    noise = _noise_at_rest(pieces, resolution_mm(trace.position_mm))
    moving = np.concatenate(
        [
            (section.position_mm - section.model_mm)[~piece.still]
            for section, piece in zip(sections, pieces, strict=True)
            if piece.fitted
        ]
    )
    rms = float(np.sqrt(np.mean(moving**2))) if len(moving) else 0.0
    levels = _levels(pieces)
    cdis = None
    if len(levels) and _determined(ratio):
        cdis = Estimate(*(float(levels[-1] * value) for value in (ratio.value, ratio.low, ratio.high)))
    result = Identification(
        k_s=k_s,
        k_cycles=max(1, round(k_s.value / settings.cycle_s)),
        cycle_s=settings.cycle_s,
        cdis_mm=cdis,
        cdis_programmed_mm=float(levels[-1]) if len(levels) else None,
        law=law,
        law_evidence=evidence,
        law_fitted=fit.law,
        acceleration_mm_s2=settings.a_mm_s2,
        noise_mm=noise,
        rms_mm=rms,
        max_mm=max(section.max_mm for section, piece in zip(sections, pieces, strict=True) if piece.fitted),
        sections=sections,
        corners=tuple(_corners(pieces, fit, settings)),
        unmatched=unmatched,
        issues=(),
    )
    return replace(result, issues=tuple(_issues(result, trace, levels, sections)))


def _section(piece: _Piece, fit: _Fit, number: int, settings: _Settings) -> Section:
    start = float(fit.start_s[number])
    blended = ~piece.stop
    sharpest = float(piece.cos_half[blended].max()) if blended.any() else 0.0
    return Section(
        first_line=int(piece.source_line[0]),
        last_line=int(piece.source_line[-1]),
        moves=len(piece.length_mm),
        length_mm=float(piece.length_mm.sum()),
        speed_mm_s=float(piece.speed_mm_s.max()),
        fitted=piece.fitted,
        start_s=start,
        time_s=piece.time_s,
        position_mm=piece.position_mm,
        model_mm=_model(piece, start, fit.k_s, piece.cdis_mm * fit.ratio, fit.law, settings),
        corner_deg=2.0 * math.acos(min(1.0, sharpest)) * DEG_PER_RAD,
    )


def _noise_at_rest(pieces: list[_Piece], resolution: float) -> float:
    """Return the 1-sigma of one axis while the trace stands still, at least that of the rounding."""
    squares, freedom = 0.0, 0
    for piece in pieces:
        edge = int(np.argmin(piece.still))
        for rest in (piece.position_mm[:edge], piece.position_mm[len(piece.still) - 1 :: -1][: _tail(piece)]):
            inner = rest[: max(0, len(rest) - 2)]  # the last ones may already be on their way
            if len(inner) > 1:
                squares += float(np.sum((inner - inner.mean(axis=0)) ** 2))
                freedom += inner.size - 3
    measured = math.sqrt(squares / freedom) if freedom else 0.0
    return max(measured, resolution / math.sqrt(12.0))


def _tail(piece: _Piece) -> int:
    return int(np.argmin(piece.still[::-1]))


def _levels(pieces: list[_Piece]) -> Floats:
    """Return the programmed CDIS of real corners in the fitted sections, the most frequent last."""
    values = [piece.cdis_mm[(~piece.stop) & (piece.cos_half > 1e-3)] for piece in pieces if piece.fitted]
    level, count = np.unique(np.concatenate(values), return_counts=True)
    return level[np.argsort(count, kind="stable")]


def _corners(pieces: list[_Piece], fit: _Fit, settings: _Settings) -> Iterator[CornerFit]:
    """Yield the corners with their own d: one Gauss-Newton step from the common ratio, k held."""
    done = 0
    for number, piece in enumerate(pieces):
        if not piece.fitted:
            continue
        for row in np.flatnonzero((~piece.stop) & (piece.cos_half > 1e-3)).tolist():
            if done == _MOST_CORNERS:
                return
            done += 1
            yield _corner_fit(piece, fit, number, row, settings)


def _corner_fit(piece: _Piece, fit: _Fit, number: int, row: int, settings: _Settings) -> CornerFit:
    cdis = piece.cdis_mm * fit.ratio
    d = float(piece.blend_mm(cdis)[row])
    step = 1e-4 * d
    ends = []
    for sign in (1.0, -1.0):
        other = cdis.copy()
        other[row] = d + sign * step
        halves = piece.half_mm.copy()
        halves[row] = max(halves[row], other[row])
        freed = replace(piece, half_mm=halves)
        ends.append(_model(freed, float(fit.start_s[number]), fit.k_s, other, fit.law, settings))
    slope = ((ends[0] - ends[1]) / (2.0 * step)).ravel()
    start = _slope(piece, fit, number, 2, settings)
    size = max(float(start @ start), 1e-30)
    slope = slope - start * (start @ slope) / size
    residual = _residual(piece, fit, number, settings)
    residual = residual - start * (start @ residual) / size
    weight = float(slope @ slope)
    own, half = d, math.inf
    if weight > 1e-9:
        own = d - float(slope @ residual) / weight
        left = residual + slope * (own - d)
        half = _QUANTILE_90 * math.sqrt(float(left @ left) / max(len(left) - 2, 1) / weight)
    share = float(piece.cos_half[row]) / 2.0
    return CornerFit(
        source_line=int(piece.source_line[row]),
        angle_deg=2.0 * math.acos(min(1.0, float(piece.cos_half[row]))) * DEG_PER_RAD,
        speed_mm_s=float(min(piece.speed_mm_s[row], piece.speed_mm_s[row + 1])),
        cdis_mm=float(piece.cdis_mm[row]),
        programmed_d_mm=float(piece.blend_mm(piece.cdis_mm)[row]),
        d_mm=_around(own, half),
        error_mm=_around(own * share, half * share),
    )


def _issues(
    result: Identification, trace: ControllerTrace, levels: Floats, sections: tuple[Section, ...]
) -> Iterator[Issue]:
    if trace.dropped:
        yield Issue("note", "rows-dropped", 0, f"{trace.dropped} rows with a missing value were left out")
    if result.unmatched:
        sentence = f"{result.unmatched} sections of the trace lie before or after the program"
        yield Issue("note", "sections-outside", 0, sentence, "approach and retract; nothing to do")
    if result.law == "undecided":
        sentence = "law undecided: both predict this trace within its noise"
        remedy = "short fast moves decide: record the program of `gcode2krl make-test controller`"
        yield Issue("note", "law-undecided", 0, sentence, remedy)
    if result.cdis_mm is None:
        why = "the program has no blended corner" if not len(levels) else _why_no_cdis(result)
        remedy = "record the program of `gcode2krl make-test controller`"
        yield Issue("note", "not-determined", 0, f"cdis is not determined: {why}", remedy)
    elif len(levels) > 1:
        several = ", ".join(f"{level:g}" for level in sorted(levels.tolist()))
        sentence = f"the corners have CDIS {several} mm: one ratio is fitted, stated for {levels[-1]:g} mm"
        yield Issue("note", "several-cdis", 0, sentence)
    limit = _MISFIT * result.noise_mm
    if result.rms_mm > limit + _FLOOR_MM:
        worst = max((section for section in sections if section.fitted), key=lambda section: section.rms_mm)
        yield Issue(
            "warning", "law-misfit", worst.first_line,
            f"the law leaves {result.rms_mm:.4f} mm rms, the noise is {result.noise_mm:.4f} mm; worst at "
            "this line; the intervals do not cover that",
            "was the override 100 %, and $ACC.CP that of the cell?",
        )  # fmt: skip
    for section in sections:
        if not section.fitted and section.rms_mm > limit + _FLOOR_MM:
            yield Issue(
                "note", "unequal-speeds", section.first_line,
                f"the model for unequal speeds (an assumption) is {section.rms_mm:.4f} mm rms off here",
            )  # fmt: skip


def _why_no_cdis(result: Identification) -> str:
    if all(corner.d_mm.value < corner.cdis_mm * 0.999 for corner in result.corners):
        return "half a line limits every corner"
    return "the corners are too small for this noise"
