"""The pipeline, and whatever needs two stages: targets with their spin search, joints of targets."""

import hashlib
import io
import itertools
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from gcode2krl import cutting, gcode, krc4, program, robot
from gcode2krl.arrays import Floats
from gcode2krl.blockwise import Loads, Outcome, PilotSamples, blocks_with, blocks_with_joints, plan_course
from gcode2krl.cell import Cell, load_cell
from gcode2krl.cell.confirmation import future_confirmation
from gcode2krl.clearance import Beside, collisions_beside, ways_beside
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.errors import Issue, input_error
from gcode2krl.identify import trial_program
from gcode2krl.prediction import Prediction
from gcode2krl.prediction.forecast import Forecast, LargestLoads, load_figures
from gcode2krl.progress import Begin, Progress, unheard, unseen
from gcode2krl.redundancy import posed_targets
from gcode2krl.tables import (
    Clearance,
    Deflection,
    Forces,
    Gathered,
    Joints,
    Motion,
    Targets,
    Toolpath,
    blocks_of,
)
from gcode2krl.version import __version__

if TYPE_CHECKING:
    from gcode2krl.effects import Applied

_PTP_KNOWN: WeakKeyDictionary[Targets, tuple[Any, ...]] = WeakKeyDictionary()
_WAYS_KNOWN: WeakKeyDictionary[Targets, tuple[Cell, tuple[Beside, ...]]] = WeakKeyDictionary()
_ANGLES_KNOWN: WeakKeyDictionary[Motion, tuple[Cell, Floats, Floats]] = WeakKeyDictionary()
_CLEARANCE_KNOWN: WeakKeyDictionary[Motion, Clearance] = WeakKeyDictionary()


def predict(
    part: str | Path,
    cell: Cell | None = None,
    *,
    dt_s: float | None = None,
    tolerance_mm: float | None = None,
    simplify_mm: float | None = None,
    chord_tolerance_mm: float = gcode.CHORD_TOLERANCE_MM,
    block_delete: bool = False,
    dialect: str = gcode.DEFAULT_DIALECT,
    search: Sequence[str | Path] = (),
    forces: bool = True,
    effects: "Sequence[str | Applied]" = (),
    effect_folders: Sequence[str | Path] = (),
) -> Prediction:
    """Run every stage on a part: G-code, targets, motion, joints, forces, deflection.

    ``dt_s`` is the sample time, by default the controller's cycle; ``simplify_mm`` merges feed moves, see
    `set_targets`; ``search`` are folders with subprograms. ``forces`` False leaves out material removal and
    what depends on it. A stage that cannot run (no material, unknown stiffness) leaves None and a note.
    ``effects`` such as ``backlash:target=A2,gap_deg=0.02`` are added to those of the cell;
    ``effect_folders`` are folders with the user's own effects. Raises `NotUnderstoodError` where the G-code,
    the cell or an option is wrong; what a program must not do is in the prediction's ``issues``.

    The worst second of every tool:

    >>> from gcode2krl import load_cell, predict
    >>> samples = predict("part.nc", load_cell("cell.toml")).samples().to_pandas()
    >>> samples["second"] = samples["time_s"].astype(int)
    >>> worst = samples.groupby(["tool", "second"])["force_N"].max().groupby("tool").idxmax()
    >>> list(worst.index)
    [1]

    With an effect that the nominal model leaves out, its columns stand beside the nominal ones:

    >>> loose = predict("part.nc", effects=["backlash:target=A2,gap_deg=0.02"])
    >>> sorted(loose.added)[:2]
    ['force_meas_x_N', 'force_meas_y_N']
    """
    cell = cell if cell is not None else load_cell()
    toolpath = gcode.read_gcode(
        part,
        cell,
        dialect=dialect,
        chord_tolerance_mm=chord_tolerance_mm,
        block_delete=block_delete,
        search=search,
    )
    settings: dict[str, Any] = {
        "chord_tolerance_mm": chord_tolerance_mm,
        "block_delete": block_delete,
        "dialect": dialect,
    }
    if search:
        settings["search"] = [str(folder) for folder in search]
    prediction = predict_toolpath(
        toolpath,
        cell,
        dt_s=dt_s,
        tolerance_mm=tolerance_mm,
        simplify_mm=simplify_mm,
        settings=settings,
        forces=forces,
    )
    return add_effects(prediction, effects, effect_folders)


