"""The links of the measuring chain, in its order: timing, path, servo, gear, force, mechanics, part.

**Part.** A point of the finished part belongs to a floor, under the lowest tip that has passed over it, or to
a wall, a cutter's radius beside the nearest tip below it. The tip is the model's, corrected by the tracker
where there is one, so that a bent arm is not taken for another cutter. A shift of the part and the height of
its floors are not findings here: they are those of frames, which the tip shows better.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied, Inputs, Signals, drives, forces, simulate
from gcode2krl.effects.mismatch import Mismatch, sigma
from gcode2krl.effects.operators import play
from gcode2krl.gap.compare.clocks import refined, retimed, with_table_clock
from gcode2krl.gap.compare.interpolation import cubic, hats, linear, nearest_rows, running_mean, usual_step_s
from gcode2krl.gap.compare.pair import (
    Pair,
    axes_of,
    force_jumps,
    usable_rows,
    with_nominal_joints,
    with_own_model,
)
from gcode2krl.gap.compare.trace import Context, FittedVerdict, Link, Trace, Verdict, is_lost, with_rows
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs import Controller, Measured
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG

CLOCK, ENCODER_ZERO, PLAY_START = "table clock", "encoder zero", "start of play"
"""Names of several words, so that no effect can have such a name."""
ROUGH = 1e3
"""Standard deviation of a quantity that is never reported, however large, in units of its bound."""
_KNOTS_S, _MOST_KNOTS = 1.0, 120


def _stacked(values: Floats) -> Floats:
    return np.ascontiguousarray(values.T)


def constants(trace: Trace) -> Floats:
    """Return (k, n, k): column j is one in component j."""
    n, k = trace.shape
    return np.repeat(np.eye(k)[:, None, :], n, axis=1)


def component_columns(values: Floats) -> Floats:
    """Return (k, n, k): column j is component j alone."""
    n, k = values.shape
    columns = np.zeros((k, n, k))
    for j in range(k):
        columns[j, :, j] = values[:, j]
    return columns


def play_start_columns(trace: Trace, mismatch: Mismatch) -> Floats:
    """Return (k, n, k): where in its play each joint stands when the run begins, even between its ends.

    Until the play has been crossed once (Krasnosel'skii and Pokrovskii 1989); that it is even is assumed.
    """
    inputs, half_rad = trace.inputs, mismatch.play_rad / 2.0
    rows = nearest_rows(inputs.time_s, trace.time_s)
    motor_rad = (inputs.q_cmd_rad if inputs.q_act_rad is None else inputs.q_act_rad)[rows]
    # a row before the first one puts the joint at the end of its play
    at_end = np.vstack([motor_rad[:1] + half_rad, motor_rad])
    begun = [play(at_end[:, j], half_rad)[1:] - play(motor_rad[:, j], half_rad) for j in trace.columns]
    begun_rad = np.nan_to_num(np.stack(begun, axis=1))  # joints without an encoder
    return component_columns(begun_rad * sigma(1.0))


def force_zero_columns(trace: Trace) -> Floats:
    """Return a unit force along each axis of the sensor, in the frame of the measured values."""
    if trace.frame != "base":
        return constants(trace)
    turned = axes_of("sensor", trace.inputs, trace.time_s)
    return np.ascontiguousarray(np.moveaxis(turned, 0, 1))


def frame_columns(trace: Trace, mismatch: Mismatch) -> Floats:
    """Return a shift along and a small turn about each axis of ``$BASE``, about the path's middle."""
    position = trace.nominal
    turned = np.zeros((3, len(position), 6))
    for axis in range(3):
        turned[axis, :, axis] = sigma(mismatch.frame_mm)
    arm = position - position.mean(axis=0)
    for axis in range(3):
        turn = np.cross(np.eye(3)[axis], arm)
        turned[:, :, 3 + axis] = turn.T * sigma(mismatch.frame_rad)
    return turned


def load_columns(trace: Trace, mismatch: Mismatch) -> Floats:
    """Return what the zero and the gain of a sensor do to a tip whose arm the measured force bends."""
    inputs = trace.inputs
    load_N = inputs.load_base_N
    assert load_N is not None
    bends = np.any(load_N, axis=1, keepdims=True)
    columns = []
    for axis in np.moveaxis(inputs.sensor_rotation, 2, 0):
        along_N = np.sum(axis * load_N, axis=1, keepdims=True)
        for more_N in (sigma(mismatch.force_zero_N) * bends, sigma(mismatch.sensor_gain) * along_N):
            off = replace(trace, inputs=replace(inputs, load_base_N=load_N + axis * more_N))
            columns.append(_stacked(off.nominal - trace.nominal))
    return np.stack(columns, axis=2)


def clock_columns(trace: Trace, mismatch: Mismatch) -> Floats:
    """Return (k, n, 1): what the clock of the table does to the signal, to first order."""
    return -_stacked(trace.clock_rate)[:, :, None] * sigma(mismatch.clock_s)


def time_law_columns(trace: Trace, mismatch: Mismatch) -> Floats:
    """Return (k, n, c): the signal's rate times hats over time, for a time law that is slightly off."""
    start, end = trace.time_s[0], trace.time_s[-1]
    knots = np.linspace(start, end, max(2, min(round((end - start) / _KNOTS_S), _MOST_KNOTS) + 1))
    columns: Floats = -_stacked(trace.rate)[:, :, None] * hats(trace.time_s, knots)
    return columns * sigma(mismatch.clock_s)


_LIMITS = THRESHOLDS.compare

JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6")


def joint_trace(
    link: Link,
    pair: Pair,
    table: Controller,
    values: Floats,
    plus: str,
    minus: str | None,
    *,
    base: Sequence[Applied] = (),
    sigma_rad: float | None = None,
) -> Trace | None:
    """Return the values (n, 6) of the joints that were recorded and move; None where there is none.

    ``plus`` less ``minus`` are the signals of the model; ``sigma_rad`` is the stated noise.
    """
    columns = np.flatnonzero(np.isfinite(values).all(axis=0) & _moves(table)).tolist()
    names = [JOINTS[column] for column in columns]
    trace = _trace(link, pair, table, values[:, columns], DEG_PER_RAD, names, columns, plus, base, sigma_rad)
    return replace(trace, minus=minus) if columns and len(trace.time_s) else None


def _trace(
    link: Link,
    pair: Pair,
    table: Measured,
    values: Floats,
    factor: float,
    components: Sequence[str],
    columns: Sequence[int],
    plus: str,
    base: Sequence[Applied],
    sigma: float | None,
) -> Trace:
    """Return the usable rows of values (n, k) of a table."""
    stamps = pair.stamps(table)
    # a log alone may begin in motion: near to its ends its model is not known
    ends_s = _LIMITS.log_ends_s if pair.from_log and not pair.still else 0.0
    rows, segments = usable_rows(table, stamps, pair.inputs, ends_s)
    return Trace(
        link=link,
        run=pair.name,
        run_number=pair.number,
        factor=factor,
        components=tuple(components),
        columns=tuple(columns),
        plus=plus,
        inputs=pair.inputs,
        simulator=pair.simulator,
        base=tuple(base),
        time_s=stamps[rows],
        measured=values[rows],
        segments=segments,
        declared_sigma=sigma,
    )


def _moves(table: Controller) -> Bools:
    """Return which joints (6,) ever move, by whatever of them is recorded; a joint at rest tells nothing."""
    moving = np.zeros(6, dtype=np.bool_)
    for values in (table.q_cmd_rad, table.q_act_rad):
        if values is not None:
            moving |= np.nan_to_num(np.ptp(values, axis=0)) > _LIMITS.joint_moves_rad
    return moving


def vector_trace(
    link: Link,
    pair: Pair,
    table: Measured,
    values: Floats,
    plus: str,
    *,
    base: Sequence[Applied] = (),
    frame: str = "base",
    sigma: float | None = None,
) -> Trace:
    """Return the values (n, 3) along the axes of ``frame`` (base, tcp, sensor), jumps of the force left out.

    ``plus`` is the signal of the model; ``sigma`` is the stated noise.
    """
    trace = _trace(link, pair, table, values, 1.0, "xyz", range(3), plus, base, sigma)
    trace = with_rows(trace, ~at_edges(pair.inputs, trace.time_s))
    return replace(trace, frame=frame, still=pair.still)


def at_edges(inputs: Inputs, time_s: Floats) -> Bools:
    """Return where (n,) the predicted force jumps, some hundredths of a second around it.

    Removal finds an edge of the cut to a sample; within it the force is right or wrong by all of itself.
    """
    jumps = inputs.time_s[force_jumps(inputs)] + _LIMITS.jump_s / 2.0
    jumps = np.concatenate([[-np.inf], jumps, [np.inf]])
    after = np.searchsorted(jumps, time_s)
    nearest = np.minimum(jumps[after] - time_s, time_s - jumps[after - 1])
    near: Bools = nearest < _LIMITS.jump_left_out_s
    return near


class TimingLink(Link):
    """What of the path link lies along the motion, as time; it has no trace of its own."""

    name = "timing"
    signal = "timing"
    unit = "s"
    needs = "controller.csv with q1_cmd_deg …, and a prediction"


class PathLink(Link):
    """The commanded joints of the log against the predicted ones; timing is what lies along the motion."""

    name = "path"
    signal = "joint_commanded"
    unit = "deg"
    needs = "controller.csv with q1_cmd_deg …, and a prediction"
    of_joints = True
    model_rms = _LIMITS.model_rad
    tells_time = True
    least_off = _LIMITS.progress_off_rad
    least_step = _LIMITS.progress_step_rad

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> Trace | None:
        """Return the commanded joints of a run with a prediction."""
        table = pair.run.controller
        if table is None or table.q_cmd_rad is None or pair.from_log or pair.run.head.angles == "relative":
            return None
        # joints alone: what plans anew need not remove the material again
        pair = replace(pair, inputs=replace(pair.inputs, cut=None, forces=None))
        return joint_trace(
            self, pair, table, table.q_cmd_rad, "q_cmd_rad", None, base=base, sigma_rad=_LIMITS.model_rad
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
        return _LIMITS.clock_set_share if context.clocks_set else 1.0

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
    if abs(offset_s - _offset_s(of_columns)) > _LIMITS.clocks_of_two * context.mismatch.clock_s:
        return context
    freed = (pair.later("controller", -offset_s) for pair in context.pairs)
    return context.without_cause(path, of_table).with_pairs(freed)


def _clock(judged: Verdict | None, target: str) -> Applied | None:
    """Return the named clock of a table or of columns."""
    named = judged.applied if judged is not None else ()
    return next((applied for applied in named if applied.effect.is_clock and applied.target == target), None)


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


class ForceLink(Link):
    """The measured force against the predicted one."""

    name = "force"
    signal = "force"
    unit = "N"
    needs = "force.csv, and a prediction with forces"
    table = "force"

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> Trace | None:
        """Return the force of a run with a prediction, along the axes in which it is stated."""
        table, head = pair.run.force, pair.run.head
        if table is None or pair.from_log:
            return None
        return vector_trace(
            self,
            pair,
            table,
            table.force_N,
            "force_meas_base_N",
            base=base,
            frame=head.frames.force,
            sigma=head.noise.force_N,
        )

    def simulated(self, trace: Trace, applied: Sequence[Applied]) -> Signals:
        """Return the forces and their clock: a tip need not be computed."""
        return forces(trace.inputs, applied)

    def mismatch(self, trace: Trace, mismatch: Mismatch) -> Iterator[tuple[str, Floats]]:
        """Yield the zero and the gain of the force sensor."""
        yield "force zero", force_zero_columns(trace) * sigma(mismatch.force_zero_N)
        yield "sensor gain", component_columns(trace.nominal) * sigma(mismatch.sensor_gain)

    def learn(self, context: Context, judged: FittedVerdict) -> Context:
        """Let the named causes bend the arm."""
        learned = (applied.effect.learned(applied, self.name) for applied in judged.applied)
        return context.with_learned(applied for applied in learned if applied is not None)


class MechanicsLink(Link):
    """The tip against FK(joints) + C(q)·F."""

    name = "mechanics"
    signal = "tcp"
    unit = "mm"
    of_tip = True
    needs = "tracker.csv, absolute angles and a known robot"
    table = "tracker"
    sets_clocks = True
    least_off = THRESHOLDS.compare.progress_off_mm
    least_step = THRESHOLDS.compare.progress_step_mm

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> Trace | None:
        """Return the tip, beside the model from the measured joints."""
        run, head = pair.run, pair.run.head
        table = run.poses if pair.still else run.tracker
        if table is None or not pair.known_robot or (pair.from_log and head.angles == "relative"):
            return None
        pair = pair.with_measured_joints("q_load")
        return vector_trace(
            self,
            pair,
            table,
            table.position_mm,
            "tcp_base_mm",
            base=base,
            frame=head.frames.tracker,
            sigma=head.noise.tcp_mm,
        )

    def traces(self, pairs: Iterable[Pair], base: Sequence[Applied] = ()) -> list[Trace]:
        """Return the tips of all runs; of motions alone where some runs are of poses, whose noise differs."""
        traces = super().traces(pairs, base)
        return [trace for trace in traces if not trace.still] or traces

    def planned(self, inputs: Inputs) -> Floats:
        """Return the commanded tip (m, 3)."""
        return inputs.position_mm

    def base(self, context: Context) -> tuple[Applied, ...]:
        """Return slips and what the force has shown: both move the tip."""
        return (*context.slips, *context.learned)

    def clocks(self, context: Context) -> int:
        """Return two where the joints are on the controller's clock, which no path has set."""
        on_two = not context.has_data(PathLink.name) and context.has_data(ServoLink.name)
        return max(super().clocks(context), 2 if on_two else 1)

    def mismatch(self, trace: Trace, mismatch: Mismatch) -> Iterator[tuple[str, Floats]]:
        """Yield the frame in which the tracker states the tip, and the sensor of a measured load."""
        yield "tracker frame", frame_columns(trace, mismatch)
        if trace.inputs.load_base_N is not None:
            yield "sensor of the load", load_columns(trace, mismatch)

    def has_time_law(self, unmeasured: frozenset[str]) -> bool:
        """Tell whether the commanded path is not measured, so that the tip shows its time law."""
        return PathLink.name in unmeasured


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """The points of one run that belong to a floor or a wall of the part; z is along the tool's axis."""

    deviation: Floats
    """(n,) in mm from the nominal surface; positive where material beyond it is removed."""
    wall: Bools
    normal: Floats
    """(n, 3) from the surface towards the tip."""
    deflection: Floats
    """(n,) of the tip along the normal."""
    place: Floats
    """(n, 3)"""


class SurfaceLink(Link):
    """The scanned part against the surface that the tip has swept; its signal is a place, not a time."""

    name = "part"
    signal = "scan"
    unit = "mm"
    needs = "scan.csv with walls that the cutter has left, a prediction with forces, one tool axis"

    def base(self, context: Context) -> tuple[Applied, ...]:
        """Return slips and what the force has shown: both move the tip."""
        return (*context.slips, *context.learned)

    def points(self, pair: Pair, base: Sequence[Applied] = ()) -> SurfacePoints | None:
        """Return the scanned points of a run with a prediction; None without a scan or if the tool turns."""
        scan, inputs = pair.run.scan, pair.inputs
        if scan is None or not pair.known_robot or pair.from_log:
            return None
        axis = inputs.tool_rotation[:, :, 2]
        cuts: Bools = np.any(inputs.force_base_N, axis=1)
        if not cuts.any() or np.ptp(axis, axis=0).max() > _LIMITS.scan_straight:
            return None
        turn = _upright(-axis[0] if axis[0, 2] < 0.0 else axis[0])
        tip, bent = (values[cuts] @ turn.T for values in _tips(pair, base))
        tools = [inputs.cell.tool[int(number)] for number in inputs.tool[cuts]]
        radius = np.array([tool.diameter_mm / 2.0 for tool in tools])
        # heights above the tip from which the cutters have their whole radius
        corner = np.array([tool.corner_radius_mm for tool in tools])
        corner = np.where([tool.kind == "ball" for tool in tools], radius, corner)
        points = scan.position_mm @ turn.T
        feet = [_foot(point, tip, radius, corner) for point in points]
        kept = [foot for foot in feet if foot is not None]
        if len(kept) < _LIMITS.scan_least_points:
            return None
        normal = np.array([foot.normal for foot in kept])
        return SurfacePoints(
            deviation=np.array([foot.deviation for foot in kept]),
            wall=np.array([foot.is_wall for foot in kept]),
            normal=normal,
            deflection=np.sum(bent[[foot.row for foot in kept]] * normal, axis=1),
            place=points[[foot is not None for foot in feet]],
        )


class _Foot(NamedTuple):
    """The point of the swept surface below or beside a scanned one."""

    deviation: float
    is_wall: bool
    normal: Floats
    row: int
    """Of the tip that has cut it."""


def _foot(point: Floats, path: Floats, radius: Floats, corner: Floats) -> _Foot | None:
    """Return the foot of a point on a floor or a wall; None where it belongs to neither."""
    offset = path[:, :2] - point[:2]
    away = np.hypot(offset[:, 0], offset[:, 1])
    over = np.flatnonzero(away < radius - corner - _LIMITS.scan_inside_mm)
    if len(over):
        row = int(over[np.argmin(path[over, 2])])
        low = float(path[row, 2] - point[2])
        return _Foot(low, False, np.array([0.0, 0.0, 1.0]), row) if abs(low) < _LIMITS.scan_reach_mm else None
    below = np.flatnonzero(path[:, 2] + corner < point[2] - _LIMITS.scan_above_mm)
    if not len(below):
        return None
    row = int(below[np.argmin(away[below] - radius[below])])
    far = float(away[row] - radius[row])
    if abs(far) > _LIMITS.scan_reach_mm:
        return None
    return _Foot(far, True, np.array([*(offset[row] / away[row]), 0.0]), row)


def _tips(pair: Pair, base: Sequence[Applied]) -> tuple[Floats, Floats]:
    """Return the tips (m, 3) and how far the model bends them (m, 3)."""
    inputs, table = pair.inputs, pair.run.tracker
    tip = simulate(inputs, list(base)).tip_on_part_mm
    bent = inputs.deflection_mm
    if table is None or pair.run.head.frames.tracker != "base":
        return tip, bent
    own_s = pair.stamps(table)
    offset = table.position_mm - linear(own_s, inputs.time_s, tip)
    smooth = running_mean(offset, round(_LIMITS.scan_smooth_s / usual_step_s(own_s)))
    return tip + linear(inputs.time_s, own_s, smooth), np.zeros_like(bent)


def _upright(up: Floats) -> Floats:
    """Return a rotation (3, 3) that turns a direction to z."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = helper - up * float(helper @ up)
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(up, x), up])


TIMING, PATH, SERVO, GEAR = TimingLink(), PathLink(), ServoLink(), GearLink()
FORCE, MECHANICS, PART = ForceLink(), MechanicsLink(), SurfaceLink()
LINKS: tuple[Link, ...] = (TIMING, PATH, SERVO, GEAR, FORCE, MECHANICS, PART)
SIGNALS: tuple[Link, ...] = (PATH, SERVO, GEAR, FORCE, MECHANICS)
"""Those with a signal in time and a model of their own."""
