"""The order in which set-up slips are tested, before everything else: most real gaps are one of them.

A slip is named where a run's own checks name it, or where the effect of the slip, simulated again, takes nine
tenths of a gap that is far beyond what machines do by themselves. Slips of frames need a fit: another number
of tool or base, whose commanded joints belong to another frame, or a tracker that states the tip in another
frame than ``$BASE``.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl import frames, robot
from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Effect
from gcode2krl.effects.frame_effect import FRAME_NAMES, frame_of
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Issue
from gcode2krl.gap.compare.clocks import fitted_offset, with_coarse_clocks
from gcode2krl.gap.compare.interpolation import cubic
from gcode2krl.gap.compare.links import MECHANICS, PATH
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.slips import (
    Alike,
    Slip,
    best_of,
    check_slip,
    checked,
    clock_slips,
    force_unit_slip,
    on_the_curve,
    override_slip,
    program_slip,
    rms_before,
    rms_left,
    slip_if_explained,
    unplanned_stops,
    without_cuts,
)
from gcode2krl.gap.compare.trace import Context, Trace
from gcode2krl.gap.noise.nuisance import Nuisance
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.posterior.likelihood import Likelihood, refit
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs.matching import rotation_between
from gcode2krl.units import DEG_PER_RAD

_TOOL, _BASE = "tool_number", "base_number"
_LIMITS = THRESHOLDS.posterior


def frame_slip(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return another tool, or the base that fits, whose commanded paths are where they were programmed."""
    traces = PATH.traces(pairs)
    if not traces or rms_before(traces) < _LIMITS.path_off_rad:
        return []
    candidates = list(_candidates(pairs, library))
    if not candidates:
        return []
    best, after = best_of(traces, candidates)
    if best.effect.name == _BASE:
        best = _refined(traces, best)
        after = rms_left(traces, best)
    if not all(_brings_back(pair, best) for pair in pairs):
        return []
    what = f"tool {best.target}" if best.effect.name == _TOOL else "base another one"
    slips = slip_if_explained(traces, best, after, f"the commanded joints are those of {what}")
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
    noise = [white(THRESHOLDS.compare.model_rad)] * traces[0].shape[1]
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


_TRACKER_FRAME = "base_frame"


def tracker_frame_slip(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return another frame of the tracker, by which its tips are the predicted ones (Kabsch 1976)."""
    traces = [trace for trace in MECHANICS.traces(pairs) if trace.frame == "base"]
    effect = library.get(_TRACKER_FRAME)
    if effect is None or not traces or rms_before(traces) < THRESHOLDS.posterior.tracker_off_mm:
        return []
    predicted_mm = np.concatenate([trace.nominal for trace in traces])
    measured_mm = np.concatenate([trace.measured for trace in traces])
    rotation, shift_mm = rotation_between(predicted_mm, measured_mm)
    frame = Applied(effect, None, frame_values(shift_mm, rotation))
    words = f"the tracker is in another frame: $BASE shifted by {np.linalg.norm(shift_mm):.0f} mm and turned"
    return slip_if_explained(traces, frame, rms_left(traces, frame), words)


TESTS: tuple[Callable[[Sequence[Pair], Mapping[str, Effect]], list[Slip]], ...] = (
    program_slip,  # before the override: none explains another program. Ends the diagnosis
    override_slip,  # before frames, which need the same times
    frame_slip,
    tracker_frame_slip,  # behind the joints: the tip follows them
    force_unit_slip,
)
"""The first that finds a slip is the only one; behind them come the checks of the runs, which end it too."""


@dataclass(frozen=True)
class SetUp:
    """What is known of the set-up of runs before their links are judged."""

    context: Context
    """With the slips in the plans, and large clock errors taken off the stamps."""
    slips: list[Slip]
    issues: list[Issue]
    """What the checks of the runs say."""

    @property
    def is_final(self) -> bool:
        """Tell whether nothing can be compared beyond one of the slips."""
        return any(slip.final for slip in self.slips)


def examine_set_up(context: Context) -> SetUp:
    """Return the slips that all runs share, and the context with them."""
    # stops first: what a run falls behind at them looks like a wrong clock
    stops, stopped = unplanned_stops(context.pairs, context.offered)
    if stops:
        return SetUp(replace(context.with_pairs(stopped), stopped=True), stops, [])
    pairs, in_air = without_cuts(with_coarse_clocks(pair) for pair in context.pairs)
    context = context.with_pairs(pairs)
    issues = [*in_air, *checked(context.pairs)]
    slips = first_slip(context.pairs, context.offered, issues)
    clocks = clock_slips(context.pairs, context.offered)
    if not any(slip.final for slip in slips):
        for slip in slips:
            context = context.with_slip(slip.applied)
    return SetUp(context, [*slips, *clocks], issues)


def first_slip(
    pairs: Sequence[Pair], library: Mapping[str, Effect], issues: Sequence[Issue] = ()
) -> list[Slip]:
    """Return what the first test finds that finds anything; ``issues`` are those of the runs' checks."""
    named = (slips for test in TESTS if (slips := test(pairs, library)))
    return next(named, None) or check_slip(pairs, library, issues)
