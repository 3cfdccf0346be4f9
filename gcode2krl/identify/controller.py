"""Identifies the controller from a trace of the commanded position: k, effective CDIS, the law.

Trace and program are cut at standstills into rest-to-rest sections, matched in order, and the closed forms of
this package are fitted to all of them at once. Unknown are k, the ratio of effective to programmed CDIS, and
for each section the moment it starts at (a nuisance). Gauss-Newton steps with damping; the starts are
projected out of residuals and derivatives (Frisch-Waugh-Lovell), which leaves two unknowns to solve for.

Intervals are valid for independent noise of any variance (White's estimator with leverage correction, HC3,
MacKinnon & White 1985); they do not cover a controller that plans by another law, which shows as residuals
above the noise of the standstills and is reported.

Assumptions: the acceleration is the programmed one and the override 100 %; the model for unequal speeds,
which is an assumption, is compared with the trace but takes no part in the fit. Lines on which the tool turns
take no part either: they give `$VEL.ORI` and `$ACC.ORI` afterwards, see `identify_turning`.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue, RefusedError
from gcode2krl.identify.controller_fit import (
    Fit,
    Law,
    Piece,
    Settings,
    cut_pieces,
    fit_law,
    linearised,
    modelled,
    residual_of,
    slope_of,
)
from gcode2krl.identify.controller_turning import fit_turning
from gcode2krl.identify.estimate import QUANTILE_90, Estimate, around
from gcode2krl.krc4.motion import build_chain
from gcode2krl.krc4.profile import UNLIMITED
from gcode2krl.runs import ControllerTrace, check_scale, resolution_mm
from gcode2krl.tables import Targets
from gcode2krl.units import DEG_PER_RAD, MM_PER_M

LAWS: tuple[Law, Law] = ("averages", "trapezoid")

_DECISIVE = 20.0
"""Twice the difference of log-likelihoods above which the law counts as decided."""
_WIDEST = 0.5
"""A value whose half interval is a larger fraction of it is not determined."""
_FLOOR_MM = 1e-6
_MISFIT = 3.0
_MOST_CORNERS = 200


@dataclass(frozen=True)
class Section:
    """A rest-to-rest piece of the program and of the trace."""

    first_line: int
    last_line: int
    moves: int
    length_mm: float
    speed_mm_s: float
    fitted: bool
    """False where unequal speeds meet: compared only, not fitted."""
    start_s: float
    """Fitted time on the trace's clock at which it starts."""
    time_s: Floats
    position_mm: Floats
    """(m, 3) of the trace."""
    model_mm: Floats
    """(m, 3) of the fitted law."""
    corner_deg: float
    """Sharpest blended interior angle, 180 where there is none."""
    turns: bool = False
    """True where the tool turns during the motion."""

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
    """One approximated corner with its own effective d."""

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
    """The result of the identification."""

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
    """The law that the values belong to: the decided one, else the cell's."""
    acceleration_mm_s2: float
    """Programmed, from the cell."""
    vel_ori_deg_s: Estimate | None
    """None where no line that turns the tool reaches that limit."""
    acc_ori_deg_s2: Estimate | None
    turning_rms_mm: float | None
    """Residuals of the lines on which the tool turns, one axis."""
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


