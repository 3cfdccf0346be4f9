"""One run beside its prediction: which signals there are, on which clock, and what the model is given.

Paths are planned once for all runs of a prediction. A blended corner of a rapid lasts some 5 ms; samples 12
ms apart cut it by tenths of a millimetre, which is no gap: so the prediction is planned again on a finer
grid. Static poses are a run too, each pose one sample, without a time law, a clock or a load. Without a
prediction the log's own commanded joints are the path.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
from hashlib import blake2b
from typing import Any, Self
from weakref import WeakKeyDictionary

import numpy as np

from gcode2krl import robot
from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.blockwise import plan_course
from gcode2krl.cell import Cell, load_cell
from gcode2krl.cell.carried import require_still
from gcode2krl.effects import Applied, Signals, commanded, inputs_of, simulate
from gcode2krl.effects.inputs import Cut, Inputs
from gcode2krl.effects.operators import play
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.compare.interpolation import (
    cubic,
    length_along,
    linear,
    nearest_rows,
    resolution,
    rms,
    running_mean,
    usual_step_s,
)
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.pipeline import plan_motion
from gcode2krl.prediction import Prediction
from gcode2krl.runs import Controller, Measured, Poses, Run
from gcode2krl.tables import Motion, Targets
from gcode2krl.units import MM_PER_M, S_PER_H

_LIMITS = THRESHOLDS.compare
_SAME_S, _SAME_MM = 1e-9, 1e-6
"""Rounding errors of a plan."""


class RememberedPlan:
    """A `Plan` that keeps its last results, of long programs fewer; ``finer`` samples it more often."""

    def __init__(self, plan: Callable[..., Motion], dt_s: float) -> None:
        """Take what plans targets for a cell, sampled every ``dt_s``."""
        self._plan, self._dt_s = plan, dt_s
        self._known: OrderedDict[Any, Motion] = OrderedDict()

    def __call__(self, targets: Targets, cell: Cell) -> Motion:
        """Return the motion of some targets, planned once."""
        key = (
            targets.cdis_mm.tobytes(),
            targets.speed_mm_s.tobytes(),
            targets.wait_s.tobytes(),
            targets.position_mm.tobytes(),
            cell.controller.model_dump_json(),
        )
        if key not in self._known:
            self._known[key] = self._plan(targets, cell, dt_s=self._dt_s)
            rows = sum(map(len, self._known.values()))
            while len(self._known) > 1 and rows > _LIMITS.remembered_plan_rows:
                rows -= len(self._known.popitem(last=False)[1])
        self._known.move_to_end(key)
        return self._known[key]

    def finer(self) -> Self:
        """Return the plan that samples a blended corner of a rapid, some 5 ms, more than once."""
        return type(self)(self._plan, min(self._dt_s, _LIMITS.corner_step_s))


def remembered_plan(prediction: Prediction) -> RememberedPlan | None:
    """Return what plans a prediction's motion anew; None = the effects' own, which knows no joint speeds.

    Joint speed limits cost more than the rest of a plan together; they are left out where none was met.
    """
    dt_s = float(prediction.inputs.get("dt_s", prediction.cell.controller.cycle_s))
    if any(issue.code == "joint-speed" for issue in prediction.issues):
        return RememberedPlan(partial(plan_motion, watches=False), dt_s)
    plan = inputs_of(prediction).plan
    return RememberedPlan(plan.func, dt_s) if isinstance(plan, partial) else None


def with_corners(inputs: Inputs) -> Inputs:
    """Return inputs sampled often enough for corners of rapids; as they are where they were moved since."""
    plan, motion, targets = inputs.plan, inputs.motion, inputs.targets
    if not isinstance(plan, RememberedPlan) or motion is None or targets is None:
        return inputs
    again = plan(targets, inputs.cell)
    if len(again) != len(motion) or not np.allclose(again.time_s, inputs.time_s, atol=_SAME_S):
        return inputs
    if not np.allclose(again.position_mm, inputs.position_mm, atol=_SAME_MM):
        return inputs
    fine = plan.finer()
    return replace(replace(inputs, cut=None, forces=None).moved(fine(targets, inputs.cell)), plan=fine)


class Simulator:
    """Simulates commanded paths and keeps the last ones, of long runs fewer, by what they were planned from.

    One belongs to one prediction, so that its cell and its laws are the same for all that it keeps.
    """

    def __init__(self) -> None:
        self._kept: OrderedDict[Hashable, Signals] = OrderedDict()
        self._rows = 0
        """Of all that are kept."""
        self._digests: WeakKeyDictionary[Inputs, bytes] = WeakKeyDictionary()
        self._fine: dict[bytes, Inputs] = {}

    def commanded(self, inputs: Inputs, applied: Sequence[Applied]) -> Signals:
        """Return the signals of the commanded path with effects at work, clocks included."""
        effects = tuple(
            (effect.effect.name, effect.target, effect.planned, *effect.values.items()) for effect in applied
        )
        if inputs not in self._digests:
            self._digests[inputs] = _digest(inputs)
        key = (self._digests[inputs], effects)
        if key not in self._kept:
            self._kept[key] = commanded(self._with_corners(inputs), applied)
            self._rows += len(self._kept[key].inputs)
            while len(self._kept) > _LIMITS.remembered_paths or (
                len(self._kept) > 1 and self._rows > _LIMITS.remembered_rows
            ):
                self._rows -= len(self._kept.popitem(last=False)[1].inputs)
        return self._kept[key]

    def _with_corners(self, inputs: Inputs) -> Inputs:
        """Return the inputs sampled often enough for corners: of short runs all, of long ones the last."""
        digest = self._digests[inputs]
        if digest not in self._fine:
            fine = with_corners(inputs)
            if fine is inputs:
                return inputs
            if len(fine) > _LIMITS.remembered_rows:
                self._fine.clear()
            self._fine[digest] = fine
        return self._fine[digest]


def _digest(inputs: Inputs) -> bytes:
    """Return a digest of the planned motion: two that agree in it agree in all that is commanded."""
    digest = blake2b(inputs.time_s.tobytes())
    digest.update(inputs.q_cmd_rad.tobytes())
    return digest.digest()


def temperature_at(table: Controller | Poses | None, time_s: Floats) -> Floats | None:
    """Return the logged temperatures (m, c) at times (m,), the ambient last; None where none was logged.

    They change over minutes: gaps are filled linearly, and clocks of tables do not matter.
    """
    if table is None:
        return None
    logged = [each for each in (table.temperature_C, table.ambient_C) if each is not None]
    columns = [column for each in logged for column in each.T if np.isfinite(column).any()]
    known = [np.isfinite(column) for column in columns]
    filled = [
        np.interp(time_s, table.time_s[rows], column[rows])
        for column, rows in zip(columns, known, strict=True)
    ]
    return np.stack(filled, axis=1) if filled else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Pair:
    """A run and the nominal inputs of its chain."""

    run: Run
    number: int
    inputs: Inputs
    from_log: bool = False
    """There is no prediction: the inputs' commanded joints are those of the log."""
    known_robot: bool = True
    """The cell is that of the robot; without it there are no kinematics."""
    still: bool = False
    """The robot stands at each sample: poses, not a motion."""
    simulator: Simulator = field(default_factory=Simulator)
    """Shared by all runs of a prediction."""
    clock_s: Mapping[str, float] = field(default_factory=dict)
    """Offset of each table that is taken off its stamps."""
    fitted: Mapping[str, Floats] = field(default_factory=dict)
    """Signal -> its difference (n, 6) from the signal before it, by a fitted model."""

    @property
    def name(self) -> str:
        """Return the run's name."""
        return self.run.name

    @property
    def has_actual_joints_alone(self) -> bool:
        """Tell whether the log has actual joints and no commanded ones: the plan's stand in for them."""
        table = self.run.controller
        if table is None or table.q_act_rad is None or table.q_cmd_rad is not None:
            return False
        return not self.from_log and self.run.head.angles == "absolute"

    def stamps(self, table: Measured) -> Floats:
        """Return the time stamps of a table less its coarse clock error."""
        return table.time_s - self.clock_s.get(type(table).__name__.lower(), 0.0)

    def later(self, table: str, offset_s: float) -> "Pair":
        """Return the pair with a clock error of ``offset_s`` taken off the stamps of a table."""
        return replace(self, clock_s={**self.clock_s, table: self.clock_s.get(table, 0.0) + offset_s})

    def with_measured_load(
        self, applied: Sequence[Applied] = (), base: Sequence[Applied] = (), *, in_air: bool = False
    ) -> "Pair":
        """Return the pair whose arm is bent by the measured force, for a model of the force that fails.

        The load is the model's with the effects ``base``, and what is measured beside the model with
        ``applied``, averaged over 50 ms: the edges of the cut stay those of the model, where an average of
        the force itself would smear them. It is zero where the cutter is predicted in air, unless ``in_air``.
        """
        table, inputs = self.run.force, self.inputs
        if table is None or inputs.forces is None:
            return self
        own_s = self.stamps(table)
        force_N = in_base(table.force_N, self.run.head.frames.force, inputs, own_s)
        rows = round(_LIMITS.load_smooth_s / usual_step_s(own_s))
        seen = simulate(inputs, applied).force_meas_base_N if applied else inputs.force_base_N
        bending = simulate(inputs, base).force_base_N if base else inputs.force_base_N
        off_N = running_mean(force_N - linear(own_s, inputs.time_s, seen), rows)
        load = bending + linear(inputs.time_s, own_s, off_N)
        if not in_air:
            load[~inputs.force_base_N.any(axis=1)] = 0.0
        return replace(self, inputs=replace(inputs, load_base_N=load))

    def with_measured_joints(self, upto: str) -> "Pair":
        """Return the pair with what the controller measured in place of the model: q_cmd, q_act or q_load.

        Only the differences between neighbouring signals are interpolated, which are small and smooth.
        """
        table, inputs = self.run.controller, self.inputs
        if table is None:
            return self
        commanded_rad = self._commanded_rad(table)
        if upto == "q_cmd":
            return replace(self, inputs=replace(inputs, q_cmd_rad=commanded_rad))
        actual_rad = None
        if table.q_act_rad is not None:
            actual_rad = commanded_rad + self._difference(table, "q_act_rad", table.q_cmd_rad)
        if upto == "q_act" or table.q_load_rad is None:
            return replace(self, inputs=replace(inputs, q_act_rad=actual_rad))
        before_rad = commanded_rad
        if actual_rad is not None:
            before_rad = np.where(np.isnan(actual_rad), commanded_rad, actual_rad)
        load_rad = before_rad + self._difference(table, "q_load_rad", table.q_act_rad)
        return replace(self, inputs=replace(inputs, q_act_rad=actual_rad, q_load_rad=load_rad))

    def _commanded_rad(self, table: Controller) -> Floats:
        """Return the planned joints (m, 6), or the logged ones where these are another path."""
        inputs = self.inputs
        if table.q_cmd_rad is None or self.from_log:
            return inputs.q_cmd_rad
        stamps = self.stamps(table)
        difference = np.nan_to_num(table.q_cmd_rad - cubic(stamps, inputs.time_s, inputs.q_cmd_rad))
        if rms(difference) <= _LIMITS.same_path_rad:
            return inputs.q_cmd_rad
        return inputs.q_cmd_rad + linear(inputs.time_s, stamps, difference)

    def _difference(self, table: Controller, signal: str, before_rad: Floats | None) -> Floats:
        """Return a signal less the one before it (m, 6), by its fitted model where there is one.

        NaN for joints without that signal.
        """
        inputs, stamps = self.inputs, self.stamps(table)
        difference = self.fitted.get(signal)
        measured: Floats = getattr(table, signal)
        if difference is None:
            reference = cubic(stamps, inputs.time_s, inputs.q_cmd_rad) if before_rad is None else before_rad
            difference = measured - reference
        apart = cubic(inputs.time_s, stamps, np.nan_to_num(difference))
        apart[:, np.isnan(measured).all(axis=0)] = np.nan
        return apart