def add_effects(
    prediction: Prediction, effects: "Sequence[str | Applied]" = (), folders: Sequence[str | Path] = ()
) -> Prediction:
    """Return a prediction with the effects of its cell and further ones, see `effects.with_effects`.

    Raises `NotUnderstoodError` where an effect, its target or a parameter is not one of the library.
    """
    if not effects and not prediction.cell.effects:
        return prediction
    from gcode2krl.effects import from_cell, library, with_effects
    from gcode2krl.effects.registry import resolve

    known = library(folders)
    cell = prediction.cell
    applied = [*from_cell(cell, known), *resolve(effects, known, cell)]
    changed = with_effects(prediction, applied, plan=_plan_anew(prediction))
    named = [str(effect) for effect in effects]
    return replace(changed, inputs={**changed.inputs, "effects": named})


def _plan_anew(prediction: Prediction) -> Callable[[Targets, Cell], Motion]:
    dt_s = float(prediction.inputs["dt_s"])
    return lambda targets, cell: plan_motion(targets, cell, dt_s, watches=False)


def predict_toolpath(
    toolpath: Toolpath,
    cell: Cell,
    *,
    dt_s: float | None = None,
    tolerance_mm: float | None = None,
    simplify_mm: float | None = None,
    settings: dict[str, Any] | None = None,
    targets: Targets | None = None,
    forces: bool = True,
    begin: Begin = unseen,
) -> Prediction:
    """Run every stage after the G-code; see `predict`. ``targets`` may be given if they are known already.

    ``begin`` is told the name of each stage as it begins.
    """
    dt_s = cell.controller.cycle_s if dt_s is None else dt_s
    if targets is None:
        begin("planning")
        targets = set_targets(toolpath, cell, tolerance_mm, simplify_mm)
    begin("motion")
    motion = plan_motion(targets, cell, dt_s)
    begin("joints")
    joints = solve_joints(motion, cell)
    loads: tuple[Forces | None, Deflection | None, tuple[Issue, ...]] = (None, None, ())
    if forces:
        cutting_begins = begin("material, forces, deflection")
        loads = forces_and_deflection(toolpath, motion, joints, cell, cutting_begins, targets)
    inputs: dict[str, Any] = {
        "program": toolpath.source,
        "version": __version__,
        "dt_s": dt_s,
        **(settings or {}),
    }
    if tolerance_mm is not None:
        inputs["tolerance_mm"] = tolerance_mm
    if targets.simplified is not None:
        inputs["simplify_mm"] = targets.simplified.tolerance_mm
    source = Path(toolpath.source)
    if source.is_file():
        content = source.read_bytes()
        inputs["program_sha256"] = hashlib.sha256(content).hexdigest()
        inputs["program_size_bytes"] = len(content)
    near = clearance_along(motion)
    return Prediction(toolpath, targets, cell, motion, joints, inputs, *loads, clearance=near)


def forecast_toolpath(
    toolpath: Toolpath, cell: Cell, targets: Targets, *, forces: bool = True, begin: Begin = unseen
) -> Forecast:
    """Run the stages of `predict_toolpath` at the controller's cycle, and keep what a program needs.

    The samples pass by in blocks: memory does not grow by their tables.
    """
    begin("motion and joints")
    planned = plan_course(targets, cell, cell.controller.cycle_s)
    course, figures = planned.course, LargestLoads()
    samples = PilotSamples(cell, course.count)
    outcome = Outcome(None, None, ())
    if forces:
        tell = begin("material, forces, deflection")
        loads = Loads(
            toolpath,
            cell,
            planned.outlook,
            course.dt_s,
            has_peaks=False,
            ways=lambda: _ways_beside(targets, cell),
        )
        with closing(loads.along(blocks_with_joints(course, cell))) as blocks:
            for block in blocks:
                figures.take(block.forces, block.deflection)
                samples.take(block.motion, block.line, block.forces, block.deflection)
                tell(loads.count, course.count)
        outcome = loads.outcome()
    known, bends = outcome.force_issues is not None, outcome.deflection_issues is not None
    found = (outcome.force_issues or (), outcome.deflection_issues or (), outcome.skipped)
    last = course.at(np.array([course.count - 1]))
    return Forecast(
        toolpath=toolpath,
        targets=targets,
        cell=cell,
        issues=(*targets.issues, *planned.issues, *itertools.chain.from_iterable(found)),
        time_s=float(last.time_s[0]),
        path_mm=float(last.path_mm[0]),
        loads=figures.figures(with_deflection=bends) if known else None,
        pilot=samples.force(with_deflection=bends) if known else None,
    )


