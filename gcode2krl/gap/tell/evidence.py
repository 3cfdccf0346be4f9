"""What the pictures of an answer are drawn from: the residual of each run over time, place and one input."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Dependence
from gcode2krl.gap.beside.interpolation import nearest_rows
from gcode2krl.gap.beside.links import FORCE, JOINTS, MECHANICS
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.judged import Judgement
from gcode2krl.gap.tell.abscissa import Against, against, knows_place
from gcode2krl.gap.tell.residuals import Residual, smoothed


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
        unit=first.unit,
        noise=noise * first.factor,
        size_unit="mm" if in_mm else first.unit,
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
        return f"along what {at} moves", along, float(np.sqrt(np.mean(noise**2)))
    direction = _principal(shapes)
    axes = " of the sensor" if first.in_sensor_frame else ""
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
