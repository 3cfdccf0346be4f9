"""Where a gap is: in time, on which lines, in which phase, along which direction, at which joint.

And its size as a person meets it: millimetres at the part, seconds, or newtons where only forces are known.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied, Inputs
from gcode2krl.effects.operators import since_reversal
from gcode2krl.gap.answer.evidence import Residual, knows_place, smoothed, tip_of
from gcode2krl.gap.answer.result import AtPart, IntervalResult, JointResult, PhaseResult, RunSize, Where
from gcode2krl.gap.compare.clocks import timing_sizes
from gcode2krl.gap.compare.interpolation import nearest_rows, rms, rms_length, usual_step_s
from gcode2krl.gap.compare.links import FORCE, JOINTS, MECHANICS, TIMING
from gcode2krl.gap.compare.slips import Slip
from gcode2krl.gap.compare.trace import Link, Trace
from gcode2krl.gap.posterior.judgement import Judged, Judgement
from gcode2krl.gap.thresholds import THRESHOLDS

PHASES = ("corner", "reversal", "entry", "exit", "cruise", "air")
_LIMITS = THRESHOLDS.answer
_NO_NOISE = float(np.finfo(np.float64).tiny)
"""Keeps a signal without noise from dividing by zero."""


def place(
    traces: Sequence[Trace], shapes: Sequence[Floats], noise: Floats, applied: Sequence[Applied]
) -> Where:
    """Return intervals, direction, phases, joints and band of the gap of one link.

    Intervals are all the times at which the gap, as the rms over 0.1 s, exceeds the standard deviation of the
    noise: the length of a vector that of one of its components, or any joint that of its own. The first
    holds the largest share of the gap's power.

    Parameters
    ----------
    shapes : (n, k) of each trace, what the gap is made of: what the causes do, or what is left, smoothed.
    noise : (k,) standard deviation of each component.
    applied : the named causes; without any, stretches shorter than 0.3 s are noise and left out.
    """
    joints = [str(one.target) for one in applied if one.target in JOINTS]
    least_s = 0.0 if applied else _LIMITS.rest_smooth_s
    power = sum(float(np.sum(shape**2)) for shape in shapes)
    intervals = [
        interval
        for trace, shape in zip(traces, shapes, strict=True)
        for interval in _intervals(trace, shape, _stretches(trace, shape, noise, least_s), power, joints)
    ]
    is_vector = traces[0].link in (FORCE, MECHANICS) and traces[0].frame != "sensor"
    return Where(
        intervals=tuple(sorted(intervals, key=lambda interval: -(interval.share or 0.0))),
        direction_base=_direction(shapes) if is_vector else None,
        phases=_phases(traces, shapes),
        joints=_joints(traces, shapes, applied),
        frequency_hz=_band(traces[0], shapes[0]),
    )


def over_noise(trace: Trace, shape: Floats, noise: Floats) -> Floats:
    """Return the size (n,) of a gap (n, k), as the rms over 0.1 s, over that of the noise (k,).

    The noise is that of one component. The size of joints is the largest of theirs: one joint's gap is not
    hidden by the noise of five others.
    """
    if trace.link.of_joints:
        ratios = np.maximum(smoothed(trace.time_s, shape**2), 0.0) / np.maximum(noise, _NO_NOISE) ** 2
        largest: Floats = np.sqrt(ratios.max(axis=1))
        return largest
    size: Floats = np.sqrt(np.maximum(smoothed(trace.time_s, np.sum(shape**2, axis=1)), 0.0))
    return size / max(rms(noise), _NO_NOISE)


def _stretches(trace: Trace, shape: Floats, noise: Floats, least_s: float) -> Iterator[Ints]:
    """Yield the rows of each stretch in which a gap exceeds the noise; stretches that are near are one."""
    inside = np.flatnonzero(over_noise(trace, shape, noise) > 1.0)
    pieces = np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1)
    time_s = trace.time_s
    kept = [piece for piece in pieces if len(piece) and time_s[piece[-1]] - time_s[piece[0]] >= least_s]
    if not kept:
        return
    rows = np.concatenate(kept)
    yield from np.split(rows, np.flatnonzero(np.diff(time_s[rows]) > _LIMITS.same_interval_s) + 1)


def phase_of(inputs: Inputs) -> tuple[Ints, Ints]:
    """Return the phase (m,) of each sample, an index of `PHASES`, and which joint reversed last, or -1."""
    time_s, m = inputs.time_s, len(inputs)
    cuts = np.any(inputs.force_base_N != 0.0, axis=1)
    phase = np.where(cuts, PHASES.index("cruise"), PHASES.index("air"))
    edges = np.flatnonzero(np.diff(cuts.astype(int)))
    for edge in edges:
        entry = bool(cuts[edge + 1])
        first = time_s[edge + 1] - (0.0 if entry else _LIMITS.after_event_s)
        last = time_s[edge + 1] + (_LIMITS.after_event_s if entry else 0.0)
        phase[(time_s >= first) & (time_s <= last)] = PHASES.index("entry" if entry else "exit")
    joint = np.full(m, -1)
    latest = np.full(m, _LIMITS.after_event_s)
    for axis in range(6):
        if np.ptp(inputs.q_cmd_rad[:, axis]) < _LIMITS.joint_moves_rad:
            continue
        _, since = since_reversal(inputs.q_cmd_rad[:, axis], time_s)
        newer = since < latest
        joint[newer], latest[newer] = axis, since[newer]
    phase[joint >= 0] = PHASES.index("reversal")
    if inputs.motion is not None and len(inputs.motion) == m:
        phase[inputs.motion.corner] = PHASES.index("corner")
    return phase, joint


def _intervals(
    trace: Trace, shape: Floats, stretches: Iterator[Ints], power: float, joints: Sequence[str]
) -> Iterator[IntervalResult]:
    """Yield the stretches of a trace; ``power`` is that of all runs, ``joints`` are those of its causes."""
    square = np.sum(shape**2, axis=1)
    phase, joint = phase_of(trace.inputs)
    for rows in stretches:
        samples = nearest_rows(trace.inputs.time_s, trace.time_s[rows])
        lines = trace.inputs.source_line[samples]
        lines = lines[lines > 0]
        yield IntervalResult(
            run=trace.run,
            signal=trace.signal,
            t_start_s=round(float(trace.time_s[rows[0]]), 4),
            t_end_s=round(float(trace.time_s[rows[-1]]), 4),
            lines=(int(lines.min()), int(lines.max())) if len(lines) else (),
            rms=float(np.sqrt(np.mean(square[rows]))) * trace.factor,
            what=_what(phase[samples], joint[samples], square[rows], joints),
            share=float(np.sum(square[rows])) / max(power, _NO_NOISE),
        )


def _what(phase: Ints, joint: Ints, square: Floats, joints: Sequence[str]) -> str:
    """Return the phase that has most of the power of some rows, with the joint of a reversal.

    ``throughout`` where the gap is no larger in it than in the other phases of the stretch.
    """
    first = int(np.argmax(np.bincount(phase, weights=square, minlength=len(PHASES))))
    there = phase == first
    if not there.all() and np.mean(square[there]) < _LIMITS.phase_over_rest**2 * np.mean(square[~there]):
        return "throughout"
    name = PHASES[first]
    if name != "reversal":
        return name
    if len(joints) == 1:
        return f"reversal of {joints[0]}"
    reversed_last = joint[joint >= 0]
    if len(reversed_last) == 0:
        return name
    return f"reversal of {JOINTS[int(np.bincount(reversed_last).argmax())]}"


def _direction(shapes: Sequence[Floats]) -> tuple[float, ...]:
    """Return the share of each axis as the components of a unit vector."""
    rms = np.sqrt(np.mean(np.concatenate([shape**2 for shape in shapes]), axis=0))
    length = float(np.linalg.norm(rms))
    return tuple((rms / length).tolist()) if length > 0.0 else (0.0, 0.0, 0.0)


def _phases(traces: Sequence[Trace], shapes: Sequence[Floats]) -> tuple[PhaseResult, ...]:
    """Return the phases that occur, that with most of the gap's power first."""
    power, count = np.zeros(len(PHASES)), np.zeros(len(PHASES))
    for trace, shape in zip(traces, shapes, strict=True):
        phase, _ = phase_of(trace.inputs)
        of_rows = phase[nearest_rows(trace.inputs.time_s, trace.time_s)]
        power += np.bincount(of_rows, weights=np.sum(shape**2, axis=1), minlength=len(PHASES))
        count += np.bincount(of_rows, minlength=len(PHASES))
    factor, total = traces[0].factor, max(float(power.sum()), 1e-300)
    return tuple(
        PhaseResult(
            phase=PHASES[i], rms=float(np.sqrt(power[i] / count[i])) * factor, share=float(power[i] / total)
        )
        for i in np.argsort(-power)
        if count[i] > 0
    )


