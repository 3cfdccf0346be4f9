"""On what a gap without a name depends, in words and numbers: a family as the answer states it."""

from collections.abc import Iterator

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.gap.beside.events import line_at
from gcode2krl.gap.beside.interpolation import nearest_rows
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.judged import Judgement
from gcode2krl.gap.choose.likely_families import FamilyProbability, family_probabilities
from gcode2krl.gap.families.evidence import Evidence
from gcode2krl.gap.tell.course import course_of
from gcode2krl.gap.tell.result import DependsOnResult
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.families
_FORMS = {
    Dependence.RUN_TIME_STEP: "step",
    Dependence.RUN_TIME: "drift",
    Dependence.RUN_START: "drift",
    Dependence.RUN_TO_RUN: "drift",
    Dependence.WALL_CLOCK: "drift",
    Dependence.TEMPERATURE: "drift",
    Dependence.MOTOR_ANGLE: "periodic",
    Dependence.TONE: "periodic",
    Dependence.REVERSALS: "loop",
}
"""What a function of these looks like; of all others it is smooth."""
_AXES = ("fx", "fy", "fz")
_TIP = "tip"


def depends_on(judgement: Judgement, larger_links: int = 0) -> Iterator[tuple[DependsOnResult, Evidence]]:
    """Yield on what the gap of a link without a name, or beside named causes, may depend; best first.

    With each what the family says. ``larger_links`` have a larger gap without a name.
    """
    rest = judgement.rest
    if rest is None or judgement.verdict in ("no_gap", "explained"):
        return
    if not (rest.worth_naming or rest.is_gap):
        return
    for told in family_probabilities(rest, larger_links):
        if told.probability >= _LIMITS.least_probability:
            yield _result(judgement, told), told.evidence


def _result(judgement: Judgement, told: FamilyProbability) -> DependsOnResult:
    evidence, traces = told.evidence, judgement.every
    is_step = evidence.on is Dependence.RUN_TIME_STEP
    is_vector = judgement.traces[0].shape[1] == 3 and not judgement.link.of_joints
    signals = evidence.signal
    if is_vector:
        signals = tuple(_in_base(trace, own) for trace, own in zip(traces, signals, strict=True))
    largest = _largest(signals)
    along = largest if is_step else _main_axis(signals)
    moment = evidence.at if is_step else None
    length = float(np.linalg.norm(along))
    is_scalar = signals[0].shape[1] == 1
    course = None
    if (is_scalar or is_vector) and length > 0.0:
        turned = judgement.factor * (np.ones(1) if is_scalar else along / length)
        values = [own @ turned for own in signals]
        course = course_of(traces, values, evidence.on, evidence.place.joint, judgement.link.unit)
    return DependsOnResult(
        link=judgement.link.name,
        at=_at(evidence, evidence.signal),
        on=(Dependence.RUN_TIME if is_step else evidence.on).value,
        form=_FORMS.get(evidence.on, "smooth"),
        probability=told.probability,
        share=told.features.share,
        tests=told.features.as_dict(),
        at_time_s=None if moment is None else moment[1],
        run=None if moment is None else traces[moment[0]].run,
        in_later_runs=evidence.stays if is_step else None,
        line=None if moment is None else line_at(traces[moment[0]].inputs, moment[1]),
        size=judgement.factor * float(np.linalg.norm(largest)),
        unit=judgement.link.unit,
        direction=tuple((along / length).tolist()) if is_vector and length > 0.0 else None,
        frequency_hz=evidence.at[1] if evidence.on is Dependence.TONE and evidence.at else None,
        course=course,
    )


def _in_base(trace: Trace, values: Floats) -> Floats:
    """Return vectors (n, 3) of a trace along the axes of ``$BASE``."""
    if not (trace.in_sensor_frame or trace.in_tool_frame):
        return values
    inputs = trace.inputs
    rotation = inputs.sensor_rotation if trace.in_sensor_frame else inputs.tool_rotation
    rows = nearest_rows(inputs.time_s, trace.time_s)
    turned: Floats = np.einsum("nij,nj->ni", rotation[rows], values)
    return turned


def _at(evidence: Evidence, signals: tuple[Floats, ...]) -> str:
    """Return the place as the answer names it: of a force the axis that has most of it."""
    if evidence.place.where is Where.FORCE_AXIS:
        return _AXES[int(np.argmax(np.sum(np.concatenate(signals) ** 2, axis=0)))]
    if evidence.place.where is Where.JOINT and evidence.place.joint is None:
        return _TIP  # it is late along the path
    return evidence.place.name


def _largest(signals: tuple[Floats, ...]) -> Floats:
    """Return the row (k,) of signals (n, k) with the largest length."""
    rows = np.concatenate(signals)
    row: Floats = rows[int(np.argmax(np.sum(rows**2, axis=1)))]
    return row


def _main_axis(signals: tuple[Floats, ...]) -> Floats:
    """Return the unit vector (k,) along which signals have most of their power, as the largest points."""
    rows = np.concatenate(signals)
    axis: Floats = np.linalg.eigh(rows.T @ rows)[1][:, -1]
    return axis * (np.sign(axis @ _largest(signals)) or 1.0)