def forecast_of(prediction: Prediction) -> Forecast:
    """Return what a program needs of a prediction that has a motion."""
    motion, forces, deflection = prediction.motion, prediction.forces, prediction.deflection
    pilot, loads = None, None
    if motion is not None and forces is not None:
        samples = PilotSamples(prediction.cell, len(motion))
        line = prediction.toolpath.source_line[motion.move]
        samples.take(motion, line, forces, deflection)
        loads = load_figures(forces, deflection)
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


def forces_and_deflection(
    toolpath: Toolpath,
    motion: Motion,
    joints: Joints,
    cell: Cell,
    tell: Progress = unheard,
    targets: Targets | None = None,
) -> tuple[Forces | None, Deflection | None, tuple[Issue, ...]]:
    """Return forces and deflection, None where a stage cannot run, and the findings that say why.

    ``tell`` is told how many samples are done. With ``targets`` the ways that a Motion does not show are held
    against the stock too. Raises `NotUnderstoodError` where the stock that the cell
    names cannot be read.
    """
    dt_s = float(motion.time_s[1] - motion.time_s[0]) if len(motion) > 1 else 0.0
    loads = Loads(
        toolpath,
        cell,
        lambda: cutting.outlook_of(block for block, _ in blocks_of(motion)),
        dt_s,
        ways=lambda: () if targets is None else _ways_beside(targets, cell),
    )
    all_forces, all_bent = Gathered[Forces](len(motion)), Gathered[Deflection](len(motion))
    with closing(loads.along(blocks_with(joints, motion))) as blocks:
        for done in blocks:
            all_forces.take(done.forces)
            if done.deflection is not None:
                all_bent.take(done.deflection)
            tell(loads.count, len(motion))
    outcome = loads.outcome()
    forces: Forces | None = None
    deflection: Deflection | None = None
    if outcome.force_issues is not None:
        forces = replace(all_forces.table(), issues=outcome.force_issues)
    if outcome.deflection_issues is not None:
        deflection = replace(all_bent.table(), issues=outcome.deflection_issues)
    return forces, deflection, outcome.skipped


def set_targets(
    toolpath: Toolpath, cell: Cell, tolerance_mm: float | None = None, simplify_mm: float | None = None
) -> Targets:
    """Return what the KRL program will say: poses, spin about the tool axis, CDIS, speeds, stops.

    ``tolerance_mm`` is the blend tolerance at corners: below ``G64 P``, above the cell's own.
    ``simplify_mm`` merges feed moves that follow each other into straight ones which no corner of the G-code
    is further from (`program.merging`); a note says what that gains. The findings
    of the G-code, of the cell and of the robot (reach, limits, singularities) travel with the table; the
    writer refuses what is an error.

    Raises
    ------
    NotUnderstoodError
        Where the program has no motion, or a tolerance is not positive or too large.
    RefusedError
        Where the cell does not state robot, ``$BASE``, HOME or a tool's tip.

    Examples
    --------
    >>> from gcode2krl import load_cell, read_gcode, set_targets
    >>> cell = load_cell()
    >>> set_targets(read_gcode("part.nc", cell), cell, tolerance_mm=0.05)
    Targets(... motions, part.nc)
    """
    return targets_and_joints(toolpath, cell, tolerance_mm, simplify_mm)[0]


