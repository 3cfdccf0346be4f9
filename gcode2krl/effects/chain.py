"""The measuring chain of one run, nominal or with effects: what each instrument would see.

`simulate` follows the physics: plan -> commanded joints -> motor side -> behind the gear -> true joints;
cutting force -> load that bends the arm -> deflection -> tip; force -> sensor; at last the clocks.
Where an input carries what was measured at a stage, the stages after it start from that, so that each link of
the chain is judged on its measured input.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import arm
from gcode2krl.effects.arm import Load
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.signals import Signals


def simulate(inputs: Inputs, applied: Sequence[Applied] = (), *, rotation: bool = False) -> Signals:
    """Return what instruments would see with some effects at work, in the order of the physics.

    With ``rotation`` the true orientation of the tool comes too. Effects of one stage follow each other in
    the order given. Without effects the tip is the commanded one plus the nominal deflection.
    """
    inputs = _planned(inputs, applied)
    q_act, q_load, q_true = _joints(inputs, applied)
    cut = _cut(inputs, applied)
    cutting = cut if inputs.load_base_N is None else (inputs.load_base_N, inputs.moment_base_Nmm)
    bending = cutting
    for at_work in applied:
        bending = at_work.effect.load(bending, inputs, at_work)

    pose = _pose(inputs, applied, q_true, cutting, bending, rotation)
    sensed = _sensed(cut, inputs, applied)
    signals = Signals(
        inputs=inputs,
        q_cmd_rad=inputs.q_cmd_rad,
        q_act_rad=q_act,
        q_load_rad=q_load,
        force_base_N=cut[0],
        moment_base_Nmm=cut[1],
        force_meas_base_N=sensed[0],
        moment_meas_base_Nmm=sensed[1],
        **pose,
    )
    return _stated(signals, applied)


def commanded(inputs: Inputs, applied: Sequence[Applied] = ()) -> Signals:
    """Return what `simulate` does as far as commanded joints and clocks go; the rest is nominal or zero."""
    return _stated(_nominal(_planned(inputs, applied)), applied)


def drives(inputs: Inputs, applied: Sequence[Applied] = ()) -> Signals:
    """Return what `simulate` does as far as joints and clocks go; the rest is nominal or zero."""
    inputs = _planned(inputs, applied)
    q_act, q_load, q_true = _joints(inputs, applied)
    signals = replace(_nominal(inputs), q_act_rad=q_act, q_load_rad=q_load, q_true_rad=q_true)
    return _stated(signals, applied)


def forces(inputs: Inputs, applied: Sequence[Applied] = ()) -> Signals:
    """Return what `simulate` does as far as forces and clocks go; the rest is nominal."""
    inputs = _planned(inputs, applied)
    cut = _cut(inputs, applied)
    sensed = _sensed(cut, inputs, applied)
    signals = replace(
        _nominal(inputs),
        force_base_N=cut[0],
        moment_base_Nmm=cut[1],
        force_meas_base_N=sensed[0],
        moment_meas_base_Nmm=sensed[1],
    )
    return _stated(signals, applied)


def _nominal(inputs: Inputs) -> Signals:
    """Return the commanded motion as all signals, without forces."""
    q_cmd, nothing = inputs.q_cmd_rad, np.zeros(inputs.position_mm.shape)  # unwritten, it takes no memory
    return Signals(
        inputs=inputs,
        q_cmd_rad=q_cmd,
        q_act_rad=q_cmd,
        q_load_rad=q_cmd,
        q_true_rad=q_cmd,
        tcp_base_mm=inputs.position_mm,
        force_base_N=nothing,
        moment_base_Nmm=nothing,
        force_meas_base_N=nothing,
        moment_meas_base_Nmm=nothing,
    )


def _joints(inputs: Inputs, applied: Sequence[Applied]) -> tuple[Floats, Floats, Floats]:
    """Return the joints (m, 6) of the motor side, behind the gears, and as they truly are."""
    q_act = inputs.q_cmd_rad
    for at_work in applied:
        q_act = at_work.effect.servo(q_act, inputs, at_work)
    q_load = _measured(q_act, inputs.q_act_rad, inputs.is_act_missing)
    for at_work in applied:
        q_load = at_work.effect.gear(q_load, inputs, at_work)
    q_true = _measured(q_load, inputs.q_load_rad, inputs.is_load_missing)
    for at_work in applied:
        q_true = at_work.effect.joints(q_true, inputs, at_work)
    return q_act, q_load, q_true


def _measured(model_rad: Floats, measured_rad: Floats | None, is_missing: Bools) -> Floats:
    """Return the measured joints (m, 6), the model's where there are none."""
    if measured_rad is None:
        return model_rad
    return np.where(is_missing, model_rad, measured_rad) if is_missing.any() else measured_rad


