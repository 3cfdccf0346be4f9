"""One run beside its prediction: which signals there are, on which clock, and what the model is given."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Inputs
from gcode2krl.gap.beside.interpolation import cubic, linear, nearest_rows
from gcode2krl.gap.beside.simulator import Simulator
from gcode2krl.runs import Controller, Measured, Run

_SMOOTH_S = 0.05
_OWN_MODEL_STEPS, _STEP_S = 4, 1e-3
SAME_PATH_RAD = 2e-5
"""A log this close to the prediction, 0.03 mm at an arm's length, is that path and its last decimal."""


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
    simulator: Simulator = field(default_factory=Simulator)
    """Shared by all runs of a prediction."""
    clock_s: Mapping[str, float] = field(default_factory=dict)
    """Offset of each table that is taken off its stamps."""
    fitted: Mapping[str, Floats] = field(default_factory=dict)
    """Link (servo, gear) -> what its model says of the difference (n, 6), without the encoders' noise."""

    @property
    def name(self) -> str:
        """Return the run's name."""
        return self.run.name

    def stamps(self, table: Measured) -> Floats:
        """Return the time stamps of a table less its coarse clock error."""
        stamps: Floats = table.time_s - self.clock_s.get(type(table).__name__.lower(), 0.0)
        return stamps

    def later(self, table: str, offset_s: float) -> "Pair":
        """Return the pair with a clock error of ``offset_s`` taken off the stamps of a table."""
        return replace(self, clock_s={**self.clock_s, table: self.clock_s.get(table, 0.0) + offset_s})

    def with_measured_load(self) -> "Pair":
        """Return the pair with the measured force as what bends the arm, as its model does not hold.

        It is the mean over 50 ms, and none where the cutter is predicted in air.
        """
        table, inputs = self.run.force, self.inputs
        if table is None or inputs.forces is None:
            return self
        own_s, force_N = self.stamps(table), table.force_N
        frame = self.run.head.frames.force
        if frame in ("sensor", "tcp"):
            turn = inputs.sensor_rotation if frame == "sensor" else inputs.tool_rotation
            force_N = np.einsum("nij,nj->ni", turn[nearest_rows(inputs.time_s, own_s)], force_N)
        rows = round(_SMOOTH_S / float(np.median(np.diff(own_s))))
        load = linear(inputs.time_s, own_s, _smooth(force_N, rows))
        load[~inputs.force_base_N.any(axis=1)] = 0.0
        return replace(self, inputs=replace(inputs, load_base_N=load))

    def with_measured_joints(self, upto: str) -> "Pair":
        """Return the pair with what the controller measured in place of the model: q_cmd, q_act or q_load.

        Only the differences between neighbouring signals are interpolated, which are small and smooth.
        """
        table = self.run.controller
        if table is None:
            return self
        own_s, inputs = self.stamps(table), self.inputs
        q_cmd, q_act, q_load = table.q_cmd_rad, table.q_act_rad, table.q_load_rad
        here = inputs.time_s
        commanded = inputs.q_cmd_rad
        if q_cmd is not None and not self.from_log:
            apart = np.nan_to_num(q_cmd - cubic(own_s, here, inputs.q_cmd_rad))
            if float(np.sqrt(np.mean(apart**2))) > SAME_PATH_RAD:
                commanded = commanded + linear(here, own_s, apart)
        if upto == "q_cmd":
            return replace(self, inputs=replace(inputs, q_cmd_rad=commanded))
        actual = None
        if q_act is not None:
            reference = q_cmd if q_cmd is not None else cubic(own_s, here, inputs.q_cmd_rad)
            apart = self.fitted.get("servo", q_act - reference)
            actual = commanded + linear(here, own_s, np.nan_to_num(apart))
        if upto == "q_act" or q_load is None:
            return replace(self, inputs=replace(inputs, q_act_rad=actual))
        reference = q_act if q_act is not None else cubic(own_s, here, inputs.q_cmd_rad)
        before = actual if actual is not None else commanded
        apart = self.fitted.get("gear", q_load - reference)
        load = before + linear(here, own_s, np.nan_to_num(apart))
        return replace(self, inputs=replace(inputs, q_act_rad=actual, q_load_rad=load))

    def with_own_model(self) -> "Pair":
        """Return the pair with what a controller's own model of the robot adds to the planned joints.

        It is a function of the pose, here a polynomial of second degree in the six angles, by least squares.
        The offset of the table's clock is fitted along, as it would bend the one into the other.
        """
        table, inputs = self.run.controller, self.inputs
        if table is None or table.q_cmd_rad is None or self.from_log:
            return self
        offset_s, values = 0.0, np.zeros((1, 6))
        for _ in range(_OWN_MODEL_STEPS):
            stamps = self.stamps(table) - offset_s
            wanted, before, after = (
                cubic(stamps + s, inputs.time_s, inputs.q_cmd_rad) for s in (0.0, -_STEP_S, _STEP_S)
            )
            rate = (after - before) / (2.0 * _STEP_S)
            terms, apart = (
                _of_second_degree(wanted, inputs.q_cmd_rad),
                np.nan_to_num(table.q_cmd_rad - wanted),
            )
            fitted = np.linalg.lstsq(terms, np.concatenate([apart, rate], axis=1), rcond=1e-8)[0]
            late = apart - terms @ fitted[:, :6]
            moves = rate - terms @ fitted[:, 6:]
            step_s = -float(np.sum(late * moves)) / max(float(np.sum(moves**2)), 1e-30)
            offset_s, values = offset_s + step_s, fitted[:, :6] + step_s * fitted[:, 6:]
        added = _of_second_degree(inputs.q_cmd_rad, inputs.q_cmd_rad) @ values
        clock_s = {**self.clock_s, "controller": self.clock_s.get("controller", 0.0) + offset_s}
        inputs = replace(inputs, q_cmd_rad=inputs.q_cmd_rad + added)
        return replace(self, clock_s=clock_s, inputs=inputs)

    def with_nominal_joints(self) -> "Pair":
        """Return the pair with the controller's table less what its commanded joints differ from the plan by.

        Row by row, for a controller whose own model of the robot makes them differ: its tip is where it was
        commanded, and what its drives do beyond its commands stays. Clocks must have been set before.
        """
        table = self.run.controller
        if table is None or table.q_cmd_rad is None or self.from_log:
            return self
        wanted = cubic(self.stamps(table), self.inputs.time_s, self.inputs.q_cmd_rad)
        apart = np.nan_to_num(table.q_cmd_rad - wanted)
        nominal = replace(
            table,
            q_cmd_rad=table.q_cmd_rad - apart,
            q_act_rad=None if table.q_act_rad is None else table.q_act_rad - apart,
            q_load_rad=None if table.q_load_rad is None else table.q_load_rad - apart,
        )
        return replace(self, run=replace(self.run, controller=nominal))


