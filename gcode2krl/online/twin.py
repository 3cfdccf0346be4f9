"""The twin: predicted forces cut the part, the compensator sees them late and noisy, the robot reacts late.

The prediction is the truth: its forces bend its arm. The compensator knows less: its model is too stiff, its
pilot force too low, its sensor noisy. The loop is closed by iteration over the whole run: the joints follow
the correction, which follows the joints, until the tip stays where it is. The effect of the tip's error on
the cut is left out: in a slot 9 mm deep a tool 0.6 mm too deep has 7 % more force, and the forces measured on
a real part include that.
"""

from dataclasses import asdict, dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import VirtualJoint
from gcode2krl.cell.sections.online import Online
from gcode2krl.compliance import deflection_of, project_normal
from gcode2krl.errors import input_error
from gcode2krl.online.compensator import (
    Compensator,
    Corrections,
    CycleInputs,
    build_compensator,
    joints_at,
    start,
    stream,
)
from gcode2krl.online.pilot_gate import Announced
from gcode2krl.online.plant import reaction, tip_shift_mm, with_backlash
from gcode2krl.pilot import Knots, PilotHeader, knots_of, to_pilot_frame
from gcode2krl.prediction import Prediction
from gcode2krl.tables import Forces, Joints, Motion
from gcode2krl.units import RAD_PER_DEG

Case = Literal["uncompensated", "cartesian", "pilot", "axis"]
CASES: tuple[Case, ...] = ("uncompensated", "cartesian", "pilot", "axis")
SETTLED_MM = 1e-4
MOST_ROUNDS = 12
RIGID_NMM_RAD = 1e50
PLAY_DEG = (0.005, 0.017)
"""0.3 to 1 arcmin. A user of a worn KR 200 measured 0.3-0.4 mm at 2 m of reach, 0.7 arcmin; 1 arcmin is what
makers of such gears allow, from memory of their catalogues. No measurement of a KR 300 was found."""
CHECKSUM = 1
_ROUNDED = 9
"""Digits of a joint angle in rad: the rounding of the inverse kinematics is no reversal."""


@dataclass(frozen=True, kw_only=True)
class World:
    """Parameters of the twin's world, and the source of each."""

    sensor_delay_s: float = 0.004
    """One telegram from the sensor to the compensator: the paper's cycle."""
    dead_s: float = 0.012
    lag_s: float = 0.012
    """One cycle of the controller each (section 2.3: at best ± 12 ms): RSI, then the position controller."""
    stiffness_scale: float = 1.06
    """Stiffness of the compensator's model over the truth: measured deviations are 6 % larger (section
    3.1)."""
    pilot_scale: float = 0.93
    """Pilot force over the truth: within the range of a fit, held-out slots are off by up to 7.5 %."""
    sensor_gain: float = 1.0
    """Normal mismatch ± 2 %."""
    noise_N: float = 3.0
    """1-sigma of a sample of the sensor; an assumption."""
    late_s: float = 0.0
    """How much later than predicted the cutter enters and leaves."""
    backlash_deg: float = 0.005
    """Play of every drive, within `PLAY_DEG`: its small end."""
    closed: float = 0.0
    """Share of the play, 0 to 1, that weight and cutting force keep closed. Not known; the controller, which
    does not know it either, takes out the whole play: with 1 a Cartesian correction that turns an axis moves
    the tip by more than was sent."""
    feed_scale: float = 1.0
    """The robot's speed over the predicted one."""
    override_percent: float = 100.0
    t1: float = 0.0
    seed: int = 1


class TwinRun(NamedTuple):
    """One case of the twin, n samples."""

    case: Case
    time_s: Floats
    error_mm: Floats
    """(n, 3) of the tip from the commanded path, along ``$BASE``."""
    normal_mm: Floats
    """(n,) length of that error normal to the feed."""
    shift_mm: Floats
    """(n, 3) motion of the robot by the correction."""
    needed_mm: Floats
    """(n,) length of the deflection normal to the feed: the correction that would have been right."""
    force_N: Floats
    """(n, 3) true."""
    device: Corrections | None
    """None: no compensation."""
    rounds: int
    """Passes until the loop converged."""


@dataclass(frozen=True)
class Twin:
    """A part on the bench; made by `twin_of`."""

    cell: Cell
    settings: Online
    world: World
    motion: Motion
    joints: Joints
    forces: Forces
    knots: Knots
    header: PilotHeader
    tool: int


