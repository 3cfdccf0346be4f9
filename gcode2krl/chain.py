"""The one chain from a Toolpath to what a program and a prediction are made of.

`prepare` makes a `Plan`: what the robot will be told, and all that is known before it moves. A
`PlannedMotion` is the motion of a plan, whose samples pass joints, cutting and compliance in blocks.
`collect` keeps every sample and returns a Prediction; `foresee` keeps what a program and its summary need:
a Forecast.
"""

import hashlib
import itertools
from collections.abc import Generator, Iterable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gcode2krl import krc4, program, robot
from gcode2krl.arrays import Floats
from gcode2krl.blockwise import (
    Block,
    Loads,
    Outcome,
    PilotSamples,
    Samples,
    blocks_with,
    blocks_with_joints,
    plan_course,
)
from gcode2krl.cell import Cell
from gcode2krl.cell.confirmation import future_confirmation
from gcode2krl.clearance import Beside, collisions_beside, ways_beside
from gcode2krl.errors import Issue, input_error
from gcode2krl.pose import posed_targets
from gcode2krl.prediction import Prediction
from gcode2krl.prediction.forecast import Forecast, LargestLoads, load_figures
from gcode2krl.progress import Begin, Progress, unseen
from gcode2krl.tables import Deflection, Forces, Gathered, Joints, Targets, Toolpath
from gcode2krl.version import __version__


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """What the robot will be told, and what is known of it before it moves."""

    toolpath: Toolpath
    cell: Cell
    targets: Targets
    joints: Joints
    """At the targets (``sigma_min`` NaN); ``issues`` are the findings on reach, limits and singularities."""
    ways: tuple[Beside, ...]
    """The ways that a Motion does not show."""

    @classmethod
    def of(cls, toolpath: Toolpath, targets: Targets, cell: Cell) -> "Plan":
        """Return the plan of targets as they are, nothing added to their findings."""
        joints, issues = robot.follow(targets, cell, conditioning=False)
        ways = tuple(ways_beside(targets, joints.q_rad, cell))
        return cls(toolpath, cell, targets, replace(joints, issues=issues), ways)

    def judged(self) -> "Plan":
        """Return the plan whose targets have the findings on reach, limits, singularities and table too.

        Among them are the collisions on the motions that a Motion does not show (`clearance`).
        """
        targets, cell = self.targets, self.cell
        issues = (*self.joints.issues, *collisions_beside(self.ways, targets, cell))
        of_targets = (*targets.issues, *program.below_table(targets, cell), *issues)
        return replace(
            self, targets=replace(targets, issues=of_targets), joints=replace(self.joints, issues=issues)
        )

    def with_corners(self, tolerance_mm: float | None) -> tuple["Plan", float]:
        """Return the plan with findings on corners and confirmation, and the largest corner error (mm)."""
        errors_mm, issues = corner_errors(self.toolpath, self.targets, self.cell, tolerance_mm)
        issues = (*self.targets.issues, *issues, *future_confirmation(self.cell))
        return replace(self, targets=replace(self.targets, issues=issues)), float(errors_mm.max(initial=0.0))


def prepare(
    toolpath: Toolpath, cell: Cell, tolerance_mm: float | None = None, simplify_mm: float | None = None
) -> Plan:
    """Return the plan of a Toolpath; options and errors are those of `pipeline.set_targets`."""
    if tolerance_mm is not None and not (np.isfinite(tolerance_mm) and tolerance_mm > 0):
        raise input_error("option-value", f"tolerance {tolerance_mm} mm is not positive")
    program.require_geometry(toolpath, cell)
    targets = posed_targets(toolpath, cell, tolerance_mm)
    if simplify_mm is not None:
        targets = _simplified(targets, toolpath, cell, simplify_mm, tolerance_mm)
    if cell.controller.spline:
        targets = program.with_stops(targets, cell.controller.circ)
    warnings = program.doubtful(toolpath, cell, tolerance_mm)
    tilts = program.tilt_issues(targets, toolpath, cell)
    targets = replace(targets, issues=(*targets.issues, *warnings, *tilts))
    return Plan.of(toolpath, targets, cell).judged()


