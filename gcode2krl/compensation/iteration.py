"""Offline compensation: targets moved against the deflection, so that the bent robot cuts the intended path.

The correction is minus the deflection without its component along the feed (Haehn & Weigold 2020, eq. 10),
here the direction of the intended line. Every quantity is a function of the place along the intended path:
a correction normal to a line does not change that place, so forces, corrections and rounds are compared at
equal places.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gcode2krl import compliance, robot
from gcode2krl import frames as fr
from gcode2krl.arrays import Floats, Ints32, Rows
from gcode2krl.cell import Cell
from gcode2krl.cell.tool_tips import external_starts, motion_starts
from gcode2krl.chain import Plan
from gcode2krl.compensation.correction import SETTLED_MM, Contact, Shift, interpolated, wanted_correction
from gcode2krl.compensation.intended_path import Deviation, Evaluated, Placed, Ways, deviation_from
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.pipeline import plan_motion
from gcode2krl.tables import Deflection, Forces, Motion, Targets, Toolpath

MOST_BAND = 0.5
"""Half-width of the 90 % band over the deflection above which a correction may do more harm than good."""
MOST_CORRECTION_MM = 10.0
"""A larger correction is refused: no robot that cuts bends that far, and lines would lose their shape."""
_MOST_ROUNDS = 15
_DIVIDING_ROUNDS = 3
"""After this many rounds lines are divided no further, so that the targets of two rounds compare row by
row."""


@dataclass(frozen=True)
class Compensated:
    """Targets with the correction in them, and the deviation before and after."""

    targets: Targets
    """The targets to write; a moved line that is no longer straight is several rows of the same ``move``."""
    intended: Targets
    """The same rows without the correction."""
    before: Deviation
    after: Deviation
    evaluated: Evaluated
    """Motion, Joints, Forces and Deflection of ``targets``."""
    figures: dict[str, float]
    issues: tuple[Issue, ...]


def compensate(
    toolpath: Toolpath,
    targets: Targets,
    cell: Cell,
    motion: Motion,
    forces: Forces,
    *,
    tolerance_mm: float = 0.01,
) -> Compensated:
    """Return targets moved by the correction, found in rounds until they change by less than 1 µm.

    Forces stay at their places on the path: right to first order where the correction succeeds, because the
    tool then cuts what was intended. The reach and with it the deflection are those of the moved targets.
    Rapids, approaches and moves in air are not touched.
    Where the correction jumps (contact, a change of engagement) it is ramped with the slope that speed,
    acceleration and approximation allow, at most `MOST_SLOPE`.

    Parameters
    ----------
    targets : those of `pipeline.set_targets`, the path that the tool shall cut.
    motion, forces : those of ``targets``.
    tolerance_mm : how far a line may be from the correction between its ends before it is divided.

    Raises
    ------
    NotUnderstoodError
        Where the tolerance is not positive.
    RefusedError
        Where the deflection is too unsure (see `refuse_unsure`), a correction is larger than
        `MOST_CORRECTION_MM`, the rounds do not settle, a line would run backwards, or the tool turns on the
        spot in material.
    """
    if not (np.isfinite(tolerance_mm) and tolerance_mm > 0.0):
        raise input_error("option-value", f"tolerance {tolerance_mm} mm is not positive", "0.01 is usual")
    ways = Ways.of(toolpath, targets, cell)
    evaluate = _keeping_forces(ways, targets, motion, forces, cell)
    first = evaluate(targets)
    refuse_unsure(first[3], cell)
    contact = Contact.of(ways, first)
    field = before = wanted_correction(ways, first, contact, cell, Shift.none(ways), tolerance_mm, True)
    for rounds in range(1, _MOST_ROUNDS + 1):
        shift = field.shift
        _refuse_large(shift.largest_mm(), targets.source)
        plain, moved = _with_rows(targets, ways, shift, cell)
        evaluated = evaluate(moved)
        divides = rounds < _DIVIDING_ROUNDS
        field = wanted_correction(ways, evaluated, contact, cell, shift, tolerance_mm, divides)
        change_mm = field.shift.change_mm(shift)
        if change_mm <= SETTLED_MM:
            break
    _refuse_backwards(plain, moved)
    _refuse_turns_on_the_spot(targets, ways, shift, motion, forces)
    was = deviation_from(ways, first, before.placed, before.ramped)
    now = deviation_from(ways, evaluated, field.placed, field.ramped)
    issues = (
        *_settled(change_mm, tolerance_mm, targets.source),
        *_remaining(now, tolerance_mm),
        *_new_findings(toolpath, moved, targets, cell),
    )
    figures = {
        "rounds": float(rounds),
        "change_mm": change_mm,
        "rows_added": float(len(moved) - len(targets)),
        "max_correction_mm": shift.largest_mm(),
        "before_max_mm": was.max_mm,
        "before_rms_mm": was.rms_mm,
        "after_max_mm": now.max_mm,
        "after_rms_mm": now.rms_mm,
        "after_steady_max_mm": now.steady_max_mm,
    }
    moved = replace(moved, issues=(*targets.issues, *issues), correction_mm=shift.largest_mm())
    return Compensated(moved, plain, was, now, evaluated, figures, issues)


def refuse_unsure(deflection: Deflection, cell: Cell) -> None:
    """Raise `RefusedError` where the stiffness is not stated, or the band exceeds half the correction.

    The band of measured coefficients is that of cuts which their fit has not seen (`identify force`); that of
    a published set covers the sets of its alloy.
    """
    assumed = compliance.assumed_stiffness(cell)
    if assumed is not None:
        sentence = f"{assumed.message}: a correction by it could make the part worse"
        raise RefusedError(replace(assumed, code="compensation-unsure", message=sentence))
    if deflection.relative_band <= MOST_BAND:
        return
    sentence = (
        f"the deflection is known to ± {deflection.relative_band:.0%} only (90 %), a correction needs "
        f"± {MOST_BAND:.0%}: it could make the part worse"
    )
    remedy = "measure a slot (`gcode2krl identify force`) and the stiffness (`gcode2krl identify stiffness`)"
    raise RefusedError(Issue("error", "compensation-unsure", 0, sentence, remedy))


def refuse_twice(online: bool, both: bool) -> None:
    """Raise `RefusedError` where the online compensation would repeat the correction in the targets."""
    if online and not both:
        sentence = "offline and online compensation together correct the same deflection twice"
        remedy = "choose one; --both where the server knows of the offset, which `online serve` does not"
        raise RefusedError(Issue("error", "compensation-twice", 0, sentence, remedy))


def _keeping_forces(
    ways: Ways, targets: Targets, motion: Motion, forces: Forces, cell: Cell
) -> Callable[[Targets], Evaluated]:
    """Return what evaluates moved targets with the forces of ``targets``, place by place."""
    known = ways.place(motion)
    path_mm, last = known.distinct()
    dt_s = float(motion.time_s[1] - motion.time_s[0]) if len(motion) > 1 else cell.controller.cycle_s

    def evaluate(moved: Targets) -> Evaluated:
        planned = plan_motion(moved, cell, dt_s)
        placed = ways.place(planned, _shift_of(moved, targets, ways))
        joints = robot.follow_motion(planned, cell)
        kept = _forces_at(forces, path_mm, last, placed, planned.tool)
        return planned, joints, kept, compliance.deflect(joints, kept, cell)

    return evaluate


def _shift_of(moved: Targets, targets: Targets, ways: Ways) -> Floats:
    """Return how far (p, 3) the intended targets are moved; of a divided line its last row is the target."""
    lin = np.flatnonzero((moved.move >= 0) & ~moved.ptp)
    last = np.zeros(len(ways.row_of), dtype=np.int64)
    last[moved.move[lin]] = lin
    shift = np.zeros_like(targets.position_mm)
    rows = np.flatnonzero(ways.cuts)
    shift[rows] = moved.position_mm[last[targets.move[rows]]] - targets.position_mm[rows]
    return shift


def _forces_at(forces: Forces, path_mm: Floats, last: Rows, placed: "Placed", tool: Ints32) -> Forces:
    """Return forces at other samples: interpolated vectors, other columns of the nearest; 0 off the lines."""
    rows = np.flatnonzero(placed.row >= 0)
    at_mm = placed.path_mm[rows]
    middle = (path_mm[1:] + path_mm[:-1]) / 2.0
    nearest = last[np.searchsorted(middle, at_mm)] if len(last) else np.zeros(0, dtype=np.int64)
    rows = rows[: len(nearest)]
    columns: dict[str, Any] = {}
    for name in ("force_base_N", "moment_base_Nmm", "peak_N", "torque_Nmm", "a_p_mm", "a_e_mm", "phi_rad"):
        values = getattr(forces, name)
        columns[name] = np.full((len(placed.row), *values.shape[1:]), np.nan if name == "phi_rad" else 0.0)
        columns[name][rows] = values[nearest]
    for name in ("force_base_N", "moment_base_Nmm"):
        if len(rows):
            columns[name][rows] = interpolated(at_mm, path_mm, getattr(forces, name)[last])
    return Forces(**columns, tool=tool, relative_band=forces.relative_band)


def _with_rows(targets: Targets, ways: Ways, shift: Shift, cell: Cell) -> tuple[Targets, Targets]:
    """Return the targets with the lines divided, without and with the shift; events go with their rows."""
    order = np.repeat(np.arange(len(targets)), np.bincount(shift.row, minlength=len(targets)) + 1)
    intended_rows = np.flatnonzero(np.diff(order, append=len(targets)))
    new = np.ones(len(order), dtype=np.bool_)
    new[intended_rows] = False
    copied = ("ptp", "home", "speed_mm_s", "move", "source_line", "tool")
    columns = {name: getattr(targets, name)[order] for name in copied}
    position, moved = targets.position_mm[order], targets.position_mm + shift.target_mm
    rotation, cdis, wait = (getattr(targets, name)[order] for name in ("rotation", "cdis_mm", "wait_s"))
    position[new] = ways.start_mm[shift.row] + shift.along_mm[:, None] * ways.unit[shift.row]
    fraction = shift.along_mm / ways.length_mm[shift.row]
    _, from_rotation = motion_starts(targets, cell, shift.row)
    rotation[new] = fr.slerp(np.asarray(from_rotation), targets.rotation[shift.row], fraction)
    begins, external = external_starts(targets, shift.row), targets.external[order]
    external[new] = begins + fraction[:, None] * (targets.external[shift.row] - begins)
    cdis[new], wait[new] = ways.piece_cdis_mm[shift.row], 0.0
    events = tuple(event._replace(row=int(intended_rows[event.row])) for event in targets.events)
    columns |= {"position_mm": position, "rotation": rotation, "cdis_mm": cdis, "wait_s": wait}
    plain = replace(targets, external=external, events=events, **columns)
    shifted = position.copy()
    shifted[intended_rows], shifted[new] = moved, position[new] + shift.piece_mm
    return plain, replace(plain, position_mm=shifted)


def _refuse_large(largest_mm: float, source: str) -> None:
    if largest_mm <= MOST_CORRECTION_MM:
        return
    sentence = f"a correction of {largest_mm:.1f} mm is more than {MOST_CORRECTION_MM:g} mm"
    remedy = "check stiffness and forces"
    raise RefusedError(Issue("error", "compensation-large", 0, sentence, remedy), source)


def _refuse_backwards(plain: Targets, moved: Targets) -> None:
    """Raise where a line runs backwards once its ends are moved."""
    before, after = (np.diff(each.position_mm, axis=0) for each in (plain, moved))
    is_lin = ~plain.ptp[1:] & (plain.move[1:] >= 0) & (plain.tool[1:] == plain.tool[:-1])
    rows = 1 + np.flatnonzero(is_lin & (np.einsum("ij,ij->i", before, after) < 0.0))
    if not len(rows):
        return
    sentence = "the correction moves the ends of this line farther than it is long: it would run backwards"
    remedy = "let the CAM take longer lines, or take smaller cuts"
    raise RefusedError(
        Issue("error", "compensation-large", int(plain.source_line[rows[0]]), sentence, remedy), plain.source
    )


def _refuse_turns_on_the_spot(
    targets: Targets, ways: Ways, shift: Shift, motion: Motion, forces: Forces
) -> None:
    """Raise where the tool turns without a way in a cut, or moved aside: no correction goes with that."""
    turns = (targets.move >= 0) & ~targets.ptp & (ways.length_mm == 0.0) & ways.turn.any(axis=1)
    loaded = np.isin(targets.move, motion.move[forces.force_base_N.any(axis=1)])
    is_aside = np.append(False, shift.target_mm[:-1].any(axis=1))
    rows = np.flatnonzero(turns & (loaded | is_aside))
    if not len(rows):
        return
    sentence = "the tool turns on the spot in material: the correction changes along a way, and there is none"
    remedy = "turn the tool while it moves, or retract, turn, and enter again"
    raise RefusedError(Issue("error", "axis-turns", int(targets.source_line[rows[0]]), sentence, remedy))


def _settled(change_mm: float, tolerance_mm: float, source: str) -> Iterator[Issue]:
    """Yield a warning for rounds that did not settle; raise where their result is of no use."""
    if change_mm <= SETTLED_MM:
        return
    sentence = f"the targets still change by {change_mm:.4f} mm after {_MOST_ROUNDS} rounds"
    if change_mm > tolerance_mm:
        remedy = "the arm bends differently at every corrected place: take smaller cuts, or move the part"
        raise RefusedError(Issue("error", "compensation-unsettled", 0, sentence, remedy), source)
    yield Issue("warning", "compensation-unsettled", 0, sentence, "compare the residual with your tolerance")


def _remaining(after: Deviation, tolerance_mm: float) -> Iterator[Issue]:
    """Yield a finding where more than the tolerance remains."""
    if after.max_mm <= tolerance_mm:
        return
    size = np.linalg.norm(np.where(after.cuts[:, None], after.offset_mm, 0.0), axis=1)
    yield Issue(
        "note",
        "compensation-rest",
        int(after.source_line[int(size.argmax())]),
        f"the correction leaves up to {after.max_mm:.3f} mm in corners and where it has to be ramped "
        f"(contact, changes of engagement), {after.steady_max_mm:.3f} mm elsewhere",
        "enter and leave the material on a ramp or an arc",
    )


def _new_findings(toolpath: Toolpath, moved: Targets, targets: Targets, cell: Cell) -> Iterator[Issue]:
    """Yield the findings of the robot stage that only the moved targets have."""
    judged = Plan.of(toolpath, replace(moved, issues=()), cell).judged()
    known = {(issue.code, issue.line) for issue in targets.issues}
    yield from (issue for issue in judged.targets.issues if (issue.code, issue.line) not in known)