def targets_and_joints(
    toolpath: Toolpath, cell: Cell, tolerance_mm: float | None = None, simplify_mm: float | None = None
) -> tuple[Targets, Joints]:
    """Return what `set_targets` returns, and the joints it was checked with (``sigma_min`` left NaN)."""
    if tolerance_mm is not None and not (np.isfinite(tolerance_mm) and tolerance_mm > 0):
        raise input_error("option-value", f"tolerance {tolerance_mm} mm is not positive")
    program.require_geometry(toolpath, cell)
    planned = posed_targets(toolpath, cell, tolerance_mm)
    if simplify_mm is not None:
        planned = _simplified(planned, toolpath, cell, simplify_mm, tolerance_mm)
    if cell.controller.spline:
        planned = program.with_stops(planned, cell.controller.circ)
    warnings = program.doubtful(toolpath, cell, tolerance_mm)
    tilts = program.tilt_issues(planned, toolpath, cell)
    return checked(replace(planned, issues=(*planned.issues, *warnings, *tilts)), cell)


def judged_targets(
    toolpath: Toolpath, cell: Cell, tolerance_mm: float | None = None, simplify_mm: float | None = None
) -> tuple[Targets, Joints, float]:
    """Return targets with all findings before their motion, joints, and the largest corner error (mm)."""
    targets, joints = targets_and_joints(toolpath, cell, tolerance_mm, simplify_mm)
    errors_mm, corner_issues = corner_errors(toolpath, targets, cell, tolerance_mm)
    judged = replace(targets, issues=(*targets.issues, *corner_issues, *future_confirmation(cell)))
    return judged, joints, float(errors_mm.max(initial=0.0))


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


def checked(targets: Targets, cell: Cell) -> tuple[Targets, Joints]:
    """Return targets with the findings on reach, limits, singularities and table, and their joints.

    Among them are the collisions on the motions that a Motion does not show (`clearance`).
    """
    joints, findings = robot.follow(targets, cell, conditioning=False)
    ways = tuple(ways_beside(targets, joints.q_rad, cell))
    findings = (*findings, *collisions_beside(ways, targets, cell))
    judged = replace(targets, issues=(*targets.issues, *program.below_table(targets, cell), *findings))
    rows = np.flatnonzero(targets.ptp)
    _WAYS_KNOWN[judged] = (cell, ways)
    _PTP_KNOWN[judged] = (cell, rows, joints.q_rad[rows], joints.status[rows], joints.turn[rows])
    return judged, replace(joints, issues=findings)


def _ways_beside(targets: Targets, cell: Cell) -> tuple[Beside, ...]:
    """Return the ways that a Motion does not show, cached as long as the targets live."""
    known = _WAYS_KNOWN.get(targets)
    if known is not None and known[0] is cell:
        return known[1]
    return tuple(ways_beside(targets, robot.target_angles(targets, cell)[0], cell))


def controller_test_targets(
    cell: Cell, origin_mm: tuple[float, float, float] | None = None, *, turning: bool = True
) -> Targets:
    """Return the targets of the controller's test program, with the lines that turn the tool or without.

    Raises what `krc4.trial_program.controller_test_program` raises.
    """
    text = trial_program.controller_test_program(cell, origin_mm).encode("ascii")
    targets = set_targets(gcode.read_stream(io.BytesIO(text), "test program", cell), cell)
    return checked(trial_program.with_turning_lines(targets, cell), cell)[0] if turning else targets


