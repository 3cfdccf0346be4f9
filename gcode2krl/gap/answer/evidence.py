"""What the pictures of an answer are drawn from: the residual of each run over time, place and one input."""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Dependence, Inputs, arm
from gcode2krl.effects.inputs import gradient
from gcode2krl.effects.operators import since_reversal
from gcode2krl.gap.compare.interpolation import nearest_rows, rms, running_mean, usual_step_s
from gcode2krl.gap.compare.links import FORCE, JOINTS, MECHANICS
from gcode2krl.gap.compare.trace import Trace
from gcode2krl.gap.noise.nuisance import nuisance_for
from gcode2krl.gap.posterior.examination import fitted_mismatch
from gcode2krl.gap.posterior.judgement import Judgement
from gcode2krl.gap.posterior.likelihood import Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import DEG_PER_RAD


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


def against(trace: Trace, samples: Ints, at: str | None, on: Set[Dependence]) -> Against | None:
    """Return the first input of a family that can be shown, None where there is none.

    Parameters
    ----------
    samples : (n,) rows of the trace's inputs.
    at : the joint where the gap is, or None.
    """
    for dependence, shown in _SHOWN.items():
        if dependence in on:
            values = shown(trace, samples, at)
            if values is not None:
                return values
    return None


_Shown = Callable[[Trace, Ints, str | None], Against | None]


def _joint(at: str | None) -> int | None:
    return JOINTS.index(at) if at in JOINTS else None


def _reversals(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint = _joint(at)
    if joint is None:
        return None
    inputs = trace.inputs
    direction, since = since_reversal(inputs.q_cmd_rad[:, joint], inputs.time_s)
    shown = np.where(np.isfinite(since), since, np.nan)[samples]
    if not np.isfinite(shown).any():
        return None
    return Against(f"time since {at} reversed (s)", shown, direction[samples])


def _torque(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint, inputs = _joint(at), trace.inputs
    if joint is None or not knows_place(inputs):
        return None
    load = inputs.force_base_N if inputs.load_base_N is None else inputs.load_base_N
    torque = arm.torque_Nm(inputs.jacobian, load, inputs.moment_base_Nmm)
    return Against(f"torque about {at} by the load at the tip (N·m)", torque[samples, joint])


def _angle(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint = _joint(at)
    if joint is None:
        return None
    q_rad = trace.inputs.q_cmd_rad[:, joint]
    direction, _ = since_reversal(q_rad, trace.inputs.time_s)
    return Against(f"angle of {at} (deg)", DEG_PER_RAD * q_rad[samples], direction[samples])


def _speed(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint, inputs = _joint(at), trace.inputs
    if joint is not None:
        speed = inputs.rate_rad_s[samples, joint]
        return Against(f"speed of {at} (deg/s)", DEG_PER_RAD * speed)
    if not knows_place(inputs):
        return None
    return Against("speed of the tip (mm/s)", np.linalg.norm(inputs.velocity_mm_s[samples], axis=1))


def _acceleration(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint, inputs = _joint(at), trace.inputs
    if joint is not None:
        rate = gradient(inputs.rate_rad_s, inputs.time_s)[samples, joint]
        return Against(f"acceleration of {at} (deg/s²)", DEG_PER_RAD * rate)
    rate = gradient(inputs.velocity_mm_s, inputs.time_s)[samples]
    return Against("acceleration of the tip (mm/s²)", np.linalg.norm(rate, axis=1))


def _jerk(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    joint, inputs = _joint(at), trace.inputs
    if joint is None:
        return None
    acceleration = gradient(inputs.rate_rad_s[:, joint], inputs.time_s)
    return Against(f"jerk of {at} (deg/s³)", DEG_PER_RAD * gradient(acceleration, inputs.time_s)[samples])


def _force(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    force = trace.inputs.force_base_N[samples]
    if not np.any(force):
        return None
    return Against("predicted force (N)", np.linalg.norm(force, axis=1))


def _travel(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    return Against("travel (m)", trace.inputs.path_mm[samples] / 1000.0)


def _time(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    return Against("time in the run (s)", trace.time_s)


def _clock(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    return Against("time since the first run's start (h)", trace.inputs.run_hours[samples], across_runs=True)


def _spindle(trace: Trace, samples: Ints, at: str | None) -> Against | None:
    return Against("spindle speed (1/min)", trace.inputs.spindle_rad_s[samples] * 30.0 / np.pi)


_SHOWN: Mapping[Dependence, _Shown] = {
    Dependence.OWN_TORQUE: _torque,
    Dependence.REVERSALS: _reversals,
    Dependence.MOTOR_ANGLE: _angle,
    Dependence.OWN_ANGLE: _angle,
    Dependence.METRES_CUT: _travel,
    Dependence.TRAVEL: _travel,
    Dependence.FORCE: _force,
    Dependence.FORCE_BY_PLACE: _force,
    Dependence.JERK: _jerk,
    Dependence.ACCELERATION: _acceleration,
    Dependence.VELOCITY: _speed,
    Dependence.SPINDLE_SPEED: _spindle,
    Dependence.WALL_CLOCK: _clock,
    Dependence.RUN_TO_RUN: _clock,
    Dependence.PLACE: _travel,
    Dependence.RUN_START: _time,
    Dependence.RUN_TIME_STEP: _time,
    Dependence.RUN_TIME: _time,
    Dependence.TONE: _time,
    Dependence.CONSTANT: _time,
}
"""In this order: the more an input says about a cause, the earlier."""


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
        against=None if depends is None else against(trace, samples, depends.at, depends.on),
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