def _joints(
    traces: Sequence[Trace], shapes: Sequence[Floats], applied: Sequence[Applied]
) -> tuple[JointResult, ...]:
    """Return each joint's share of the gap's power.

    By its own column where angles were measured; by the effects' targets where effects explain it; else by
    how much of a gap at the tip lies along what the joint alone can move it.
    """
    at_joints = [one for one in applied if one.target in JOINTS]
    if traces[0].link.of_joints:
        names = traces[0].components
        power = sum(np.sum(shape**2, axis=0) for shape in shapes if shape.shape[1] == len(names))
    elif at_joints:
        names = tuple(str(one.target) for one in at_joints)
        power = np.array([_power(traces, one) for one in at_joints])
    elif traces[0].link is MECHANICS and not applied:
        names, power = JOINTS, _along_joints(traces, shapes)
    else:
        return ()
    total = float(np.sum(power))
    if total <= 0.0:
        return ()
    return tuple(
        JointResult(joint=names[i], share=float(power[i] / total))
        for i in np.argsort(-np.asarray(power))
        if power[i] > _LIMITS.joint_least_share * total
    )


def _power(traces: Sequence[Trace], applied: Applied) -> float:
    """Return the power of what one effect does to some traces."""
    return sum(float(np.sum((trace.sample([applied]) - trace.nominal) ** 2)) for trace in traces)


