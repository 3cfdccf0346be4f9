"""The links of the joints: path, servo and gear."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Inputs, Signals, drives
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.beside.clocks import with_table_clock
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.beside.instruments import (
    CLOCK,
    ENCODER_ZERO,
    PLAY_START,
    ROUGH,
    constants,
    play_start_columns,
)
from gcode2krl.gap.beside.interpolation import cubic, nearest_rows
from gcode2krl.gap.beside.links.base import Link
from gcode2krl.gap.beside.links.traces import joint_trace
from gcode2krl.gap.beside.own_model import with_nominal_joints, with_own_model
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.retiming import refined, retimed
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.beside.verdict import FittedVerdict, Verdict, is_lost
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs import Controller
from gcode2krl.units import RAD_PER_DEG

LIMITS = THRESHOLDS.beside


class PathLink(Link):
    """The commanded joints of the log against the predicted ones; timing is what lies along the motion."""

    name = "path"
    signal = "joint_commanded"
    unit = "deg"
    needs = "controller.csv with q1_cmd_deg …, and a prediction"
    of_joints = True
    model_rms = LIMITS.model_rad
    tells_time = True
    least_off = LIMITS.progress_off_rad
    least_step = LIMITS.progress_step_rad

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> Trace | None:
        """Return the commanded joints of a run with a prediction."""
        table = pair.run.controller
        if table is None or table.q_cmd_rad is None or pair.from_log or pair.run.head.angles == "relative":
            return None
        # joints alone: what plans anew need not remove the material again
        pair = replace(pair, inputs=replace(pair.inputs, cut=None, forces=None))
        return joint_trace(
            self, pair, table, table.q_cmd_rad, "q_cmd_rad", None, base=base, sigma_rad=LIMITS.model_rad
        )

    def motion(self, pair: Pair) -> Trace | None:
        """Return the commanded joints, without any the actual ones: how far a run has come."""
        table = pair.run.controller
        if table is None or not pair.has_actual_joints_alone:
            return self.trace(pair)
        run = replace(pair.run, controller=replace(table, q_cmd_rad=table.q_act_rad))
        return self.trace(replace(pair, run=run))

    def simulated(self, trace: Trace, applied: Sequence[Applied]) -> Signals:
        """Return the commanded path, planned once for all runs of a prediction."""
        return trace.simulator.commanded(trace.inputs, applied)

    def planned(self, inputs: Inputs) -> Floats:
        """Return the commanded joints (m, 6)."""
        return inputs.q_cmd_rad

    def clocks(self, context: Context) -> int:
        """Return one: that of the controller's table."""
        return 1

    def clock_share(self, context: Context) -> float:
        """Return a tenth where the clock was set by the commanded joints already."""
        return LIMITS.clock_set_share if context.clocks_set else 1.0

    def learn(self, context: Context, judged: FittedVerdict) -> Context:
        """Plan named time laws into the inputs, then take over the run's own timing.

        Where the controller moves by a model of the robot of its own, its joints are brought back to those of
        the plan.
        """
        for applied in judged.applied:
            if applied.effect.plans_anew:
                context = context.replanned(applied)
        if any(applied.effect.own_model for applied in judged.applied):
            return context.with_pairs(self._without_own_model(pair) for pair in context.pairs)
        pairs = context.pairs
        if is_lost(judged):
            pairs = tuple(retimed(pair) for pair in pairs)
        return context.with_pairs(refined(with_table_clock(pair, self), self) for pair in pairs)

    def _without_own_model(self, pair: Pair) -> Pair:
        """Return the pair on the run's own time, the controller's joints less what its own model adds."""
        on_time = refined(with_own_model(pair), self)
        inputs = replace(on_time.inputs, q_cmd_rad=pair.inputs.q_cmd_rad)
        return with_nominal_joints(replace(on_time, inputs=inputs))


class _DriveLink(Link):
    """A link between two columns of the controller's table."""

    unit = "deg"
    of_joints = True

    def simulated(self, trace: Trace, applied: Sequence[Applied]) -> Signals:
        """Return the joints and their clocks: a tip need not be computed."""
        return drives(trace.inputs, applied)

    def base(self, context: Context) -> tuple[Applied, ...]:
        """Return slips, and what encoders were found to misread."""
        return (*context.slips, *(each for each in context.learned if each.effect.is_misread))

    def learn(self, context: Context, judged: FittedVerdict) -> Context:
        """Let later links start from the fitted model, where it holds: encoders' noise stays out of them."""
        context = context.with_learned(each for each in judged.applied if each.effect.is_misread)
        if is_lost(judged):
            return context
        return context.with_pairs(_with_fitted(pair, judged) for pair in context.pairs)


class ServoLink(_DriveLink):
    """What the drives do of what was commanded, q_act - q_cmd; without q_cmd, of what was planned."""

    name = "servo"
    signal = "joint_actual"
    needs = "controller.csv with q1_act_deg …, and q1_cmd_deg … or a prediction"

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> Trace | None:
        """Return q_act - q_cmd less a logged correction; q_act itself where it is compared with the plan."""
        table = pair.run.controller
        if table is None or table.q_act_rad is None:
            return None
        stated_deg = pair.run.head.noise.q_act_deg
        sigma_rad = None if stated_deg is None else stated_deg * RAD_PER_DEG
        if pair.has_actual_joints_alone:
            actual_rad = table.q_act_rad - logged_correction(pair, table)
            return joint_trace(
                self, pair, table, actual_rad, "q_act_rad", None, base=base, sigma_rad=sigma_rad
            )
        if table.q_cmd_rad is None:
            return None
        pair = pair.with_measured_joints("q_cmd")
        difference = table.q_act_rad - table.q_cmd_rad - logged_correction(pair, table)
        return joint_trace(
            self, pair, table, difference, "q_act_rad", "q_cmd_rad", base=base, sigma_rad=sigma_rad
        )

    def learn(self, context: Context, judged: FittedVerdict) -> Context:
        """Take the clock off the controller's table too, where only its commanded columns have it."""
        # what is fitted belongs to rows, whatever their stamps become
        return _with_free_controller(super().learn(context, judged), judged)