def identify_controller(trace: ControllerTrace, targets: Targets, cell: Cell) -> Identification:
    """Fit k, the effective CDIS and the law to a trace of a program.

    Parameters
    ----------
    trace : commanded positions in ``$BASE``, at any sample times.
    targets : the program that was run, see `gcode2krl.pipeline.set_targets`.
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
    pieces, unmatched = cut_pieces(trace, targets, chain)
    controller = cell.controller
    in_view = UNLIMITED if controller.advance == "unlimited" else int(controller.advance)
    settings = Settings(in_view, controller.cycle_s)
    fits = {law: fit_law(pieces, law, settings) for law in LAWS}
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
    return _result(trace, pieces, unmatched, fit, law, evidence, k_s, ratio, settings, cell)


# --- the result -----------------------------------------------------------------------------------------


def _evidence(fits: dict[Law, Fit], pieces: list[Piece]) -> float:
    """Return twice the log-likelihood ratio of averages over trapezoid, noise unknown."""
    count = sum(piece.position_mm.size for piece in pieces if piece.fitted)
    floor = count * _FLOOR_MM**2
    averages, trapezoid = (fits[law].squares_mm2 + floor for law in LAWS)
    return count * math.log(trapezoid / averages)


def _estimates(fit: Fit, pieces: list[Piece], settings: Settings) -> tuple[Estimate, Estimate]:
    """Return k and the CDIS ratio with 90 % intervals; infinite where the trace does not determine them."""
    linears = [
        linearised(piece, fit, number, settings) for number, piece in enumerate(pieces) if piece.fitted
    ]
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
        half[used] = QUANTILE_90 * np.sqrt(np.diag(covariance))
    return around(fit.k_s, half[0]), around(fit.ratio, half[1])


def _union(first: Estimate, other: Estimate) -> Estimate:
    return Estimate(first.value, min(first.low, other.low), max(first.high, other.high))


def _other(law: Law) -> Law:
    return "trapezoid" if law == "averages" else "averages"


def _determined(estimate: Estimate) -> bool:
    return max(estimate.high - estimate.value, estimate.value - estimate.low) <= _WIDEST * estimate.value


def _require_k(k_s: Estimate, trace: ControllerTrace) -> None:
    if _determined(k_s):
        return
    raise RefusedError(
        Issue(
            "error",
            "not-determined",
            0,
            f"k is not determined: {k_s.value:.3f} s, 90 % interval {k_s.low:.3f} to {k_s.high:.3f} s; "
            "the moves are too slow or too few for this noise",
            "record the program of `gcode2krl make-test controller`",
        ),
        trace.source,
    )


def _result(
    trace: ControllerTrace,
    pieces: list[Piece],
    unmatched: int,
    fit: Fit,
    law: Literal["averages", "trapezoid", "undecided"],
    evidence: float,
    k_s: Estimate,
    ratio: Estimate,
    settings: Settings,
    cell: Cell,
) -> Identification:
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
    vel_ori, acc_ori, turning_rms = _turning(pieces, fit, settings, cell)
    result = Identification(
        k_s=k_s,
        k_cycles=max(1, round(k_s.value / settings.cycle_s)),
        cycle_s=settings.cycle_s,
        cdis_mm=cdis,
        cdis_programmed_mm=float(levels[-1]) if len(levels) else None,
        law=law,
        law_evidence=evidence,
        law_fitted=fit.law,
        acceleration_mm_s2=cell.controller.acc_cp_m_s2 * MM_PER_M,
        vel_ori_deg_s=vel_ori,
        acc_ori_deg_s2=acc_ori,
        turning_rms_mm=turning_rms,
        noise_mm=noise,
        rms_mm=rms,
        max_mm=max(section.max_mm for section, piece in zip(sections, pieces, strict=True) if piece.fitted),
        sections=sections,
        corners=tuple(_corners(pieces, fit, settings)),
        unmatched=unmatched,
        issues=(),
    )
    return replace(result, issues=tuple(_issues(result, trace, levels, sections)))


def _turning(
    pieces: list[Piece], fit: Fit, settings: Settings, cell: Cell
) -> tuple[Estimate | None, Estimate | None, float | None]:
    """Return `$VEL.ORI`, `$ACC.ORI` and the residuals of the lines that turn the tool."""
    controller = cell.controller
    programmed = (controller.vel_ori_deg_s, controller.acc_ori_deg_s2)
    fitted = fit_turning(pieces, fit, programmed, controller.acc_cp_m_s2, settings)
    if fitted is None:
        return None, None, None
    values, errors, rms = fitted
    half = QUANTILE_90 * errors
    vel, acc = (around(float(values[at]), float(half[at])) for at in (0, 1))
    return vel if _determined(vel) else None, acc if _determined(acc) else None, rms


def _section(piece: Piece, fit: Fit, number: int, settings: Settings) -> Section:
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
        model_mm=modelled(piece, start, fit.k_s, piece.cdis_mm * fit.ratio, fit.law, settings),
        corner_deg=2.0 * math.acos(min(1.0, sharpest)) * DEG_PER_RAD,
        turns=bool((piece.angle_rad > 0).any()),
    )


def _noise_at_rest(pieces: list[Piece], resolution: float) -> float:
    """Return the 1-sigma of one axis while the trace stands still, at least that of the rounding."""
    squares, freedom = 0.0, 0
    for piece in pieces:
        edge = int(np.argmin(piece.still))
        for standstill in (
            piece.position_mm[:edge],
            piece.position_mm[len(piece.still) - 1 :: -1][: _tail(piece)],
        ):
            inner = standstill[: max(0, len(standstill) - 2)]  # the last samples may already be moving
            if len(inner) > 1:
                squares += float(np.sum((inner - inner.mean(axis=0)) ** 2))
                freedom += inner.size - 3
    measured = math.sqrt(squares / freedom) if freedom else 0.0
    return max(measured, resolution / math.sqrt(12.0))


def _tail(piece: Piece) -> int:
    return int(np.argmin(piece.still[::-1]))


def _levels(pieces: list[Piece]) -> Floats:
    """Return the programmed CDIS of real corners in the fitted sections, the most frequent last."""
    values = [piece.cdis_mm[(~piece.stop) & (piece.cos_half > 1e-3)] for piece in pieces if piece.fitted]
    level, count = np.unique(np.concatenate(values), return_counts=True)
    return level[np.argsort(count, kind="stable")]


def _corners(pieces: list[Piece], fit: Fit, settings: Settings) -> Iterator[CornerFit]:
    """Yield the corners with their own d: one Gauss-Newton step from the common ratio with fixed k."""
    done = 0
    for number, piece in enumerate(pieces):
        if not piece.fitted:
            continue
        for row in np.flatnonzero((~piece.stop) & (piece.cos_half > 1e-3)).tolist():
            if done == _MOST_CORNERS:
                return
            done += 1
            yield _corner_fit(piece, fit, number, row, settings)


def _corner_fit(piece: Piece, fit: Fit, number: int, row: int, settings: Settings) -> CornerFit:
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
        ends.append(modelled(freed, float(fit.start_s[number]), fit.k_s, other, fit.law, settings))
    slope = ((ends[0] - ends[1]) / (2.0 * step)).ravel()
    start = slope_of(piece, fit, number, 2, settings)
    size = max(float(start @ start), 1e-30)
    slope = slope - start * (start @ slope) / size
    residual = residual_of(piece, fit, number, settings)
    residual = residual - start * (start @ residual) / size
    weight = float(slope @ slope)
    d_fitted, half = d, math.inf
    if weight > 1e-9:
        d_fitted = d - float(slope @ residual) / weight
        unexplained = residual + slope * (d_fitted - d)
        half = QUANTILE_90 * math.sqrt(
            float(unexplained @ unexplained) / max(len(unexplained) - 2, 1) / weight
        )
    share = float(piece.cos_half[row]) / 2.0
    return CornerFit(
        source_line=int(piece.source_line[row]),
        angle_deg=2.0 * math.acos(min(1.0, float(piece.cos_half[row]))) * DEG_PER_RAD,
        speed_mm_s=float(min(piece.speed_mm_s[row], piece.speed_mm_s[row + 1])),
        cdis_mm=float(piece.cdis_mm[row]),
        programmed_d_mm=float(piece.blend_mm(piece.cdis_mm)[row]),
        d_mm=around(d_fitted, half),
        error_mm=around(d_fitted * share, half * share),
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
    yield from _cdis_issues(result, levels)
    limit_mm = _MISFIT * result.noise_mm + _FLOOR_MM
    if result.rms_mm > limit_mm:
        worst = max((section for section in sections if section.fitted), key=lambda section: section.rms_mm)
        yield Issue(
            "warning",
            "law-misfit",
            worst.first_line,
            f"the law leaves {result.rms_mm:.4f} mm rms, the noise is {result.noise_mm:.4f} mm; worst at "
            "this line; the intervals do not cover that",
            "was the override 100 %, and $ACC.CP that of the cell?",
        )
    yield from _turning_issues(result, limit_mm)
    for section in sections:
        if not section.fitted and not section.turns and section.rms_mm > limit_mm:
            yield Issue(
                "note",
                "unequal-speeds",
                section.first_line,
                f"the model for unequal speeds (an assumption) is {section.rms_mm:.4f} mm rms off here",
            )


def _cdis_issues(result: Identification, levels: Floats) -> Iterator[Issue]:
    if result.cdis_mm is None:
        why = "the program has no blended corner" if not len(levels) else _why_no_cdis(result)
        remedy = "record the program of `gcode2krl make-test controller`"
        yield Issue("note", "not-determined", 0, f"cdis is not determined: {why}", remedy)
    elif len(levels) > 1:
        several = ", ".join(f"{level:g}" for level in sorted(levels.tolist()))
        sentence = f"the corners have CDIS {several} mm: one ratio is fitted, stated for {levels[-1]:g} mm"
        yield Issue("note", "several-cdis", 0, sentence)


def _turning_issues(result: Identification, limit_mm: float) -> Iterator[Issue]:
    if result.turning_rms_mm is None:
        return
    if result.turning_rms_mm > limit_mm:
        sentence = f"lines that turn the tool leave (assumed model) {result.turning_rms_mm:.4f} mm rms"
        yield Issue("note", "turning-misfit", 0, sentence)
    if result.vel_ori_deg_s is None:
        sentence = "$VEL.ORI is not determined: no line turns long enough to reach it"
        yield Issue(
            "note", "not-determined", 0, sentence, "lower vel_ori_deg_s in the cell of the test program"
        )


def _why_no_cdis(result: Identification) -> str:
    if all(corner.d_mm.value < corner.cdis_mm * 0.999 for corner in result.corners):
        return "half a line limits every corner"
    return "the corners are too small for this noise"