def _along_joints(traces: Sequence[Trace], shapes: Sequence[Floats]) -> Floats:
    """Return the power (6,) of the gap along the directions in which each joint moves the tip."""
    power = np.zeros(6)
    for trace, shape in zip(traces, shapes, strict=True):
        samples = nearest_rows(trace.inputs.time_s, trace.time_s)
        columns = trace.inputs.jacobian[samples][:, :3, :]
        length = np.maximum(np.linalg.norm(columns, axis=1), 1e-9)
        along = np.einsum("ni,nij->nj", shape, columns) / length
        power += np.sum(along**2, axis=0)
    return power


def _band(trace: Trace, shape: Floats) -> tuple[float, ...]:
    """Return the band (Hz) between the 10 % and 90 % points of the power of what is not constant."""
    step_s = usual_step_s(trace.time_s)
    power = np.sum(np.abs(np.fft.rfft(shape - shape.mean(axis=0), axis=0)) ** 2, axis=1)
    total = float(power.sum())
    if total <= 0.0:
        return 0.0, 0.0
    share = np.cumsum(power) / total
    hz = np.fft.rfftfreq(len(shape), step_s)
    return tuple(
        float(hz[int(np.searchsorted(share, level))]) for level in (_LIMITS.band_low, _LIMITS.band_high)
    )


_ORDER = ("tip", "part", "time", "force", "joints")
"""What a person asks for first."""


def at_part(
    gapped: Sequence[Judged], residuals: Mapping[Link, Sequence[Residual]], late: Judged | None
) -> AtPart | None:
    """Return the largest gap at the tip or the part; seconds, newtons or degrees where there is none.

    Parameters
    ----------
    gapped : the judgements of the links with a gap.
    residuals : those of each such link with a signal in time.
    late : the judgement among them that is a gap of timing.
    """
    sizes = []
    for judged in gapped:
        if isinstance(judged, Judgement) and _by_clocks_alone(judged):
            sizes.append(_by_clocks(judged))
        elif judged is late and isinstance(judged, Judgement):
            sizes.append(_in_time(judged))
        else:
            sizes.append(_in_space(judged, residuals.get(judged.link, ())))
    return max(sizes, key=lambda size: (-_ORDER.index(size.what), size.rms_before), default=None)


