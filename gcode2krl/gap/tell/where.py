"""Where a gap is: in time, on which lines, in which phase, along which direction, at which joint."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied, Inputs
from gcode2krl.effects.operators import since_reversal
from gcode2krl.gap.beside.interpolation import nearest_rows
from gcode2krl.gap.beside.links import JOINTS
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.noise import Noise

PHASES = ("corner", "reversal", "entry", "exit", "cruise", "air")
_NEAR_S = 0.3
"""What happens so soon after a reversal, an entry or an exit belongs to it."""
_JOIN_S = 0.2
_SMOOTH_S = 0.1
_MOVES_RAD = 1e-4


def place(traces: Sequence[Trace], noise: Sequence[Noise], applied: Sequence[Applied]) -> dict[str, Any]:
    """Return intervals, direction, phases, joints and band of the gap of one link.

    Intervals are where the gap, as the rms over 0.1 s, is larger than its rms over all runs.
    Of a gap that effects explain, the place is that of the effects; else that of the smoothed residual.
    """
    shapes = [structure(trace, applied) for trace in traces]
    sigma = float(np.sqrt(sum(each.sigma**2 for each in noise)))
    sizes = [_size(trace, shape) for trace, shape in zip(traces, shapes, strict=True)]
    level = float(np.sqrt(np.mean(np.concatenate([np.sum(s**2, axis=1) for s in shapes]))))
    intervals = []
    for trace, size in zip(traces, sizes, strict=True):
        least = max(level, 0.0 if applied else sigma)
        intervals += _intervals(
            trace, size, least, [JOINTS.index(a.target) for a in applied if a.target in JOINTS]
        )
    intervals.sort(key=lambda each: -each["rms"])
    vector = traces[0].signal in ("tcp", "force") and not traces[0].in_sensor_frame
    return {
        "intervals": intervals,
        "direction_base": _direction(shapes) if vector else None,
        "phases": _phases(traces, shapes),
        "joints": _joints(traces, shapes, applied),
        "frequency_hz": _band(traces, shapes),
    }


def structure(trace: Trace, applied: Sequence[Applied]) -> Floats:
    """Return (n, k) what the effects do to the signal; without any, the residual smoothed over 0.1 s."""
    if applied:
        return trace.sample(applied) - trace.nominal
    return np.stack([_smooth(trace, column) for column in trace.residual.T], axis=1)


def _size(trace: Trace, shape: Floats) -> Floats:
    """Return the length (n,) of vectors (n, k), as the rms over 0.1 s."""
    size: Floats = np.sqrt(np.maximum(_smooth(trace, np.sum(shape**2, axis=1)), 0.0))
    return size


def _smooth(trace: Trace, values: Floats) -> Floats:
    """Return the mean of (n,) over 0.1 s."""
    kernel = np.ones(max(1, round(_SMOOTH_S / float(np.median(np.diff(trace.time_s))))))
    found: Floats = np.convolve(values, kernel, mode="same")
    return found / np.convolve(np.ones(len(values)), kernel, mode="same")


def phase_of(inputs: Inputs) -> tuple[Ints, Ints]:
    """Return the phase (m,) of each sample, a number in `PHASES`, and which joint reversed last, or -1."""
    time_s, m = inputs.time_s, len(inputs)
    cuts = np.any(inputs.force_base_N != 0.0, axis=1)
    phase = np.where(cuts, PHASES.index("cruise"), PHASES.index("air"))
    edges = np.flatnonzero(np.diff(cuts.astype(int)))
    for edge in edges:
        entry = bool(cuts[edge + 1])
        first = time_s[edge + 1] - (0.0 if entry else _NEAR_S)
        last = time_s[edge + 1] + (_NEAR_S if entry else 0.0)
        phase[(time_s >= first) & (time_s <= last)] = PHASES.index("entry" if entry else "exit")
    joint = np.full(m, -1)
    latest = np.full(m, _NEAR_S)
    for axis in range(6):
        if np.ptp(inputs.q_cmd_rad[:, axis]) < _MOVES_RAD:
            continue
        _, since = since_reversal(inputs.q_cmd_rad[:, axis], time_s)
        newer = since < latest
        joint[newer], latest[newer] = axis, since[newer]
    phase[joint >= 0] = PHASES.index("reversal")
    if inputs.motion is not None and len(inputs.motion) == m:
        phase[inputs.motion.corner] = PHASES.index("corner")
    return phase, joint


def _intervals(trace: Trace, size: Floats, level: float, suspects: Sequence[int]) -> list[dict[str, Any]]:
    inside = np.flatnonzero(size > level)
    if len(inside) == 0:
        return []
    phase, joint = phase_of(trace.inputs)
    breaks = np.flatnonzero(np.diff(trace.time_s[inside]) > _JOIN_S) + 1
    found = []
    for rows in np.split(inside, breaks):
        start, end = float(trace.time_s[rows[0]]), float(trace.time_s[rows[-1]])
        own = nearest_rows(trace.inputs.time_s, trace.time_s[rows])
        lines = trace.inputs.source_line[own]
        lines = lines[lines > 0]
        found.append({
            "run": trace.run,
            "signal": trace.signal,
            "t_start_s": round(start, 4),
            "t_end_s": round(end, 4),
            "lines": [int(lines.min()), int(lines.max())] if len(lines) else [],
            "rms": float(np.sqrt(np.mean(size[rows] ** 2))) * trace.factor,
            "what": _what(phase[own], joint[own], size[rows], suspects),
        })  # fmt: skip
    return found


def _what(phase: Ints, joint: Ints, size: Floats, suspects: Sequence[int]) -> str:
    energy = np.bincount(phase, weights=size**2, minlength=len(PHASES))
    name = PHASES[int(np.argmax(energy))]
    if name != "reversal":
        return name
    at = joint[joint >= 0]
    if len(suspects) == 1:
        return f"reversal of {JOINTS[suspects[0]]}"
    return f"reversal of {JOINTS[int(np.bincount(at).argmax())]}" if len(at) else name


def _direction(shapes: Sequence[Floats]) -> list[float]:
    """Return the share of each axis as the components of a unit vector."""
    rms = np.sqrt(np.mean(np.concatenate([s**2 for s in shapes]), axis=0))
    length = float(np.linalg.norm(rms))
    return [float(value) for value in rms / length] if length > 0.0 else [0.0, 0.0, 0.0]


def _phases(traces: Sequence[Trace], shapes: Sequence[Floats]) -> list[dict[str, Any]]:
    energy, count = np.zeros(len(PHASES)), np.zeros(len(PHASES))
    for trace, shape in zip(traces, shapes, strict=True):
        phase, _ = phase_of(trace.inputs)
        own = phase[nearest_rows(trace.inputs.time_s, trace.time_s)]
        energy += np.bincount(own, weights=np.sum(shape**2, axis=1), minlength=len(PHASES))
        count += np.bincount(own, minlength=len(PHASES))
    factor, total = traces[0].factor, max(float(energy.sum()), 1e-300)
    return [
        {
            "phase": PHASES[i],
            "rms": float(np.sqrt(energy[i] / count[i])) * factor,
            "share": float(energy[i] / total),
        }
        for i in np.argsort(-energy)
        if count[i] > 0
    ]


def _joints(
    traces: Sequence[Trace], shapes: Sequence[Floats], applied: Sequence[Applied]
) -> list[dict[str, Any]]:
    """Return each joint's share of the gap's power.

    By its own column where angles were measured; by the effects' targets where effects explain it; else by
    how much of a gap at the tip lies along what the joint alone can move it.
    """
    if traces[0].signal.startswith("joint"):
        names = traces[0].components
        energy = sum(np.sum(s**2, axis=0) for s in shapes if s.shape[1] == len(names))
    elif any(one.target in JOINTS for one in applied):
        names = tuple(str(one.target) for one in applied if one.target in JOINTS)
        energy = np.array([
            sum(float(np.sum(structure(trace, [one]) ** 2)) for trace in traces)
            for one in applied if one.target in JOINTS
        ])  # fmt: skip
    elif traces[0].signal == "tcp" and not applied:
        names, energy = JOINTS, _along_joints(traces, shapes)
    else:
        return []
    total = float(np.sum(energy))
    if total <= 0.0:
        return []
    return [
        {"joint": names[i], "share": float(energy[i] / total)}
        for i in np.argsort(-np.asarray(energy))
        if energy[i] > 0.01 * total
    ]


def _along_joints(traces: Sequence[Trace], shapes: Sequence[Floats]) -> Floats:
    energy = np.zeros(6)
    for trace, shape in zip(traces, shapes, strict=True):
        own = nearest_rows(trace.inputs.time_s, trace.time_s)
        columns = trace.inputs.jacobian[own][:, :3, :]
        length = np.maximum(np.linalg.norm(columns, axis=1), 1e-9)
        along = np.einsum("ni,nij->nj", shape, columns) / length
        energy += np.sum(along**2, axis=0)
    return energy


def _band(traces: Sequence[Trace], shapes: Sequence[Floats]) -> list[float]:
    """Return the band (Hz) between the 10 % and 90 % points of the power of what is not constant."""
    trace, shape = traces[0], shapes[0]
    step = float(np.median(np.diff(trace.time_s)))
    power = np.sum(np.abs(np.fft.rfft(shape - shape.mean(axis=0), axis=0)) ** 2, axis=1)
    total = float(power.sum())
    if total <= 0.0:
        return [0.0, 0.0]
    share = np.cumsum(power) / total
    hz = np.fft.rfftfreq(len(shape), step)
    return [float(hz[int(np.searchsorted(share, level))]) for level in (0.1, 0.9)]