def axes_of(frame: str, inputs: Inputs, times_s: Floats) -> Floats:
    """Return the rotations (n, 3, 3) in ``$BASE`` of a frame, tcp or sensor, at some times."""
    turn = inputs.sensor_rotation if frame == "sensor" else inputs.tool_rotation
    return turn[nearest_rows(inputs.time_s, times_s)]


def in_base(vectors: Floats, frame: str, inputs: Inputs, times_s: Floats) -> Floats:
    """Return vectors (n, 3) along the axes of a frame, at some times, along those of ``$BASE``."""
    if frame == "base":
        return vectors
    turned: Floats = np.einsum("nij,nj->ni", axes_of(frame, inputs, times_s), vectors)
    return turned


def from_base(vectors: Floats, frame: str, inputs: Inputs, times_s: Floats) -> Floats:
    """Return vectors (n, 3) along ``$BASE``, at some times, along the axes of a frame."""
    if frame == "base":
        return vectors
    turned: Floats = np.einsum("nji,nj->ni", axes_of(frame, inputs, times_s), vectors)
    return turned


def force_jumps(inputs: Inputs) -> Bools:
    """Return at which samples (m,) the predicted force is about to jump."""
    if not inputs.force_base_N.any():
        return np.zeros(len(inputs), dtype=np.bool_)
    later_N = linear(inputs.time_s + _LIMITS.jump_s, inputs.time_s, inputs.force_base_N)
    largest_N = float(np.linalg.norm(inputs.force_base_N, axis=1).max(initial=0.0))
    jumps: Bools = np.linalg.norm(later_N - inputs.force_base_N, axis=1) > _LIMITS.jump_share * largest_N
    return jumps