def run_sizes(judged: Judgement, residuals: Sequence[Residual]) -> tuple[RunSize, ...]:
    """Return the size of the gap of every run of a link, in the report's unit."""
    factor = judged.factor
    return tuple(
        _run_size(
            judged,
            residual.trace,
            factor * rms_length([residual.before]),
            factor * rms_length([residual.after]),
        )
        for residual in residuals
    )


def _run_size(judged: Judgement, trace: Trace, before: float, after: float | None) -> RunSize:
    explains = any(each.run == trace.run for each in judged.traces)
    return RunSize(run=trace.run, rms_before=before, rms_after=after, held_out=not explains)


def at_part_of(slip: Slip) -> AtPart | None:
    """Return the gap that a slip makes; None for one in joints, which says little of the part."""
    what = {"mm": "tip", "N": "force"}.get(slip.unit)
    if what is None:
        return None
    return AtPart(
        what=what,
        unit=slip.unit,
        rms_before=slip.rms_before,
        rms_after=slip.rms_after,
        noise=None,
        link=slip.link.name,
    )


def _by_clocks_alone(judged: Judgement) -> bool:
    """Tell whether the named causes of a link are clocks: then nothing is off in space."""
    return bool(judged.applied) and all(each.effect.is_clock for each in judged.applied)


def _by_clocks(judged: Judgement) -> AtPart:
    """Return by how much the clocks are off that a link's causes are."""
    offsets = [abs(each[each.effect.sizes[0].name]) for each in judged.applied]
    return AtPart(
        what="time",
        unit="s",
        rms_before=max(offsets, default=0.0),
        rms_after=None,
        noise=None,
        link=judged.link.name,
    )


def _in_time(judged: Judgement) -> AtPart:
    traces, causes = judged.every or judged.traces, (*judged.usual, *judged.applied)
    before, after = timing_sizes(traces, causes)
    return AtPart(
        what="time",
        unit="s",
        rms_before=before,
        rms_after=after,
        noise=None,
        link=TIMING.name,
        per_run=tuple(_run_size(judged, trace, *timing_sizes([trace], causes)) for trace in traces),
    )


def _in_space(judged: Judged, residuals: Sequence[Residual]) -> AtPart:
    if (
        isinstance(judged, Judgement)
        and judged.link.of_joints
        and all(knows_place(each.trace.inputs) for each in residuals)
    ):
        return _converted(judged, residuals)
    size, factor = judged.told, judged.factor
    before = rms_length([each.before for each in residuals]) if residuals else size.before**0.5
    if judged.link.of_joints:
        what = "joints"
    elif judged.link is FORCE:
        what = "force"
    else:
        what = "tip" if isinstance(judged, Judgement) else "part"
    return AtPart(
        what=what,
        unit=judged.link.unit,
        rms_before=factor * before,
        rms_after=factor * size.after**0.5,
        noise=factor * size.floor**0.5,
        link=judged.link.name,
        held_out_before=factor * size.before**0.5 if judged.held_out else None,
        per_run=run_sizes(judged, residuals) if isinstance(judged, Judgement) else (),
    )


def _converted(judged: Judgement, residuals: Sequence[Residual]) -> AtPart:
    """Return a gap in joints as what it is at the tip, along the program: the Jacobian times its shape.

    What is left of it is by the share that is gone on held-out data.
    """
    at_tip = [tip_of(each.trace, each.shape) for each in residuals]
    before_mm, shrink = rms_length(at_tip), judged.shrink
    return AtPart(
        what="tip",
        unit="mm",
        rms_before=before_mm,
        rms_after=None if shrink is None else before_mm * float(np.sqrt(1.0 - shrink)),
        noise=None,
        link=judged.link.name,
        per_run=tuple(
            _run_size(judged, residual.trace, rms_length([moved]), None)
            for residual, moved in zip(residuals, at_tip, strict=True)
        ),
    )
