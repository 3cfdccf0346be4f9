"""What the pictures of an answer are drawn from: the residual of each run over time, place and one input."""

from collections.abc import Sequence, Set
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Dependence, Inputs
from gcode2krl.effects.operators import since_reversal
from gcode2krl.gap.compare.inputs import Admissible
from gcode2krl.gap.compare.interpolation import nearest_rows, rms, running_mean, usual_step_s
from gcode2krl.gap.compare.links import FORCE, JOINTS, MECHANICS
from gcode2krl.gap.compare.trace import Trace
from gcode2krl.gap.noise.nuisance import nuisance_for
from gcode2krl.gap.posterior.examination import fitted_mismatch
from gcode2krl.gap.posterior.judgement import Judgement
from gcode2krl.gap.posterior.likelihood import Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import DEG_PER_RAD, MM_PER_M, S_PER_MIN


@dataclass(frozen=True, eq=False)
class Against:
    """An input of a run."""

    name: str
    """With its unit, ``torque about A2 (N·m)``."""
    values: Floats
    """(n,)."""
    direction: Floats | None = None
    """(n,) ±1, which way a joint moves, with memory; None where that does not matter."""
    across_runs: bool = False
    """It hardly changes within a run, so that all runs are shown together."""


def knows_place(inputs: Inputs) -> bool:
    """Tell whether the tip's place is known: not in a log of a robot that is not."""
    return bool(np.any(inputs.position_mm))


_Input = tuple[str, str, Floats]
"""Name, unit and values (n,)."""


def inputs_of(inputs: Admissible, on: Dependence, joint: int | None) -> list[_Input]:
    """Return the components of an input that a deviation can be drawn over; none of what is no function."""
    if joint is not None:
        of_joint = _of_joint(inputs, on, joint)
        if of_joint is not None:
            return [of_joint]
    match on:
        case Dependence.RUN_TIME | Dependence.RUN_START:
            return [("time in the run", "s", inputs.since_start_s)]
        case Dependence.WALL_CLOCK | Dependence.RUN_TO_RUN:
            return [("time since the first run's start", "h", inputs.hours)]
        case Dependence.TRAVEL:
            return [("travel", "m", inputs.travel_mm / MM_PER_M)]
        case Dependence.METRES_CUT:
            return [("way cut", "m", inputs.cut_m)]
        case Dependence.SPINDLE_SPEED:
            return [("spindle speed", "1/min", S_PER_MIN / (2.0 * np.pi) * inputs.spindle[:, 0])]
        case Dependence.PLACE:
            return _along("place", "mm", inputs.position_mm)
        case Dependence.VELOCITY:
            return _along("velocity", "mm/s", inputs.velocity_mm_s)
        case Dependence.ACCELERATION:
            return _along("acceleration", "mm/s²", inputs.acceleration_mm_s2)
        case Dependence.FORCE | Dependence.FORCE_BY_PLACE:
            return _along("force", "N", inputs.force_N)
        case Dependence.TEMPERATURE:
            return [(f"temperature {i + 1}", "°C", each) for i, each in enumerate(inputs.temperature_C.T)]
    return []


def _of_joint(inputs: Admissible, on: Dependence, joint: int) -> _Input | None:
    name = JOINTS[joint]
    match on:
        case Dependence.OWN_ANGLE:
            return f"angle of {name}", "deg", DEG_PER_RAD * inputs.q_rad[:, joint]
        case Dependence.OWN_TORQUE:
            return f"torque of {name}", "Nm", inputs.torque_Nm[:, joint]
        case Dependence.VELOCITY:
            return f"velocity of {name}", "deg/s", DEG_PER_RAD * inputs.rate_rad_s[:, joint]
        case Dependence.ACCELERATION:
            return f"acceleration of {name}", "deg/s²", DEG_PER_RAD * inputs.acceleration_rad_s2[:, joint]
        case Dependence.JERK:
            return f"jerk of {name}", "deg/s³", DEG_PER_RAD * inputs.jerk(joint)[:, 0]
    return None


def _along(name: str, unit: str, vectors: Floats) -> list[_Input]:
    """Return the components of vectors (n, 3) in ``$BASE``."""
    return [(f"{name} along {axis}", unit, vectors[:, i]) for i, axis in enumerate("xyz")]


_SHOWN = {
    Dependence.OWN_TORQUE: Dependence.OWN_TORQUE,
    Dependence.REVERSALS: Dependence.REVERSALS,
    Dependence.MOTOR_ANGLE: Dependence.OWN_ANGLE,
    Dependence.OWN_ANGLE: Dependence.OWN_ANGLE,
    Dependence.METRES_CUT: Dependence.METRES_CUT,
    Dependence.TRAVEL: Dependence.TRAVEL,
    Dependence.FORCE: Dependence.FORCE,
    Dependence.FORCE_BY_PLACE: Dependence.FORCE,
    Dependence.JERK: Dependence.JERK,
    Dependence.ACCELERATION: Dependence.ACCELERATION,
    Dependence.VELOCITY: Dependence.VELOCITY,
    Dependence.SPINDLE_SPEED: Dependence.SPINDLE_SPEED,
    Dependence.WALL_CLOCK: Dependence.WALL_CLOCK,
    Dependence.RUN_TO_RUN: Dependence.RUN_TO_RUN,
    Dependence.PLACE: Dependence.TRAVEL,
    Dependence.RUN_START: Dependence.RUN_TIME,
    Dependence.RUN_TIME_STEP: Dependence.RUN_TIME,
    Dependence.RUN_TIME: Dependence.RUN_TIME,
    Dependence.TONE: Dependence.RUN_TIME,
    Dependence.CONSTANT: Dependence.RUN_TIME,
}
"""What a gap depends on -> the input that it is drawn over; the more that says about a cause, the earlier."""


