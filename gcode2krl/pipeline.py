"""The stages as public functions, each a call of the chain or of one stage."""

import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl import gcode, krc4, robot
from gcode2krl.blockwise import plan_course
from gcode2krl.cell import Cell
from gcode2krl.chain import Plan, collect, prepare
from gcode2krl.errors import Issue
from gcode2krl.prediction import Prediction
from gcode2krl.progress import Begin, unseen
from gcode2krl.tables import Joints, Motion, Targets, Toolpath

if TYPE_CHECKING:
    from gcode2krl.effects import Applied


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
    issues = (*changed.skipped, *_weights_unknown(applied, cell))
    return replace(changed, skipped=issues, inputs={**changed.inputs, "effects": named})


def _weights_unknown(applied: "Sequence[Applied]", cell: Cell) -> Iterator[Issue]:
    """Yield a finding where effects that feel the weight of the links feel none."""
    feeling = [effect.label for effect in applied if effect.effect.feels_weight]
    if feeling and cell.robot.drives.link_mass_kg is None:
        yield Issue(
            "warning",
            "effect-weightless",
            0,
            f"the masses of the links of {cell.robot.title} are not known: {', '.join(feeling)} "
            f"{'feels' if len(feeling) == 1 else 'feel'} the cutting force and the payload alone",
            "state robot.drives.link_mass_kg; init --controller ARM.urdf reads those of a maker's file",
        )


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
    """Run every stage after the G-code; see `translation.from_python.predict`.

    ``targets`` may be given if they are known already. ``begin`` is told the name of each stage as it begins.
    """
    if targets is None:
        begin("planning")
        plan = prepare(toolpath, cell, tolerance_mm, simplify_mm)
    else:
        plan = Plan.of(toolpath, targets, cell)
    asked = {} if tolerance_mm is None else {"tolerance_mm": tolerance_mm}
    return collect(plan, dt_s, forces=forces, settings={**(settings or {}), **asked}, begin=begin)


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
    return prepare(toolpath, cell, tolerance_mm, simplify_mm).targets


def controller_test_targets(
    cell: Cell, origin_mm: tuple[float, float, float] | None = None, *, turning: bool = True
) -> Targets:
    """Return the targets of the controller's test program, with the lines that turn the tool or without.

    Raises what `krc4.trial_program.controller_test_program` raises.
    """
    from gcode2krl.identify import trial_program

    text = trial_program.controller_test_program(cell, origin_mm).encode("ascii")
    toolpath = gcode.read_stream(io.BytesIO(text), "test program", cell)
    targets = set_targets(toolpath, cell)
    if not turning:
        return targets
    return Plan.of(toolpath, trial_program.with_turning_lines(targets, cell), cell).judged().targets


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
    return plan_course(targets, cell, dt_s, keeps=True, watches=watches).samples().motion


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
        return robot.follow_motion(source, cell)
    joints, findings = robot.follow(source, cell)
    return replace(joints, issues=findings)
