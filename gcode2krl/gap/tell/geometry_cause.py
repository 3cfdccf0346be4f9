"""The answer where the arm's own geometry is at work: one cause with its parts, and what is beside it."""

from dataclasses import replace

from gcode2krl.gap.beside.links import MECHANICS
from gcode2krl.gap.choose.arm_geometry import ArmGeometry
from gcode2krl.gap.choose.intervals import Interval
from gcode2krl.gap.tell.result import AtPart, CauseResult, Gap
from gcode2krl.gap.thresholds import THRESHOLDS

GEOMETRY = "geometry"


def with_geometry(gap: Gap, rest: Gap, found: ArmGeometry) -> Gap:
    """Return an answer with geometry as its first cause; ``rest`` is the answer to the runs without it."""
    noise = next((link.floor for link in rest.links if link.link == MECHANICS.name), None)
    shrink = _shrink(found, noise or 0.0)
    parts = {
        f"{part.name.replace(' ', '_')}_{part.unit}": Interval(
            part.estimate.value, part.estimate.low, part.estimate.high
        )
        for part in found.fit.told
    }
    cause = CauseResult(
        effect=GEOMETRY,
        target=None,
        link=MECHANICS.name,
        probability=THRESHOLDS.tell.geometry_probability,
        parameters=parts,
        shrink=shrink,
        rms_after=found.after_mm,
    )
    verdict = "explained" if rest.verdict == "no_gap" else "partly_explained"
    before, after = found.before_mm, found.after_mm
    size = replace(gap.gap, rms_before=before, rms_after=after, shrink=shrink, held_out=True)
    at_part = AtPart(
        what="tip", unit="mm", rms_before=before, rms_after=after, noise=None, link=MECHANICS.name
    )
    return replace(
        gap,
        verdict=verdict,
        gap=replace(size, max_after=rest.gap.max_after),
        at_part=at_part,
        links=tuple(
            replace(link, rms_before=before, rms_after=after, verdict=verdict)
            if link.link == MECHANICS.name
            else link
            for link in rest.links
        ),
        causes=(cause, *rest.causes),
        unexplained=rest.unexplained,
        next_run=rest.next_run,
        named=rest.named,
        issues=rest.issues,
        notes=(*rest.notes, *_notes(found)),
        observable=rest.observable,
    )


def _shrink(found: ArmGeometry, noise_mm: float) -> float:
    """Return the share of the gap beyond noise that is gone at places left out."""
    gap = found.before_mm**2 - noise_mm**2
    gone = 1.0 - max(found.after_mm**2 - noise_mm**2, 0.0) / gap if gap > 0.0 else 1.0
    return min(max(gone, 0.0), 1.0)


def _notes(found: ArmGeometry) -> list[str]:
    fit = found.fit
    notes = [
        f"geometry: {len(fit.told)} small numbers of the arm, {found.before_mm:.3f} -> "
        f"{found.after_mm:.3f} mm at places left out of the fit; `gcode2krl identify kinematics` has each "
        "with its interval"
    ]
    if fit.is_outlier.any():
        notes.append(f"geometry: {int(fit.is_outlier.sum())} poses are far off and no part of the fit")
    return notes