def _cut(inputs: Inputs, applied: Sequence[Applied]) -> Load:
    cut: Load = (inputs.force_base_N, inputs.moment_base_Nmm)
    for at_work in applied:
        cut = at_work.effect.cut(cut, inputs, at_work)
    return cut


def _sensed(load: Load, inputs: Inputs, applied: Sequence[Applied]) -> Load:
    for at_work in applied:
        load = at_work.effect.sensor(load, inputs, at_work)
    return load


def _stated(signals: Signals, applied: Sequence[Applied]) -> Signals:
    for at_work in applied:
        signals = at_work.effect.instruments(signals, at_work)
    return signals


def _planned(inputs: Inputs, applied: Sequence[Applied]) -> Inputs:
    for at_work in applied:
        inputs = inputs if at_work.planned else at_work.effect.replan(inputs, at_work)
    return inputs


def _pose(
    inputs: Inputs, applied: Sequence[Applied], q_true: Floats, cutting: Load, load: Load, rotation: bool
) -> dict[str, Any]:
    """Return true joints, tip and, where asked for, orientation of the loaded arm.

    ``load`` bends the arm, ``cutting`` is the part of it that acts between cutter and part.
    """
    softness, lengths_mm = inputs.softness, inputs.lengths_mm
    for at_work in applied:
        softness = softness if softness is None else at_work.effect.softness(softness, inputs, at_work)
        lengths_mm = at_work.effect.geometry(lengths_mm, inputs, at_work)
    plain_N = inputs.force_base_N if inputs.load_base_N is None else inputs.load_base_N
    plain = load[0] is plain_N and load[1] is inputs.moment_base_Nmm
    if plain and q_true is inputs.joints_rad and softness is inputs.softness:
        deflection = inputs.bent_mm
    else:
        deflection, _ = arm.bend(q_true, *load, softness, inputs.cell, inputs.tool)
    turns = [at_work for at_work in applied if type(at_work.effect).elastic is not Effect.elastic]
    if turns:
        torque = arm.torque_Nm(inputs.jacobian, *load)
        angle = np.zeros_like(torque)
        for at_work in turns:
            angle = at_work.effect.elastic(angle, torque, inputs, at_work)
        q_true = q_true + angle
    if q_true is inputs.joints_rad and lengths_mm is inputs.lengths_mm:
        tip = inputs.tip_mm
    else:
        tip = inputs.rigid_tip_mm(q_true, lengths_mm)
    tcp = tip + deflection
    for at_work in applied:
        tcp = at_work.effect.yielding(tcp, cutting, inputs, at_work)
    for at_work in applied:
        tcp = at_work.effect.tcp(tcp, deflection, inputs, at_work)
    signals: dict[str, Any] = {"q_true_rad": q_true, "tcp_base_mm": tcp}
    if rotation:
        signals["tcp_rotation"] = _orientation(inputs, applied, q_true, load, softness)
    return signals


def _orientation(
    inputs: Inputs, applied: Sequence[Applied], q_true: Floats, load: Load, softness: Floats | None
) -> Floats:
    """Return the true quaternions (m, 4) of the tool frame: arm, bending, then what frames add."""
    _, bent_rad = arm.bend(q_true, *load, softness, inputs.cell, inputs.tool, turned=True)
    turned = rotation_of(bent_rad) @ arm.tool_rotation(q_true, inputs.cell, inputs.tool)
    for at_work in applied:
        turned = at_work.effect.orientation(turned, inputs, at_work)
    return fr.quaternion_from_rotation(turned)


def rotation_of(vector_rad: Floats) -> Floats:
    """Return the rotations (m, 3, 3) of rotation vectors (m, 3)."""
    angle = np.linalg.norm(vector_rad, axis=1, keepdims=True)
    half = np.sinc(angle / (2.0 * np.pi)) / 2.0  # sin(angle/2)/angle, right at 0 too
    return fr.rotation_from_quaternion(np.concatenate([vector_rad * half, np.cos(angle / 2.0)], axis=1))
