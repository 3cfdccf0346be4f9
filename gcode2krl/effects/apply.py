"""A prediction to the inputs of the chain, and a prediction with effects."""

import hashlib
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from gcode2krl import compliance, krc4, robot
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import stays
from gcode2krl.effects.chain import simulate
from gcode2krl.effects.effect import Applied
from gcode2krl.effects.inputs import Cut, Inputs, Plan
from gcode2krl.effects.signals import Signals
from gcode2krl.errors import input_error
from gcode2krl.prediction import Prediction, column_names
from gcode2krl.tables import Deflection, Forces, Joints, Motion, Targets


def inputs_of(
    prediction: Prediction, *, hours: float = 0.0, plan: Plan | None = None, cut: Cut | None = None
) -> Inputs:
    """Return the nominal chain of a prediction; that of one with effects is planned and cut again.

    ``plan`` and ``cut`` run these stages again for effects that change them; by default the controller's
    laws alone (a motion that joint speed limits slow down needs the caller's own ``plan``) and the material
    removal, whose results are remembered. Raises where the prediction has no motion or no joints.
    """
    plan = plan or partial(_plan, dt_s=float(prediction.inputs.get("dt_s", 0.0)))
    cut = remembered(cut) if cut is not None else _cut_of(prediction)
    motion, joints, forces = prediction.motion, prediction.joints, prediction.forces
    if motion is None or joints is None:
        raise input_error(
            "prediction-empty", "the prediction has no motion and joints", "predict the part again"
        )
    cell = stays(prediction.cell, motion.external, "effects and a diagnosis")
    prediction = replace(prediction, cell=cell)
    if prediction.added:  # the tables hold what effects have made of them: back to the nominal ones
        motion = plan(prediction.targets, prediction.cell)
        joints = robot.follow_motion(motion, prediction.cell)
        forces = cut(motion, prediction.cell) if cut is not None and forces is not None else None
    toolpath = prediction.toolpath
    nothing = np.zeros((len(motion), 3))
    return Inputs(
        cell=prediction.cell,
        time_s=motion.time_s,
        move=motion.move,
        source_line=toolpath.source_line[motion.move],
        path_mm=motion.path_mm,
        tool=motion.tool,
        spindle_rad_s=toolpath.spindle_rad_s[motion.move],
        q_cmd_rad=joints.q_rad,
        position_mm=motion.position_mm,
        rotation=motion.rotation,
        force_base_N=nothing if forces is None else forces.force_base_N,
        moment_base_Nmm=nothing if forces is None else forces.moment_base_Nmm,
        hours=hours,
        toolpath=toolpath,
        motion=motion,
        targets=prediction.targets,
        forces=forces,
        plan=plan,
        cut=cut,
    )


def with_effects(
    prediction: Prediction,
    applied: Sequence[Applied],
    *,
    hours: float = 0.0,
    plan: Plan | None = None,
    cut: Cut | None = None,
) -> Prediction:
    """Return the prediction with effects; what instruments see is at the prediction's own times.

    Motion and Joints stay what is commanded, planned anew where an effect does that; Forces are the true
    ones; the deflection is the whole way from the commanded place to the tip; ``added`` holds the columns of
    the motor side, of what is behind the gears, of the force sensor, and of a part that gives way.
    """
    if not applied:
        return prediction
    nominal = inputs_of(prediction, hours=hours, plan=plan, cut=cut)
    signals = simulate(nominal, applied)
    inputs = signals.inputs
    motion, joints = prediction.motion, prediction.joints
    if inputs.motion is not None and inputs is not nominal:
        motion = inputs.motion
        joints = _joints(inputs, inputs.motion)
    return replace(
        prediction,
        motion=motion,
        joints=joints,
        forces=_forces(signals, prediction.forces),
        deflection=_deflection(signals, prediction),
        added=added_columns(signals),
        clearance=prediction.clearance if motion is prediction.motion else None,
    )


