"""What scans say, put into the answer of the other links."""

from dataclasses import replace
from typing import Any

from gcode2krl.gap.beside.links import PART
from gcode2krl.gap.choose.surface import SurfaceFinding
from gcode2krl.gap.tell.result import Gap

_SURE, _UNSURE = 0.95, 0.4
_LEAST_BROUGHT = 0.4
"""A diameter that takes less of the scan's gap on points that it was not fitted to is not named."""


def with_scan(gap: Gap, scan: SurfaceFinding | None) -> Gap:
    """Return the answer with the part link; as it is without scans."""
    if scan is None:
        return gap
    sure = scan.applied is not None and scan.shrink >= _LEAST_BROUGHT
    known = scan is not None and any(cause["effect"] == scan.effect.name for cause in gap.named_causes)
    causes = list(gap.causes)
    if scan.applied is not None and not known:
        causes.append(_cause(scan, _SURE if sure else _UNSURE))
        causes.sort(key=lambda cause: -cause["probability"])
    named = (*gap.named, scan.applied) if sure and not known and scan.applied is not None else gap.named
    verdict = gap.verdict
    if sure:
        verdict = {"no_gap": "explained", "unexplained": "partly_explained"}.get(verdict, verdict)
    row = {
        "link": PART.name, "rms_before": scan.rms_before, "rms_after": scan.rms_after, "noise": scan.noise,
        "unit": PART.unit, "verdict": "explained" if sure else "no_gap",
    }  # fmt: skip
    signal = {
        "signal": PART.signal, "rms": scan.rms_before, "noise": scan.noise, "significant": sure
    }  # fmt: skip
    return replace(
        gap,
        verdict=verdict,
        gap=_size(scan) if sure and gap.verdict == "no_gap" else gap.gap,
        links=[*gap.links, row],
        where={**gap.where, "signals": [*gap.where["signals"], signal]},
        causes=causes,
        named=named,
        not_examined=[each for each in gap.not_examined if each["link"] != PART.name],
    )


def _size(scan: SurfaceFinding) -> dict[str, Any]:
    return {
        "signal": PART.signal, "unit": PART.unit, "rms_before": scan.rms_before,
        "rms_after": scan.rms_after, "noise_floor": scan.noise, "max_before": None, "max_after": None,
        "shrink": scan.shrink, "held_out": True,
    }  # fmt: skip


def _cause(scan: SurfaceFinding, probability: float) -> dict[str, Any]:
    return {
        "effect": scan.effect.name, "target": None, "link": PART.name, "probability": probability,
        "parameters": {scan.effect.names[0]: scan.offset._asdict()}, "shrink": scan.shrink,
        "rms_after": scan.rms_after, "indistinguishable_from": [],
    }  # fmt: skip