def usable_rows(table: Measured, stamps: Floats, inputs: Inputs, ends_s: float = 0.0) -> tuple[Ints, Ints]:
    """Return the rows (n,) of a table within the model's time, and their segments (s, 2).

    ``ends_s``: so near to its ends a row is left out; a model that begins in motion is not known before.
    """
    first, last = inputs.time_s[0] + ends_s, inputs.time_s[-1] - ends_s
    rows = np.flatnonzero((stamps >= first) & (stamps <= last))
    segments: Ints = np.searchsorted(rows, table.segments).reshape(-1, 2)
    return rows, segments[segments[:, 1] > segments[:, 0]]


def is_of_poses(run: Run) -> bool:
    """Tell whether a run is one of static poses; beside a tracker's table they are not looked at."""
    return run.poses is not None and run.tracker is None and run.controller is None


def pose_pair(run: Run, number: int, cell: Cell, hours: float, known_robot: bool = True) -> Pair:
    """Return a run of poses beside the robot's own kinematics: no motion is planned between them."""
    table = run.poses
    if table is None:
        raise ValueError("a run of poses has a table of them")
    is_placed = known_robot and run.head.angles == "absolute"
    inputs = replace(
        _unplanned(cell, table.time_s, table.q_rad, is_placed),
        hours=hours,
        temperature_C=temperature_at(table, table.time_s),
    )
    return Pair(run=run, number=number, inputs=inputs, from_log=True, known_robot=known_robot, still=True)


