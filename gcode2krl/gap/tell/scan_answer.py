"""What scans say of the cutter, put into the answer of the other links."""

from dataclasses import replace

from gcode2krl.gap.beside.links import PART
from gcode2krl.gap.choose.surface import SurfaceFinding
from gcode2krl.gap.tell.result import CauseResult, Gap, GapSize, LinkResult, SignalResult
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.tell


def with_scan(gap: Gap, scan: SurfaceFinding | None) -> Gap:
    """Return the answer with the part link; as it is without scans."""
    if scan is None:
        return gap
    sure = scan.applied is not None and scan.shrink >= _LIMITS.scan_least_shrink
    is_news = scan.applied is not None and scan.effect.name not in {each.effect for each in gap.named_causes}
    causes = [*gap.causes, _cause(scan, sure)] if is_news else gap.causes
    verdict = gap.verdict
    if sure:
        verdict = {"no_gap": "explained", "unexplained": "partly_explained"}.get(verdict, verdict)
    signal = SignalResult(signal=PART.signal, rms=scan.rms_before, noise=scan.noise, significant=sure)
    return replace(
        gap,
        verdict=verdict,
        gap=_size(scan) if sure and gap.verdict == "no_gap" else gap.gap,
        links=(*gap.links, _link(scan, sure)),
        where=replace(gap.where, signals=(*gap.where.signals, signal)),
        causes=tuple(sorted(causes, key=lambda cause: -cause.probability)),
        named=(*gap.named, scan.applied) if sure and is_news and scan.applied is not None else gap.named,
        not_examined=tuple(each for each in gap.not_examined if each.link != PART.name),
    )


def _link(scan: SurfaceFinding, sure: bool) -> LinkResult:
    return LinkResult(
        link=PART.name,
        rms_before=scan.rms_before,
        rms_after=scan.rms_after,
        noise=scan.noise,
        unit=PART.unit,
        verdict="explained" if sure else "no_gap",
    )


def _size(scan: SurfaceFinding) -> GapSize:
    return GapSize(
        signal=PART.signal,
        unit=PART.unit,
        rms_before=scan.rms_before,
        rms_after=scan.rms_after,
        noise_floor=scan.noise,
        shrink=scan.shrink,
        held_out=True,
    )


def _cause(scan: SurfaceFinding, sure: bool) -> CauseResult:
    return CauseResult(
        effect=scan.effect.name,
        target=None,
        link=PART.name,
        probability=_LIMITS.scan_probability if sure else _LIMITS.scan_probability_unsure,
        parameters={scan.effect.names[0]: scan.offset},
        shrink=scan.shrink,
        rms_after=scan.rms_after,
    )