def _simplified(
    whole: Targets, toolpath: Toolpath, cell: Cell, simplify_mm: float, tolerance_mm: float | None
) -> Targets:
    """Return targets with feed moves merged, and a note on what that gains."""
    fewer = program.merged(whole, toolpath, cell, simplify_mm, tolerance_mm)
    if fewer.simplified is None:
        raise AssertionError("merged targets say what was merged")
    before_s, after_s = (krc4.plan(krc4.build_chain(each, cell), cell).total_s for each in (whole, fewer))
    note = program.merging_note(fewer.simplified, before_s, after_s, cell.controller.law)
    return replace(fewer, issues=(*fewer.issues, note))


def corner_errors(
    toolpath: Toolpath, targets: Targets, cell: Cell, tolerance_mm: float | None = None
) -> tuple[Floats, tuple[Issue, ...]]:
    """Return the corner error (n,) in mm at the end of each move, and where a tolerance is not kept.

    A tolerance is asked for by ``G64 P``, by ``tolerance_mm`` or by the cell, in this order; ``G64 P`` does
    not apply to motions that are added (approach, retract).
    """
    chain = krc4.build_chain(targets, cell)
    error_mm = chain.corner_error_mm()
    move = targets.move[chain.first + 1 : chain.first + 1 + len(error_mm)]
    allowed = program.asked_tolerance(toolpath, move, cell, tolerance_mm)
    beyond = np.flatnonzero(error_mm > allowed * (1.0 + 1e-9))
    findings = tuple(
        Issue(
            "error",
            "corner-tolerance",
            int(chain.source_line[row]),
            f"the corner is {error_mm[row]:.4f} mm off, {allowed[row]:g} mm were asked for",
            "lower the tolerance",
        )
        for row in beyond[:20]
    )
    return error_mm, findings


class PlannedMotion:
    """The motion of a plan, planned; its samples then pass cutting and compliance in blocks."""

    def __init__(self, plan: Plan, dt_s: float, *, keeps: bool) -> None:
        """Plan the motion, sampled every ``dt_s``; ``keeps`` as in `blockwise.plan_course`."""
        self.plan, self.motion = plan, plan_course(plan.targets, plan.cell, dt_s, keeps=keeps)
        self.outcome = Outcome(None, None, ())
        """What was found of the forces, once all blocks have been taken."""

    def blocks(
        self, samples: Iterable[Samples], tell: Progress, *, has_peaks: bool
    ) -> Generator[Block, None, None]:
        """Yield samples with forces and deflection; whoever takes them closes this, see `Loads.along`."""
        plan, course = self.plan, self.motion.course
        loads = Loads(
            plan.toolpath, plan.cell, self.motion.outlook, course.dt_s, has_peaks=has_peaks, ways=plan.ways
        )
        with closing(loads.along(samples)) as blocks:
            for block in blocks:
                yield block
                tell(loads.count, course.count)
        self.outcome = loads.outcome()