def _of_second_degree(q_rad: Floats, among_rad: Floats) -> Floats:
    """Return 1, angles and their products (n, 28) of poses (n, 6), in units of the spread among others."""
    spread = np.maximum(among_rad.std(axis=0), 1e-9)
    q = (q_rad - among_rad.mean(axis=0)) / spread
    first, second = np.triu_indices(q.shape[1])
    found: Floats = np.concatenate([np.ones((len(q), 1)), q, q[:, first] * q[:, second]], axis=1)
    return found


def _smooth(values: Floats, rows: int) -> Floats:
    """Return the mean of ``rows`` neighbours of each row of (n, c)."""
    kernel = np.ones(max(rows, 1))
    count = np.convolve(np.ones(len(values)), kernel, mode="same")
    found: Floats = np.stack([np.convolve(v, kernel, mode="same") / count for v in values.T], axis=1)
    return found


def usable_rows(table: Measured, stamps: Floats, inputs: Inputs) -> tuple[Ints, Ints]:
    """Return the rows (n,) of a table within the prediction's time, and their segments (s, 2)."""
    first, last = inputs.time_s[0], inputs.time_s[-1]
    inside = (stamps >= first) & (stamps <= last)
    rows = np.flatnonzero(inside)
    edges = []
    for start, end in table.segments:
        within = np.searchsorted(rows, [start, end])
        if within[1] > within[0]:
            edges.append(within)
    segments = np.array(edges, dtype=np.int64).reshape(-1, 2)
    return rows, segments


def encoder_zeros(table: Controller) -> Floats:
    """Return the mean (6,) in rad by which each load encoder differs from the motor side; NaN without one."""
    if table.q_load_rad is None or table.q_act_rad is None:
        return np.full(6, np.nan)
    zeros: Floats = np.mean(table.q_load_rad - table.q_act_rad, axis=0)
    return zeros