def plan_motion(
    source: Targets | Toolpath, cell: Cell, dt_s: float = 0.012, *, watches: bool = True
) -> Motion:
    """Return the path the controller will command, sampled every ``dt_s`` (12 ms, or 4 ms under RSI).

    Corners, time law and look-ahead by `krc4`; where a joint would exceed its speed limit the move is slowed
    down (assumption: to exactly that limit). ``issues`` say where time is lost and how much; what depends on
    a hypothesis about the controller says "unverified". Spindle start, tool changes and M-codes take no time
    here. Where it ``watches`` the issues name collisions too (`collision`), if the cell describes any.

    Raises
    ------
    NotUnderstoodError
        Where the program has no motion, or ``dt_s`` is not positive.

    Examples
    --------
    >>> from gcode2krl import load_cell, plan_motion, read_gcode
    >>> cell = load_cell()
    >>> motion = plan_motion(read_gcode("part.nc", cell), cell, dt_s=0.004)
    >>> round(float(motion.time_s[1]), 3)
    0.004
    """
    targets = set_targets(source, cell) if isinstance(source, Toolpath) else source
    planned = plan_course(targets, cell, dt_s, keeps=True, watches=watches)
    if planned.kept is None:
        raise AssertionError("samples that are asked for are kept")
    motion, q_rad, qd_rad_s, clearance = planned.kept
    motion = replace(motion, issues=planned.issues)
    if q_rad is not None and qd_rad_s is not None:
        _ANGLES_KNOWN[motion] = (cell, q_rad, qd_rad_s)
    if clearance is not None:
        _CLEARANCE_KNOWN[motion] = clearance
    return motion


def clearance_along(motion: Motion) -> Clearance | None:
    """Return how near anything comes along a Motion that `plan_motion` has watched, None for any other."""
    return _CLEARANCE_KNOWN.get(motion)


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


def corner_table(prediction: Prediction) -> dict[str, NDArray[Any]]:
    """Return the blended corners as columns (c,): G-code line, distance, error and position in mm."""
    chain = krc4.build_chain(prediction.targets, prediction.cell)
    corners = np.flatnonzero(chain.blend_mm > 0)
    x, y, z = chain.end_mm[corners].T
    return {
        "source_line": chain.source_line[corners],
        "d_mm": chain.blend_mm[corners] * chain.scale[corners],
        "error_mm": chain.corner_error_mm()[corners],
        "x_mm": x,
        "y_mm": y,
        "z_mm": z,
    }


def solve_joints(source: Targets | Motion, cell: Cell) -> Joints:
    """Return the joints at each target, or at each sample of a Motion: one branch, KUKA's signs, S and T.

    For Targets ``qd_rad_s`` is NaN, and the findings on reach, limits and singularities are in ``issues``.

    >>> from gcode2krl import Prediction, solve_joints
    >>> prediction = Prediction.load("prediction")
    >>> solve_joints(prediction.motion, prediction.cell).q_rad.shape == (len(prediction.motion), 6)
    True
    """
    if isinstance(source, Motion):
        return robot.joints_from_angles(source, *_motion_angles(source, cell), cell)
    joints, findings = robot.follow(source, cell)
    return replace(joints, issues=findings)


def solve_ptp_joints(targets: Targets, cell: Cell) -> Joints:
    """Return the joints at the PTP targets alone, which is what a program needs; other rows are NaN.

    The joints of targets that were planned here are cached as long as the targets live.
    """
    known = _PTP_KNOWN.get(targets)
    if known is None or known[0] is not cell:
        return robot.ptp_joints(targets, cell)
    _, rows, q_rad, status, turn = known
    count = len(targets)
    nothing = np.broadcast_to(np.nan, (count, 6))
    q, bits = np.empty((count, 6)), np.zeros((2, count), dtype=np.int32)
    in_chunks(lambda start, end: q[start:end].fill(np.nan), chunk_borders(count))
    q[rows], bits[:, rows] = q_rad, (status, turn)
    return Joints(
        q_rad=q,
        qd_rad_s=nothing,
        limit_margin_rad=nothing[:, 0],
        sigma_min=nothing[:, 0],
        status=bits[0],
        turn=bits[1],
    )


def _motion_angles(motion: Motion, cell: Cell) -> tuple[Floats, Floats]:
    """Return angles and speeds (m, 6) of a Motion, cached as long as it lives."""
    known = _ANGLES_KNOWN.get(motion)
    if known is None or known[0] is not cell:
        known = (cell, *robot.motion_angles(motion, cell))
        _ANGLES_KNOWN[motion] = known
    return known[1], known[2]