def added_columns(signals: Signals) -> dict[str, Floats]:
    """Return what tables of a prediction have no column for: motor side, behind the gears, sensor, part."""
    columns: dict[str, Floats] = {}
    for signal in ("q_act_rad", "q_load_rad"):
        side = signal.removeprefix("q_").removesuffix("_rad")
        for number, values in enumerate(signals.seen(signal).T, start=1):
            columns[f"q{number}_{side}_rad"] = np.ascontiguousarray(values)
    for signal, name in (("force_meas_base_N", "force_meas_N"), ("moment_meas_base_Nmm", "moment_meas_Nmm")):
        for column, values in zip(column_names(name, 3), signals.seen(signal).T, strict=True):
            columns[column] = np.ascontiguousarray(values)
    if signals.part_shift_mm is not None:
        shift_mm = signals.seen("part_shift_mm").T
        columns |= dict(
            zip(column_names("part_shift_mm", 3), map(np.ascontiguousarray, shift_mm), strict=True)
        )
    return columns


def remembered(cut: Cut, most: int = 64, most_rows: int = 200_000) -> Cut:
    """Return a ``cut`` that removes the material once for each motion and cell, and keeps the last of them.

    Of long motions fewer: a row of forces takes 300 bytes.
    """
    known: OrderedDict[tuple[bytes, str], Forces] = OrderedDict()

    def once(motion: Motion, cell: Cell) -> Forces:
        digest = hashlib.blake2b(motion.position_mm.tobytes())
        digest.update(motion.speed_mm_s.tobytes())
        key = (digest.digest(), cell.model_dump_json(include={"tool", "material", "stock", "frames"}))
        if key not in known:
            known[key] = cut(motion, cell)
            while len(known) > most or (len(known) > 1 and sum(map(len, known.values())) > most_rows):
                known.popitem(last=False)
        return known[key]

    return once


def _cut_of(prediction: Prediction) -> Cut | None:
    if prediction.forces is None:
        return None
    from gcode2krl.cutting.milling import cut

    return remembered(partial(cut, prediction.toolpath))


def _plan(targets: Targets, cell: Cell, dt_s: float) -> Motion:
    chain = krc4.build_chain(targets, cell)
    return krc4.sample_motion(targets, chain, krc4.plan(chain, cell), cell, dt_s or cell.controller.cycle_s)


def _joints(inputs: Inputs, motion: Motion) -> Joints:
    """Return the commanded joints with their speeds."""
    speed = np.zeros_like(inputs.q_cmd_rad)
    if len(motion) > 1:
        speed = np.gradient(inputs.q_cmd_rad, motion.time_s, axis=0)
    return robot.joints_from_angles(motion, inputs.q_cmd_rad, speed, inputs.cell)


def _forces(signals: Signals, nominal: Forces | None) -> Forces | None:
    """Return the true forces; peak and torque go with the size of the force (an assumption)."""
    now = signals.inputs.forces if nominal is not None else None
    if nominal is None or now is None:
        return None
    before, after = (np.linalg.norm(f, axis=1) for f in (now.force_base_N, signals.force_base_N))
    cuts = before > 0.0
    ratio = np.where(cuts, after / np.where(cuts, before, 1.0), 1.0)
    return replace(
        now,
        force_base_N=signals.force_base_N,
        moment_base_Nmm=signals.moment_base_Nmm,
        peak_N=now.peak_N * ratio,
        torque_Nmm=now.torque_Nmm * ratio,
    )


def _deflection(signals: Signals, prediction: Prediction) -> Deflection:
    """Return the way from the commanded place to the tip, and its correction normal to the feed (eq. 10)."""
    inputs = signals.inputs
    deflection = signals.seen("tcp_base_mm") - inputs.position_mm
    before = prediction.deflection
    return Deflection(
        deflection_base_mm=deflection,
        correction_base_mm=compliance.project_normal(-deflection, inputs.velocity_mm_s),
        relative_band=before.relative_band if before is not None else 0.0,
    )