def collect(
    plan: Plan,
    dt_s: float | None = None,
    *,
    forces: bool = True,
    settings: dict[str, Any] | None = None,
    begin: Begin = unseen,
) -> Prediction:
    """Return the prediction of a plan: every sample of its motion, with ``forces`` those too.

    ``settings`` are kept among its inputs. Raises `NotUnderstoodError` where ``dt_s`` is not positive, or the
    stock that the cell names cannot be read.
    """
    cell, targets = plan.cell, plan.targets
    dt_s = cell.controller.cycle_s if dt_s is None else dt_s
    begin("motion")
    run = PlannedMotion(plan, dt_s, keeps=True)
    begin("joints")
    kept = run.motion.samples()
    motion, joints = kept.motion, kept.joints(cell)
    cut: Forces | None = None
    bent: Deflection | None = None
    if forces:
        all_forces, all_bent = Gathered[Forces](len(motion)), Gathered[Deflection](len(motion))
        tell = begin("material, forces, deflection")
        with closing(run.blocks(blocks_with(joints, motion), tell, has_peaks=True)) as blocks:
            for block in blocks:
                all_forces.take(block.forces)
                if block.deflection is not None:
                    all_bent.take(block.deflection)
        if run.outcome.force_issues is not None:
            cut = replace(all_forces.table(), issues=run.outcome.force_issues)
        if run.outcome.deflection_issues is not None:
            bent = replace(all_bent.table(), issues=run.outcome.deflection_issues)
    inputs = _inputs(plan, dt_s, settings or {})
    skipped = run.outcome.skipped
    return Prediction(
        plan.toolpath, targets, cell, motion, joints, inputs, cut, bent, skipped, clearance=kept.clearance
    )


def _inputs(plan: Plan, dt_s: float, settings: dict[str, Any]) -> dict[str, Any]:
    """Return what a prediction says that it was made from."""
    source, simplified = Path(plan.toolpath.source), plan.targets.simplified
    inputs = {"program": plan.toolpath.source, "version": __version__, "dt_s": dt_s, **settings}
    if simplified is not None:
        inputs["simplify_mm"] = simplified.tolerance_mm
    if source.is_file():
        content = source.read_bytes()
        inputs["program_sha256"] = hashlib.sha256(content).hexdigest()
        inputs["program_size_bytes"] = len(content)
    return inputs


def foresee(plan: Plan, *, forces: bool = True, begin: Begin = unseen) -> Forecast:
    """Return what a program needs of a plan's prediction at the controller's cycle.

    Of the samples no more is kept than the joints, until they are cut.
    """
    begin("motion and joints")
    run = PlannedMotion(plan, plan.cell.controller.cycle_s, keeps=False)
    course, figures = run.motion.course, LargestLoads()
    samples = PilotSamples(plan.cell, course.count)
    if forces:
        tell = begin("material, forces, deflection")
        with closing(run.blocks(blocks_with_joints(run.motion, plan.cell), tell, has_peaks=False)) as blocks:
            for block in blocks:
                figures.take(block.forces, block.deflection, block.q_rad)
                samples.take(block.motion, block.line, block.forces, block.deflection)
    outcome = run.outcome
    known, bends = outcome.force_issues is not None, outcome.deflection_issues is not None
    groups = (outcome.force_issues or (), outcome.deflection_issues or (), outcome.skipped)
    last = course.at(np.array([course.count - 1]))
    return Forecast(
        toolpath=plan.toolpath,
        targets=plan.targets,
        cell=plan.cell,
        issues=(*plan.targets.issues, *run.motion.issues, *itertools.chain.from_iterable(groups)),
        time_s=float(last.time_s[0]),
        path_mm=float(last.path_mm[0]),
        loads=figures.figures(with_deflection=bends) if known else None,
        pilot=samples.force(with_deflection=bends) if known else None,
    )


def forecast_of(prediction: Prediction) -> Forecast:
    """Return what a program needs of a prediction."""
    motion, forces, deflection = prediction.motion, prediction.forces, prediction.deflection
    pilot, loads = None, None
    if motion is not None and forces is not None:
        samples = PilotSamples(prediction.cell, len(motion))
        line = prediction.toolpath.source_line[motion.move]
        samples.take(motion, line, forces, deflection)
        loads = load_figures(forces, deflection, prediction.joints.q_rad if prediction.joints else None)
        pilot = samples.force(with_deflection=deflection is not None)
    return Forecast(
        toolpath=prediction.toolpath,
        targets=prediction.targets,
        cell=prediction.cell,
        issues=prediction.issues,
        time_s=float(motion.time_s[-1]) if motion is not None else np.nan,
        path_mm=float(motion.path_mm[-1]) if motion is not None else np.nan,
        loads=loads,
        pilot=pilot,
    )