def twin_of(prediction: Prediction, settings: Online, world: World) -> Twin:
    """Return the twin of a prediction with forces, sampled at the cycle of the settings.

    Raises `NotUnderstoodError` where it has no forces, another sample time, or several tools.
    """
    motion, joints, forces = prediction.motion, prediction.joints, prediction.forces
    if motion is None or joints is None or forces is None or prediction.deflection is None:
        raise input_error(
            "option-value",
            "the prediction has no forces or no deflection to compensate",
            "give [material], [stock] and [compliance] in the cell",
            source=prediction.toolpath.source,
        )
    step_s = float(motion.time_s[1] - motion.time_s[0]) if len(motion) > 1 else settings.cycle_s
    if abs(step_s - settings.cycle_s) > 1e-6:
        message = f"sampled every {1000 * step_s:g} ms, the twin runs at {1000 * settings.cycle_s:g} ms"
        raise input_error("option-value", message, f"predict with --dt {settings.cycle_s}")
    tools = np.unique(motion.tool)
    if len(tools) > 1:
        raise input_error("option-value", f"tools {tools.tolist()}: the twin runs one tool", "split the part")
    cell = prediction.cell
    bent = to_pilot_frame(prediction.deflection.deflection_base_mm, motion.rotation, motion.tool, cell)
    force = to_pilot_frame(forces.force_base_N, motion.rotation, motion.tool, cell)
    line = prediction.toolpath.source_line[motion.move]
    knots = knots_of(motion.time_s, motion.path_mm, force, bent, line=line, cycle_s=cell.controller.cycle_s)
    lead_s = max(cell.pilot.lead_s, settings.pilot_lead_s)
    knots = replace(knots, lead_s=np.full(len(knots), lead_s), force_N=world.pilot_scale * knots.force_N)
    header = PilotHeader(cell.pilot.frame, "index", cell.pilot.index_variable, lead_s, CHECKSUM)
    return Twin(cell, settings, world, motion, joints, forces, knots, header, int(tools[0]))


def simulate(twin: Twin, case: Case) -> TwinRun:
    """Return one case: no compensation, Cartesian, Cartesian with pilot, axis-specific with pilot."""
    time_s = twin.motion.time_s / twin.world.feed_scale
    force, moment = _late(twin, time_s)
    device = None if case == "uncompensated" else _device(twin, case)
    announced = _announced(twin, time_s)
    noise = np.random.default_rng(twin.world.seed).normal(0.0, twin.world.noise_N, (len(time_s), 3))
    shift = np.zeros((len(time_s), 3))
    corrections: Corrections | None = None
    tip: Floats | None = None
    load = _sensed(twin, force, moment, noise, time_s)
    rounds = 0
    while rounds < MOST_ROUNDS:
        rounds += 1
        present = joints_at(twin.joints.q_rad, shift, twin.cell)
        bent, _ = deflection_of(present, force, moment, np.zeros(3), twin.cell, twin.tool)
        before, tip = tip, bent + shift
        if before is not None and np.abs(tip - before).max(initial=0.0) < SETTLED_MM:
            break
        if device is not None:
            _, corrections = stream(device, start(device), _samples(twin, time_s, load, present, announced))
            shift = _shift(twin, corrections.correction, time_s)
    else:
        raise AssertionError(f"the loop did not settle within {MOST_ROUNDS} rounds")
    velocity = np.gradient(twin.motion.position_mm, twin.motion.time_s, axis=0)
    normal = np.linalg.norm(project_normal(tip, velocity), axis=1)
    needed = np.linalg.norm(project_normal(bent, velocity), axis=1)
    return TwinRun(case, time_s, tip, normal, shift, needed, force, corrections, rounds)


def as_settings(twin: Twin) -> dict[str, float | str | bool]:
    """Return everything that the figures depend on, for ``--json``."""
    online = twin.settings
    world = {f"world_{name}": value for name, value in asdict(twin.world).items()}
    return {
        "lead_ms": 1000.0 * online.pilot_lead_s,
        "threshold_N": online.threshold_N,
        "blend_ms": 1000.0 * online.blend_s,
        "filter_ms": 1000.0 * online.filter_s,
        "robot_delay_ms": 1000.0 * (twin.world.dead_s + twin.world.lag_s),
        "feed_scale": twin.world.feed_scale,
        "pilot_scale": twin.world.pilot_scale,
        "cycle_ms": 1000.0 * online.cycle_s,
        "lowpass_hz": online.lowpass_hz,
        "average_ms": 1000.0 * online.average_s,
        **world,
    }


