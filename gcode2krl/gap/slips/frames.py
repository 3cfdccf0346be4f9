"""Another tool or base number: the commanded joints belong to another frame."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gcode2krl import frames, robot
from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Effect
from gcode2krl.effects.frame_effect import FRAME_NAMES, frame_of
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.beside.clocks import fitted_offset
from gcode2krl.gap.beside.commanded import on_the_curve
from gcode2krl.gap.beside.interpolation import cubic
from gcode2krl.gap.beside.links import PATH
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.noise import white
from gcode2krl.gap.fit.nuisance import Nuisance
from gcode2krl.gap.fit.refitting import refit
from gcode2krl.gap.slips.slip import (
    Alike,
    Slip,
    best_of,
    rms_before,
    rms_left,
    slip_if_explained,
)
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs.matching import rotation_between
from gcode2krl.units import DEG_PER_RAD

_TOOL, _BASE = "tool_number", "base_number"
_LIMITS = THRESHOLDS.slips


class FrameTest:
    """Another tool of the cell, or another base, which is fitted: whichever leaves less."""

    effects = (_TOOL, _BASE)

    def find(self, pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
        """Return the frame that puts the commanded paths where they were programmed."""
        traces = PATH.traces(pairs)
        if not traces or rms_before(traces) < _LIMITS.path_off_rad:
            return []
        candidates = list(_candidates(pairs, library))
        if not candidates:
            return []
        best, left = best_of(traces, candidates)
        if best.effect.name == _BASE:
            best = _refined(traces, best)
            left = rms_left(traces, best)
        if not all(_brings_back(pair, best) for pair in pairs):
            return []
        what = f"tool {best.target}" if best.effect.name == _TOOL else "base another one"
        slips = slip_if_explained(traces, best, left, f"the commanded joints are those of {what}")
        return [replace(slip, alike=_alike(best, pairs)) for slip in slips]


def frame_values(shift_mm: Floats, rotation: Floats) -> dict[str, float]:
    """Return a shift (3,) and a rotation (3, 3) as the values of an effect that is a frame."""
    abc_deg = frames.abc_from_rotation(rotation) * DEG_PER_RAD
    return dict(zip(FRAME_NAMES, [*shift_mm.tolist(), *abc_deg.tolist()], strict=True))


def _candidates(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> Iterator[Applied]:
    """Yield the tools of the cell that the prediction does not use, and the base that fits."""
    inputs = pairs[0].inputs
    if _TOOL in library:
        unused = set(inputs.cell.tool) - set(np.unique(inputs.tool).tolist())
        yield from (Applied(library[_TOOL], str(number), {}) for number in sorted(unused))
    if _BASE in library:
        yield _fitting_base(pairs[0], library[_BASE])


def _fitting_base(pair: Pair, effect: Effect) -> Applied:
    """Return the base that the logged joints belong to (Kabsch 1976 on their tips)."""
    table = pair.run.controller
    if table is None or table.q_cmd_rad is None or not np.isfinite(table.q_cmd_rad).all():
        return Applied(effect, None, dict.fromkeys(effect.names, 0.0))
    inputs = pair.inputs
    tool = int(np.bincount(np.maximum(inputs.tool, 0)).argmax())
    tip_mm, quaternion = robot.forward(table.q_cmd_rad, inputs.cell, tool)
    stamps_s = _on_time(pair, pair.stamps(table))
    wanted_mm = cubic(stamps_s, inputs.time_s, inputs.position_mm)
    middle = len(tip_mm) // 2
    near = int(np.argmin(np.abs(inputs.time_s - stamps_s[middle])))
    turned = frames.rotation_from_quaternion(quaternion[middle : middle + 1])[0]
    rotation = turned @ inputs.tool_rotation[near].T
    by_path, _ = rotation_between(wanted_mm, tip_mm)
    if np.abs(by_path - rotation).max() < _LIMITS.kabsch_rotation:
        rotation = by_path
    shift_mm = (tip_mm - wanted_mm @ rotation.T).mean(axis=0)
    return Applied(effect, None, frame_values(shift_mm, rotation))


def _on_time(pair: Pair, stamps_s: Floats) -> Floats:
    """Return the stamps (n,) of the commanded joints without the clock error that fits them."""
    traces = PATH.traces([pair])
    late_s, deviation_s = fitted_offset(traces[0]) if traces else (0.0, np.inf)
    return stamps_s - late_s if np.isfinite(deviation_s) else stamps_s


def _refined(traces: Sequence[Trace], base: Applied) -> Applied:
    """Return the frame that fits the commanded joints of all runs, whose clocks may be off."""
    clocks = [
        [Nuisance("clock", False, -np.ascontiguousarray(trace.rate.T)[:, :, None] * Mismatch.clock_s)]
        for trace in traces
    ]
    noise = [white(THRESHOLDS.beside.model_rad)] * traces[0].shape[1]
    return refit(Likelihood(traces, clocks, noise), (base,), steps=_LIMITS.frame_fit_steps).applied[0]


def _brings_back(pair: Pair, frame: Applied) -> bool:
    """Tell whether another tool or base puts the commanded path where it was programmed."""
    if frame.effect.name == _TOOL:
        return on_the_curve(pair, tool=int(frame.target or 0))
    return on_the_curve(pair, frame_of(frame))


def _alike(frame: Applied, pairs: Sequence[Pair]) -> Alike:
    """Return what shifts the path alike, while the tool never turns: for a base a tool, for a tool a base."""
    rotations = np.concatenate([pair.inputs.tool_rotation for pair in pairs])
    turn = float(np.abs(rotations - rotations[0]).max())
    if frame.effect.name == _BASE:
        turn = max(turn, float(np.abs(frame_of(frame)[:3, :3] - np.eye(3)).max()))
        return ((_TOOL, None),) if turn < _LIMITS.frame_turn_rad else ()
    cell = pairs[0].inputs.cell
    other = cell.tool_matrix(int(frame.target or 0))[:3, :3]
    for number in np.unique(np.concatenate([pair.inputs.tool for pair in pairs])):
        turn = max(turn, float(np.abs(cell.tool_matrix(int(number))[:3, :3] - other).max()))
    return ((_BASE, None),) if turn < _LIMITS.frame_turn_rad else ()