def _unplanned(cell: Cell, time_s: Floats, q_rad: Floats, is_placed: bool) -> Inputs:
    """Return inputs of joints (n, 6) that no program has planned, without forces.

    ``is_placed``: the robot and the zeros of its joints are known; else the tip stays at the origin.
    """
    count, tool = len(q_rad), cell.usual_tool or 1
    position, rotation = np.zeros((count, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    if is_placed:
        position, rotation = robot.forward(q_rad, cell, tool)
    return Inputs(
        cell=cell,
        time_s=time_s,
        move=np.zeros(count, dtype=np.int32),
        source_line=np.zeros(count, dtype=np.int32),
        path_mm=length_along(position),
        tool=np.full(count, tool, dtype=np.int32),
        spindle_rad_s=np.zeros(count),
        q_cmd_rad=q_rad,
        position_mm=position,
        rotation=rotation,
        force_base_N=np.zeros((count, 3)),
        moment_base_Nmm=np.zeros((count, 3)),
    )


def refined_prediction(prediction: Prediction) -> Prediction:
    """Return the prediction sampled every 4 ms, the material removed again; as it is where finer."""
    motion = prediction.motion
    if motion is None or len(motion) < 3 or prediction.joints is None:
        return prediction
    if usual_step_s(motion.time_s) <= _LIMITS.fine_step_s * 1.01:
        return prediction
    try:
        targets, cell = prediction.targets, prediction.cell
        kept = plan_course(targets, cell, _LIMITS.fine_step_s, keeps=True, watches=False).samples()
        fine = kept.motion
        again = cubic(motion.time_s, fine.time_s, fine.position_mm)
        apart = np.linalg.norm(again - motion.position_mm, axis=1)
        if rms(apart) > _LIMITS.fine_same_mm:
            return prediction
        joints = kept.joints(cell)
        forces = None
        if prediction.forces is not None:
            from gcode2krl.cutting import cut

            forces = cut(prediction.toolpath, fine, cell)
    except Gcode2KrlError:
        return prediction
    inputs = {**prediction.inputs, "dt_s": _LIMITS.fine_step_s}
    return replace(
        prediction, motion=fine, joints=joints, forces=forces, deflection=None, inputs=inputs, clearance=None
    )


def pairs_of(prediction: Prediction, runs: Sequence[Run]) -> Iterator[Pair]:
    """Yield each run beside its prediction: the one that its ``run.toml`` names, else the given one.

    Raises an input error where a run is of another program than its prediction.
    """
    first = first_start(runs)
    shared: dict[str, tuple[Inputs, Simulator]] = {}
    for number, run in enumerate(runs):
        if is_of_poses(run):
            yield pose_pair(run, number, prediction.cell, hours_since(first, run))
            continue
        folder = run.path("prediction")
        named = folder is not None and folder.exists()
        key = str(folder.resolve()) if named and folder else ""  # runs name it from where they are
        if key not in shared:
            shared[key] = _shared(Prediction.load(folder) if named and folder else prediction)
        inputs, simulator = shared[key]
        temperature_C = temperature_at(run.controller, inputs.time_s)
        of_run = replace(inputs, hours=hours_since(first, run), temperature_C=temperature_C)
        yield Pair(run=run, number=number, inputs=of_run, simulator=simulator)


def _shared(prediction: Prediction) -> tuple[Inputs, Simulator]:
    fine = refined_prediction(prediction)
    return inputs_of(fine, plan=remembered_plan(fine), cut=_cut_of(fine)), Simulator()


def _cut_of(prediction: Prediction) -> Cut | None:
    """Return what cuts the part again for its mean forces; None where none are predicted."""
    if prediction.forces is None:
        return None
    from gcode2krl.cutting import mean_cut

    return partial(mean_cut, prediction.toolpath)


def first_start(runs: Sequence[Run]) -> datetime | None:
    """Return when the earliest of the runs started; None where no run says."""
    return min((run.head.started for run in runs if run.head.started is not None), default=None)


def hours_since(first: datetime | None, run: Run) -> float:
    """Return the hours from the first start to that of a run; 0 where one is not known."""
    if first is None or run.head.started is None:
        return 0.0
    return (run.head.started - first).total_seconds() / S_PER_H


def with_own_model(pair: Pair) -> Pair:
    """Return the pair with what a controller's own model of the robot adds to the planned joints.

    The addition is taken to be a polynomial of second degree in the six angles (an assumption), fitted by
    least squares together with the offset of the table's clock.
    """
    table, inputs = pair.run.controller, pair.inputs
    if table is None or table.q_cmd_rad is None or pair.from_log:
        return pair
    offset_s, values = 0.0, np.zeros((1, 6))
    for _ in range(_LIMITS.own_model_steps):
        stamps = pair.stamps(table) - offset_s
        wanted, before, after = (
            cubic(stamps + s, inputs.time_s, inputs.q_cmd_rad)
            for s in (0.0, -_LIMITS.rate_step_s, _LIMITS.rate_step_s)
        )
        rate = (after - before) / (2.0 * _LIMITS.rate_step_s)
        terms = _of_second_degree(wanted, inputs.q_cmd_rad)
        difference = np.nan_to_num(table.q_cmd_rad - wanted)
        fitted = np.linalg.lstsq(terms, np.concatenate([difference, rate], axis=1), rcond=1e-8)[0]
        late = difference - terms @ fitted[:, :6]
        moves = rate - terms @ fitted[:, 6:]
        step_s = -float(np.sum(late * moves)) / max(float(np.sum(moves**2)), 1e-30)
        offset_s, values = offset_s + step_s, fitted[:, :6] + step_s * fitted[:, 6:]
    added = _of_second_degree(inputs.q_cmd_rad, inputs.q_cmd_rad) @ values
    inputs = replace(inputs, q_cmd_rad=inputs.q_cmd_rad + added)
    return replace(pair.later("controller", offset_s), inputs=inputs)


def with_nominal_joints(pair: Pair) -> Pair:
    """Return the pair with the planned joints in its controller's table; the drives' errors stay in it.

    For a controller whose own model of the robot makes its joints differ from the plan while its tip is where
    it was commanded. Clocks must have been set before.
    """
    table = pair.run.controller
    if table is None or table.q_cmd_rad is None or pair.from_log:
        return pair
    wanted = cubic(pair.stamps(table), pair.inputs.time_s, pair.inputs.q_cmd_rad)
    difference = np.nan_to_num(table.q_cmd_rad - wanted)
    nominal = replace(
        table,
        q_cmd_rad=table.q_cmd_rad - difference,
        q_act_rad=None if table.q_act_rad is None else table.q_act_rad - difference,
        q_load_rad=None if table.q_load_rad is None else table.q_load_rad - difference,
    )
    return replace(pair, run=replace(pair.run, controller=nominal))


def _of_second_degree(q_rad: Floats, among_rad: Floats) -> Floats:
    """Return 1, angles and their products (n, 28) of poses (n, 6), in units of the spread among others."""
    spread = np.maximum(among_rad.std(axis=0), 1e-9)
    q = (q_rad - among_rad.mean(axis=0)) / spread
    first, second = np.triu_indices(q.shape[1])
    return np.concatenate([np.ones((len(q), 1)), q, q[:, first] * q[:, second]], axis=1)


def log_pairs(runs: Sequence[Run], cell: Cell | None) -> list[Pair]:
    """Return a pair for each run that has a controller's table, or poses."""
    first, known_robot = first_start(runs), cell is not None
    cell = load_cell() if cell is None else cell
    require_still(cell, "a diagnosis of logs")
    pairs = []
    for number, run in enumerate(runs):
        if is_of_poses(run):
            pairs.append(pose_pair(run, number, cell, hours_since(first, run), known_robot))
            continue
        inputs = _inputs(run, cell, hours_since(first, run), known_robot)
        if inputs is not None:
            pairs.append(Pair(run=run, number=number, inputs=inputs, from_log=True, known_robot=known_robot))
    return pairs


def _inputs(run: Run, cell: Cell, hours: float, known_robot: bool) -> Inputs | None:
    table = run.controller
    if table is None:
        return None
    path = next((q for q in (table.q_cmd_rad, table.q_act_rad, table.q_load_rad) if q is not None), None)
    if path is None:
        return None
    time_s, logged = _often_enough(table.time_s), np.nan_to_num(path)
    # a commanded angle that stands flickers by its last decimal, which is no reversal
    still = [resolution(column) * np.sqrt(12.0) for column in logged.T]
    between = cubic(time_s, table.time_s, logged)
    q = np.stack([play(column, width) for column, width in zip(between.T, still, strict=True)], axis=1)
    is_placed = known_robot and run.head.angles == "absolute" and bool(np.isfinite(path).all())
    inputs = _unplanned(cell, time_s, q, is_placed)
    if is_placed and run.force is not None:
        force_N = linear(time_s, run.force.time_s, run.force.force_N)
        force_N = in_base(force_N, run.head.frames.force, inputs, time_s)
        inputs = replace(inputs, force_base_N=force_N)
    torque_Nm = _torque_Nm(table)
    return replace(
        inputs,
        hours=hours,
        torque_Nm=None if torque_Nm is None else linear(time_s, table.time_s, torque_Nm),
        temperature_C=temperature_at(table, time_s),
    )


def _often_enough(time_s: Floats) -> Floats:
    """Return the times of a log with others between them where a drive's lag would miss what lies there.

    A lag of 12 ms that is filtered over lines between samples of 12 ms is off by a hundredth of itself.
    """
    parts = int(np.ceil(np.median(np.diff(time_s)) / _LIMITS.fine_step_s - 1e-6))
    if parts < 2:
        return time_s
    shares = np.arange(parts) / parts
    between: Floats = (time_s[:-1, None] + np.diff(time_s)[:, None] * shares).ravel()
    return np.append(between, time_s[-1])


def _torque_Nm(table: Controller) -> Floats | None:
    """Return the logged torque (n, 6) or, in its place, the current; None where there is neither."""
    if table.torque_Nmm is not None:
        return np.nan_to_num(table.torque_Nmm / MM_PER_M)
    return None if table.current_A is None else np.nan_to_num(table.current_A)