def against(trace: Trace, at: str | None, on: Set[Dependence]) -> Against | None:
    """Return the first input of a family that can be shown, None where there is none.

    ``at`` : the joint where the gap is, or None.
    """
    inputs, joint = Admissible(trace), JOINTS.index(at) if at in JOINTS else None
    shown = (_against(inputs, over, joint) for dependence, over in _SHOWN.items() if dependence in on)
    return next((each for each in shown if each is not None), None)


def _against(inputs: Admissible, on: Dependence, joint: int | None) -> Against | None:
    model = inputs.trace.inputs
    direction = None if joint is None else inputs.directions[:, joint]
    if joint is not None and on is Dependence.REVERSALS:
        since_s = since_reversal(model.q_cmd_rad[:, joint], model.time_s)[1]
        rows = nearest_rows(model.time_s, inputs.trace.time_s)
        shown = np.where(np.isfinite(since_s), since_s, np.nan)[rows]
        name = f"time since {JOINTS[joint]} reversed (s)"
        return Against(name, shown, direction) if np.isfinite(shown).any() else None
    if on is Dependence.OWN_TORQUE:  # the weight of the links would hide the load
        if joint is None or not knows_place(model):
            return None
        name = f"torque about {JOINTS[joint]} by the load at the tip (N·m)"
        return Against(name, inputs.load_torque_Nm[:, joint])
    components = inputs_of(inputs, on, joint)
    if not components or (len(components) == 3 and not np.any([each[2] for each in components])):
        return None
    name, unit, values = components[0]
    if len(components) == 3:
        name, values = name.removesuffix(" along x"), np.linalg.norm([each[2] for each in components], axis=0)
    return Against(
        f"{name} ({unit})",
        values,
        direction if on is Dependence.OWN_ANGLE else None,
        across_runs=on in (Dependence.WALL_CLOCK, Dependence.RUN_TO_RUN),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Residual:
    """One run beside its model, (n, k) in the link's inner unit; its clock, frame and zeros are taken out."""

    trace: Trace
    before: Floats
    after: Floats
    """With the named causes in the model."""
    shape: Floats
    """What the gap is made of: what the named causes do and, where more is left, the smoothed rest."""
    noise: Floats
    """(k,) standard deviation of each component."""


def residuals_of(judgement: Judgement) -> list[Residual]:
    """Return the residuals of all runs of a link, the held-out ones included.

    The named causes have the numbers that were fitted to the runs that explain.
    """
    traces = judgement.every or judgement.traces
    examination = judgement.examination
    with_named = [*judgement.usual, *judgement.applied]
    likelihood = Likelihood(
        traces, nuisance_for(traces, examination.question, examination.data.known), examination.noise
    )
    residual = [trace.measured - trace.sample(with_named) for trace in traces]
    by_run, shared = fitted_mismatch(likelihood, residual)
    noise = np.array([each.sigma for each in examination.noise])
    has_rest = not judgement.applied or judgement.told.significant
    residuals = []
    for trace, off, of_run, of_machine in zip(traces, residual, by_run, shared, strict=True):
        doing = trace.sample(with_named) - trace.sample(judgement.usual)
        structured = smoothed(trace.time_s, off - of_run - of_machine, THRESHOLDS.answer.rest_smooth_s)
        shape = doing + structured if has_rest else doing
        after = off - of_run
        residuals.append(Residual(trace=trace, before=after + doing, after=after, shape=shape, noise=noise))
    return residuals


def smoothed(time_s: Floats, values: Floats, over_s: float = THRESHOLDS.answer.smooth_s) -> Floats:
    """Return the mean of values (n,) or (n, k) over a time, that of fewer samples at the ends."""
    step_s = usual_step_s(time_s) if len(time_s) > 1 else over_s
    rows = min(round(over_s / step_s), len(values))
    return running_mean(values.reshape(len(values), -1), rows).reshape(values.shape)


@dataclass(frozen=True, kw_only=True, eq=False)
class RunEvidence:
    """One run, n rows."""

    run: str
    time_s: Floats
    line: Ints
    """(n,) G-code line; 0 where there is none."""
    position_mm: Floats | None
    """(n, 3) commanded tip in ``$BASE``; None without a known robot."""
    before: Floats
    """(n,) residual without causes in the model, in the evidence's unit."""
    after: Floats
    """(n,) residual with the named causes."""
    size_before: Floats
    """(n,) length of the whole residual, smoothed over 0.1 s, in ``size_unit``."""
    size_after: Floats
    against: Against | None
    """The input that the gap depends on."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """The largest gap, run by run."""

    signal: str
    component: str
    """Of what the residual is shown: ``A3``, or ``along (0.9, 0.3, 0.1)``."""
    unit: str
    noise: float
    """Standard deviation of that component."""
    size_unit: str
    """mm at the tip wherever joints can be converted, else ``unit``."""
    runs: tuple[RunEvidence, ...]


@dataclass(frozen=True)
class Depends:
    """Where a gap shows and on what it depends."""

    at: str | None
    """A joint, or None for the tip and for force."""
    on: frozenset[Dependence]


def evidence_of(judgement: Judgement, residuals: Sequence[Residual], depends: Depends | None) -> Evidence:
    """Return what the pictures of a link's gap are drawn from."""
    at = depends.at if depends is not None else None
    component, directions, noise = _component(residuals, at)
    first = residuals[0].trace
    in_mm = first.link.of_joints and all(knows_place(each.trace.inputs) for each in residuals)
    runs = tuple(
        _run(residual, along, in_mm, depends) for residual, along in zip(residuals, directions, strict=True)
    )
    return Evidence(
        signal=judgement.link.signal,
        component=component,
        unit=first.link.unit,
        noise=noise * first.factor,
        size_unit="mm" if in_mm else first.link.unit,
        runs=runs,
    )


def tip_of(trace: Trace, values: Floats) -> Floats:
    """Return by how much deviations of joints (n, k) in rad move the tip (n, 3) in mm, by the Jacobian."""
    samples = nearest_rows(trace.inputs.time_s, trace.time_s)
    columns = trace.inputs.jacobian[samples][:, :3, list(trace.columns)]
    moved: Floats = np.einsum("nij,nj->ni", columns, values)
    return moved


def _run(residual: Residual, along: Floats, in_mm: bool, depends: Depends | None) -> RunEvidence:
    trace = residual.trace
    samples = nearest_rows(trace.inputs.time_s, trace.time_s)

    def size(values: Floats) -> Floats:
        vectors = smoothed(trace.time_s, values)
        vectors = tip_of(trace, vectors) if in_mm else vectors * trace.factor
        length: Floats = np.linalg.norm(vectors, axis=1)
        return length

    return RunEvidence(
        run=trace.run,
        time_s=trace.time_s,
        line=trace.inputs.source_line[samples].astype(np.int64),
        position_mm=trace.inputs.position_mm[samples] if knows_place(trace.inputs) else None,
        before=trace.factor * np.sum(along * residual.before, axis=1),
        after=trace.factor * np.sum(along * residual.after, axis=1),
        size_before=size(residual.before),
        size_after=size(residual.after),
        against=None if depends is None else against(trace, depends.at, depends.on),
    )


def _component(residuals: Sequence[Residual], at: str | None) -> tuple[str, list[Floats], float]:
    """Return name, unit vectors (n, k) of each run, and noise of the component that shows the gap best.

    Of joints the one at which it is or that has most of it; of vectors the direction in which that joint
    moves the tip, else the one with most of the gap's power.
    """
    first = residuals[0].trace
    noise, shapes = residuals[0].noise, [each.shape for each in residuals]
    if first.link.of_joints:
        names = first.components
        power = np.sum([np.sum(shape**2, axis=0) for shape in shapes], axis=0)
        column = names.index(at) if at in names else int(np.argmax(power))
        unit = np.eye(len(names))[column]
        return names[column], [np.tile(unit, (len(shape), 1)) for shape in shapes], float(noise[column])
    if first.link is MECHANICS and at in JOINTS:
        joint = JOINTS.index(str(at))
        along = [_along_joint(each.trace, joint) for each in residuals]
        return f"along what {at} moves", along, rms(noise)
    direction = _principal(shapes)
    axes = " of the sensor" if first.frame == "sensor" else ""
    text = ", ".join(f"{value:.1f}" for value in np.round(direction, 1) + 0.0)
    name = "force" if first.link is FORCE else "tip"
    deviation = float(np.sqrt(np.sum((direction * noise) ** 2)))
    return (
        f"{name} along ({text}){axes}",
        [np.tile(direction, (len(shape), 1)) for shape in shapes],
        deviation,
    )


def _along_joint(trace: Trace, joint: int) -> Floats:
    """Return the unit vectors (n, 3) along which a joint alone moves the tip."""
    samples = nearest_rows(trace.inputs.time_s, trace.time_s)
    column = trace.inputs.jacobian[samples][:, :3, joint]
    length = np.linalg.norm(column, axis=1, keepdims=True)
    along: Floats = column / np.maximum(length, 1e-9)
    return along


def _principal(shapes: Sequence[Floats]) -> Floats:
    """Return the unit vector (k,) with most of the power; its largest component is positive."""
    moments = np.sum([shape.T @ shape for shape in shapes], axis=0)
    _, vectors = np.linalg.eigh(moments)
    direction: Floats = vectors[:, -1]
    upright: Floats = direction * np.sign(direction[np.argmax(np.abs(direction))])
    return upright