def stiffer(cell: Cell, scale: float) -> Cell:
    """Return the cell with a stiffness multiplied by a factor; rigid joints stay rigid."""
    joints = {
        name: VirtualJoint(
            **{
                key: value * scale if value < RIGID_NMM_RAD else value
                for key, value in stated.model_dump().items()
            }
        )
        for name, stated in cell.compliance.virtual_joints.items()
    }
    compliance = cell.compliance.model_copy(update={"virtual_joints": joints})
    return cell.model_copy(update={"compliance": compliance})


def _device(twin: Twin, case: Case) -> Compensator:
    settings = twin.settings.model_copy(update={"mode": "axis" if case == "axis" else "cartesian"})
    cell = stiffer(twin.cell, twin.world.stiffness_scale)
    piloted = case in ("pilot", "axis")
    return build_compensator(
        cell,
        settings,
        tool=twin.tool,
        load_frame="base",
        knots=twin.knots if piloted else None,
        header=twin.header if piloted else None,
    )


def _late(twin: Twin, time_s: Floats) -> tuple[Floats, Floats]:
    """Return the true force and moment: the predicted ones, later."""
    load = np.concatenate([twin.forces.force_base_N, twin.forces.moment_base_Nmm], axis=1)
    if twin.world.late_s != 0.0:
        at = time_s - twin.world.late_s
        load = np.stack([np.interp(at, time_s, column, left=0.0, right=0.0) for column in load.T], axis=1)
    return load[:, :3], load[:, 3:]


def _sensed(twin: Twin, force: Floats, moment: Floats, noise: Floats, time_s: Floats) -> Floats:
    """Return the load (n, 6) that the compensator receives: later, scaled, noisy."""
    load = np.concatenate([twin.world.sensor_gain * force + noise, twin.world.sensor_gain * moment], axis=1)
    at = time_s - twin.world.sensor_delay_s
    return np.stack([np.interp(at, time_s, column) for column in load.T], axis=1)


def _samples(twin: Twin, time_s: Floats, load: Floats, present: Floats, announced: Announced) -> CycleInputs:
    return CycleInputs(
        time_s=time_s,
        load=load,
        q_rad=present,
        q_command_rad=twin.joints.q_rad,
        position_mm=twin.motion.position_mm,
        announced=announced,
    )


def axis_shift(twin: Twin, run: TwinRun) -> Floats:
    """Return the motion (n, 6) in rad that an axis-specific case tells the drives beside the program."""
    if run.device is None or run.device.correction.shape[1] != 6:
        raise ValueError(f"{run.case} sends no corrections to the axes")
    return reaction(run.device.correction, run.time_s, twin.world.dead_s, twin.world.lag_s)


def _shift(twin: Twin, sent: Floats, time_s: Floats) -> Floats:
    """Return the motion (n, 3) of the tip by the corrections sent.

    The controller takes play out of the program and of a Cartesian correction, which it interpolates; of one
    that goes to the axes it knows nothing (the assumption of Haehn & Weigold 2020, section 3.3).
    """
    moved = reaction(sent, time_s, twin.world.dead_s, twin.world.lag_s)
    q, closed = twin.joints.q_rad, twin.world.closed
    cartesian = sent.shape[1] == 3
    if cartesian and closed == 0.0:
        return moved
    gap = np.full(6, twin.world.backlash_deg * RAD_PER_DEG)
    drives = np.round(joints_at(q, moved, twin.cell), _ROUNDED) if cartesian else q + moved
    behind = with_backlash(drives, drives if cartesian else q, time_s, gap, closed)
    return tip_shift_mm(behind, with_backlash(q, q, time_s, gap, closed), twin.cell, twin.tool)


def _announced(twin: Twin, time_s: Floats) -> Announced:
    """Return what the controller reports: a knot's number once its trigger has fired, path-true."""
    fired = (twin.knots.time_s - twin.knots.lead_s) / twin.world.feed_scale
    knot = np.asarray(np.searchsorted(fired, time_s, side="right") - 1.0, dtype=np.float64)
    count = len(time_s)
    return Announced(
        knot=knot,
        checksum=np.full(count, float(CHECKSUM)),
        override_percent=np.full(count, twin.world.override_percent),
        t1=np.full(count, twin.world.t1),
    )