class GearLink(_DriveLink):
    """What is behind the gears beside the motors: q_load - q_act."""

    name = "gear"
    signal = "joint_load"
    needs = "controller.csv with q1_load_deg … (encoders behind the gear)"
    own_clock = "q_load"
    sets_clocks = True
    instrument = (CLOCK, ENCODER_ZERO)

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> Trace | None:
        """Return q_load - q_act."""
        table = pair.run.controller
        if table is None or table.q_load_rad is None or table.q_act_rad is None:
            return None
        pair = pair.with_measured_joints("q_act")
        noise, sigma_rad = pair.run.head.noise, None
        if noise.q_load_deg is not None:
            sigma_rad = float(np.hypot(noise.q_load_deg, noise.q_act_deg or noise.q_load_deg)) * RAD_PER_DEG
        difference = table.q_load_rad - table.q_act_rad
        return joint_trace(
            self, pair, table, difference, "q_load_rad", "q_act_rad", base=base, sigma_rad=sigma_rad
        )

    def mismatch(self, trace: Trace, mismatch: Mismatch) -> Iterator[tuple[str, Floats]]:
        """Yield the zeros of the encoders, set by hand, and where in its play each joint begins."""
        yield ENCODER_ZERO, constants(trace) * mismatch.joint_zero_rad * ROUGH
        yield PLAY_START, play_start_columns(trace, mismatch)


def _with_fitted(pair: Pair, judged: FittedVerdict) -> Pair:
    """Return the pair with what the judged link really does to the joints, by its fitted model."""
    table = pair.run.controller
    trace = next((trace for trace in judged.every if trace.run_number == pair.number), None)
    if trace is None or table is None:
        return pair
    stamps = pair.stamps(table)
    joints_rad = np.zeros((len(stamps), 6))
    joints_rad[:, list(trace.columns)] = judged.fitted(
        trace, np.clip(stamps, trace.time_s[0], trace.time_s[-1])
    )
    if pair.has_actual_joints_alone and trace.plus == "q_act_rad":
        planned_rad = cubic(stamps, pair.inputs.time_s, pair.inputs.q_cmd_rad)
        joints_rad[:, list(trace.columns)] -= planned_rad[:, list(trace.columns)]
    return replace(pair, fitted={**pair.fitted, trace.plus: joints_rad})


def _with_free_controller(context: Context, servo: Verdict) -> Context:
    """Take the clock off the controller's table where its commanded columns alone are off.

    They then differ by the same time from the plan and from the drives.
    """
    path = context.timing
    of_table, of_columns = _clock(path, "controller"), _clock(servo, "q_cmd")
    if path is None or of_table is None or of_columns is None:
        return context
    offset_s = _offset_s(of_table)
    if abs(offset_s - _offset_s(of_columns)) > LIMITS.clocks_of_two * context.mismatch.clock_s:
        return context
    freed = (pair.later("controller", -offset_s) for pair in context.pairs)
    return context.without_cause(path, of_table).with_pairs(freed)


def _clock(judged: Verdict | None, target: str) -> Applied | None:
    """Return the named clock of a table or of columns."""
    named = judged.applied if judged is not None else ()
    return next((one for one in named if one.effect.is_clock and one.target == target), None)


def _offset_s(clock: Applied) -> float:
    """Return the offset of a clock, its first size."""
    return clock[clock.effect.sizes[0].name]


def logged_correction(pair: Pair, table: Controller) -> Floats:
    """Return what a logged RSI correction moves the joints by (n, 6); rows without an answer hold the last.

    Under a correction the commanded columns stay those of the program and the actual ones move.
    """
    joints = np.zeros((len(table), 6))
    if table.q_correction_rad is not None:
        joints += _held(table.q_correction_rad)
    if table.correction_mm is not None:
        twist = np.zeros((len(table), 6))
        twist[:, :3] = _held(table.correction_mm)
        if table.correction_rad is not None:  # A, B, C turn about z, y, x
            twist[:, 3:] = _held(table.correction_rad)[:, ::-1]
        jacobian = pair.inputs.jacobian[nearest_rows(pair.inputs.time_s, pair.stamps(table))]
        joints += np.linalg.solve(jacobian, twist[:, :, None])[:, :, 0]
    return np.cumsum(joints, axis=0) if pair.run.head.channels.correction == "relative" else joints


def _held(values: Floats) -> Floats:
    """Return the values with the last one before each that is missing; 0 before the first."""
    known = np.isfinite(values)
    row = np.maximum.accumulate(np.where(known, np.arange(len(values))[:, None], -1), axis=0)
    held: Floats = np.take_along_axis(np.nan_to_num(values), np.maximum(row, 0), axis=0)
    return np.where(row >= 0, held, 0.0)
