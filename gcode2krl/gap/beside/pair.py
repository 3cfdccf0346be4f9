"""One run beside its prediction: which signals there are, on which clock, and what the model is given."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied, Inputs, simulate
from gcode2krl.gap.beside.interpolation import cubic, linear, nearest_rows
from gcode2krl.gap.beside.simulator import Simulator
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs import Controller, Measured, Run

LIMITS = THRESHOLDS.beside


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
        stamps: Floats = table.time_s - self.clock_s.get(type(table).__name__.lower(), 0.0)
        return stamps

    def later(self, table: str, offset_s: float) -> "Pair":
        """Return the pair with a clock error of ``offset_s`` taken off the stamps of a table."""
        return replace(self, clock_s={**self.clock_s, table: self.clock_s.get(table, 0.0) + offset_s})

    def with_measured_load(self, applied: Sequence[Applied] = (), base: Sequence[Applied] = ()) -> "Pair":
        """Return the pair whose arm is bent by the measured force, for a model of the force that fails.

        The load is the model's with the effects ``base``, and what is measured beside the model with
        ``applied``, averaged over 50 ms: the edges of the cut stay those of the model, where an average of
        the force itself would smear them. It is zero where the cutter is predicted in air.
        """
        table, inputs = self.run.force, self.inputs
        if table is None or inputs.forces is None:
            return self
        own_s, force_N = self.stamps(table), table.force_N
        frame = self.run.head.frames.force
        if frame in ("sensor", "tcp"):
            turn = inputs.sensor_rotation if frame == "sensor" else inputs.tool_rotation
            force_N = np.einsum("nij,nj->ni", turn[nearest_rows(inputs.time_s, own_s)], force_N)
        rows = round(LIMITS.load_smooth_s / float(np.median(np.diff(own_s))))
        seen = simulate(inputs, applied).force_meas_base_N if applied else inputs.force_base_N
        bending = simulate(inputs, base).force_base_N if base else inputs.force_base_N
        beside = linear(inputs.time_s, own_s, _smooth(force_N - linear(own_s, inputs.time_s, seen), rows))
        load = bending + beside
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
        if float(np.sqrt(np.mean(difference**2))) <= LIMITS.same_path_rad:
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


def _smooth(values: Floats, rows: int) -> Floats:
    """Return the mean of ``rows`` neighbours of each row of (n, c)."""
    kernel = np.ones(max(rows, 1))
    count = np.convolve(np.ones(len(values)), kernel, mode="same")
    found: Floats = np.stack([np.convolve(v, kernel, mode="same") / count for v in values.T], axis=1)
    return found


def usable_rows(table: Measured, stamps: Floats, inputs: Inputs, ends_s: float = 0.0) -> tuple[Ints, Ints]:
    """Return the rows (n,) of a table within the model's time, and their segments (s, 2).

    ``ends_s``: so near to its ends a row is left out; a model that begins in motion is not known before.
    """
    first, last = inputs.time_s[0] + ends_s, inputs.time_s[-1] - ends_s
    inside = (stamps >= first) & (stamps <= last)
    rows = np.flatnonzero(inside)
    edges = []
    for start, end in table.segments:
        within = np.searchsorted(rows, [start, end])
        if within[1] > within[0]:
            edges.append(within)
    segments = np.array(edges, dtype=np.int64).reshape(-1, 2)
    return rows, segments
