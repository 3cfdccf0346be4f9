"""Admissible inputs: what a deviation of a link can be a function of, at the rows of a trace.

Families are made of them (`gap.components`), and what is learnt as noise is cleaned of them
(`gap.noise.slow`): one list, so that nothing that a family could tell is taken for noise.

**Rounding.** A corner that is rounded by another law is off along the turn of the direction there, by a
function of the way from the corner: a sum of hats of several widths.

**Lateness.** What changes at corners, ramps or stops makes a run later from there on. An approximation
distance d larger by δ takes δ·|1/v₁ - 1/v₂| more where the speed changes from v₁ to v₂, since the slower one
has more of the way; a ramp of dv takes (|dv|/a + k)/2; a stop takes what it takes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects import arm
from gcode2krl.effects.inputs import Inputs, gradient
from gcode2krl.effects.operators import lag, play, second_order, since_reversal
from gcode2krl.gap.compare.interpolation import linear, nearest_rows
from gcode2krl.gap.compare.pair import from_base
from gcode2krl.gap.compare.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.units import MM_PER_M

_LIMITS = THRESHOLDS.compare
_WIDTHS_MM = (0.3, 0.6, 1.2, 2.5, 5.0)
"""Of roundings: approximation distances of milling programs."""
_REACH_MM = 2.0
"""Before and after a corner, between which the direction turns."""
_AT_REST = 0.01
"""Of the highest speed."""


def rows_of_passing(path_mm: Floats, points_mm: Floats) -> Ints:
    """Return the samples of a path (m, 3) nearest to points (c, 3) that are passed one after the other."""
    rows, first = [], 0
    x, y, z = np.ascontiguousarray(path_mm.T)
    for at_x, at_y, at_z in points_mm:
        away = np.sqrt((x[first:] - at_x) ** 2 + (y[first:] - at_y) ** 2 + (z[first:] - at_z) ** 2)
        # the first local minimum that is as near as any: a path may come by again
        near = np.flatnonzero(away < away.min() + _LIMITS.corner_near_mm)
        breaks = np.flatnonzero(np.diff(near) > 1)
        passage = near[: breaks[0] + 1] if len(breaks) else near
        first += int(passage[np.argmin(away[passage])])
        rows.append(first)
    return np.array(rows, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Corners:
    """What the targets of a motion say of its m samples; all is zero or empty without targets."""

    inputs: Inputs

    @cached_property
    def _blended(self) -> Bools:
        """(t,) which targets are corners that the plan rounds."""
        targets = self.inputs.targets
        return np.zeros(0, dtype=np.bool_) if targets is None else targets.cdis_mm > 0.0

    @cached_property
    def _rows(self) -> Ints:
        """(c,) the samples at rounded corners."""
        targets = self.inputs.targets
        if targets is None or not self._blended.any():
            return np.zeros(0, dtype=np.int64)
        return rows_of_passing(self.inputs.position_mm, targets.position_mm[self._blended])

    def passed(self, samples: Ints) -> Floats:
        """Return for some samples (n,) 1 from each blended corner on, (n, c)."""
        return (samples[:, None] >= self._rows).astype(np.float64)

    @cached_property
    def roundings(self) -> Floats:
        """(m, w, 6) what rounding the nearest corner within each width does to the commanded joints."""
        inputs, rows = self.inputs, self._rows
        if not len(rows):
            return np.zeros((len(inputs), len(_WIDTHS_MM), 6))
        gone, moves = inputs.path_mm, np.append(True, np.diff(inputs.path_mm) > 0.0)
        at_mm = gone[rows]
        apart = np.diff(at_mm, prepend=-np.inf, append=np.inf)
        reach_mm = np.clip(np.minimum(apart[:-1], apart[1:]) / 2.0, 1e-3, _REACH_MM)

        def along(length_mm: Floats) -> Floats:
            return np.stack([np.interp(length_mm, gone[moves], q[moves]) for q in inputs.q_cmd_rad.T], axis=1)

        turn = along(at_mm + reach_mm) - 2.0 * along(at_mm) + along(at_mm - reach_mm)
        turn /= reach_mm[:, None]
        after = np.clip(np.searchsorted(at_mm, gone), 1, max(len(at_mm) - 1, 1))
        before, after = after - 1, np.minimum(after, len(at_mm) - 1)
        nearest = np.where(gone - at_mm[before] <= at_mm[after] - gone, before, after)
        away_mm = np.abs(gone - at_mm[nearest])[:, None]
        hats = np.maximum(0.0, 1.0 - away_mm / np.array(_WIDTHS_MM))
        bent: Floats = hats[:, :, None] * turn[nearest][:, None, :]
        return bent

    @cached_property
    def late_by_rounding(self) -> Floats:
        """(m, 2) how late larger corners make a run, in s for a mm, and corners passed so far."""
        targets = self.inputs.targets
        if targets is None or not self._blended.any():
            return np.zeros((len(self.inputs), 2))
        slowness = 1.0 / np.maximum(targets.speed_mm_s, 1e-6)
        change = np.abs(np.diff(slowness, append=slowness[-1:]))[self._blended]
        late = np.append(0.0, np.cumsum(change))
        passed = np.searchsorted(self._rows, np.arange(len(self.inputs)), side="right")
        return np.stack([late[passed], passed.astype(np.float64)], axis=1)

    @cached_property
    def late_by_ramps(self) -> Floats:
        """(m, 4) speed gained and lost so far, stops so far, and within a ramp acceleration and speed."""
        inputs = self.inputs
        speed = np.linalg.norm(inputs.velocity_mm_s, axis=1)
        gained = np.cumsum(np.abs(np.diff(speed, prepend=speed[:1])))
        rests = speed < _AT_REST * float(speed.max(initial=0.0))
        stops = np.cumsum(np.diff(rests.astype(np.float64), prepend=0.0) > 0.0).astype(np.float64)
        return np.stack([gained, stops, gradient(speed[:, None], inputs.time_s)[:, 0], speed], axis=1)


_PLAYS_RAD = (1e-4, 1e-3, 1e-2)
"""Half-widths of play: 0.006°, 0.06° and 0.6° cover what gears have."""
_SETTLES_S = (0.05, 0.3)
"""After a reversal: a stick-slip spike, and what an arm needs to come to rest."""
_FOLLOWS_S = (0.004, 0.01, 0.025)
"""Time constants of a servo's two lags behind a jerk."""
RINGS_HZ = tuple(7.0 * 1.12**i for i in range(12))
"""Modes of arms and belts, 7 to 25 Hz, each as far from the next as its peak is wide."""
SWINGS_HZ = tuple(0.4 * 1.12**i for i in range(12))
"""What hangs at the arm: a bow of 1.5 to 0.1 m swings as a pendulum does, at 0.4 to 1.4 Hz."""
_RINGS_DAMPING = 0.04
"""Of such modes, 1 to 6 %, and of hoses up to 10 %."""
_WARMS_S = (2.0, 8.0, 30.0)
"""Time constants with which a spindle grows after it has started, and friction falls as it warms."""
_PLAYS_LOAD = (0.025, 0.05, 0.1, 0.2, 0.4, 0.8)
"""Widths of play of a torque or a force, over its range; a sum of plays is any smooth loop."""
_LATE_S = tuple(0.002 * 1.4**i for i in range(14))
"""Delays of a force, to 0.16 s: a sensor's chain alone has 5 to 50 ms, with the robot's reaction 150 ms."""


@dataclass(frozen=True, eq=False)
class Admissible:
    """The inputs of one trace's link, each at its rows (n,) or (n, c)."""

    trace: Trace

    def at(self, values: Floats) -> Floats:
        """Return values (m, …) of the model's samples at the rows."""
        at_rows = linear(self.trace.time_s, self.trace.inputs.time_s, values.reshape(len(values), -1))
        return at_rows.reshape(-1, *values.shape[1:])

    @cached_property
    def nearest(self) -> Ints:
        """(n,) the samples of the model nearest to the rows."""
        return nearest_rows(self.trace.inputs.time_s, self.trace.time_s)

    # Time

    @cached_property
    def since_start_s(self) -> Floats:
        """(n,) since the run's first sample."""
        since_s: Floats = self.trace.time_s - self.trace.inputs.time_s[0]
        return since_s

    @cached_property
    def hours(self) -> Floats:
        """(n,) since the earliest of the runs started."""
        return self.at(self.trace.inputs.run_hours)

    # Path and process

    @cached_property
    def travel_mm(self) -> Floats:
        """(n,) length of the path so far."""
        return self.at(self.trace.inputs.path_mm)

    @cached_property
    def cut_m(self) -> Floats:
        """(n,) metres that each tool has cut so far."""
        inputs = self.trace.inputs
        step_mm = np.where(
            self._force_N.any(axis=1), np.diff(inputs.path_mm, prepend=inputs.path_mm[:1]), 0.0
        )
        cut_m = np.empty(len(inputs))
        for _, rows in arm.tool_rows(inputs.tool):
            cut_m[rows] = np.cumsum(step_mm[rows]) / MM_PER_M
        return self.at(cut_m)

    @cached_property
    def position_mm(self) -> Floats:
        """(n, 3) commanded tip."""
        return self.at(self.trace.inputs.position_mm)

    @cached_property
    def velocity_mm_s(self) -> Floats:
        """(n, 3) of the commanded tip."""
        return self.at(self.trace.inputs.velocity_mm_s)

    @cached_property
    def acceleration_mm_s2(self) -> Floats:
        """(n, 3) of the commanded tip."""
        inputs = self.trace.inputs
        return self.at(gradient(inputs.velocity_mm_s, inputs.time_s))

    @cached_property
    def tool_axes(self) -> Floats:
        """(n, 3, 3) rotations of the tool."""
        return self.trace.inputs.tool_rotation[self.nearest]

    @cached_property
    def force_N(self) -> Floats:
        """(n, 3) the force that bends the arm: the measured one where the model has it."""
        return self.at(self._force_N)

    @property
    def presses(self) -> bool:
        """Tell whether there is a force at the tip at all."""
        return bool(self._force_N.any())

    @cached_property
    def spindle(self) -> Floats:
        """(n, c) spindle speed, and the same with lags as a spindle warms up, from rest at the start."""
        inputs = self.trace.inputs
        speed = np.ascontiguousarray(inputs.spindle_rad_s, dtype=float)
        started = np.append(0.0, speed)
        step_s = np.append(inputs.time_s[0] - 1e-3, inputs.time_s)
        return self.at(np.stack([speed, *(lag(started, step_s, tau)[1:] for tau in _WARMS_S)], axis=1))

    @cached_property
    def _force_N(self) -> Floats:
        inputs = self.trace.inputs
        return inputs.force_base_N if inputs.load_base_N is None else inputs.load_base_N

    @cached_property
    def temperature_C(self) -> Floats:
        """(n, c) of the places that were logged, the ambient last; (n, 0) without any."""
        logged = self.trace.inputs.temperature_C
        return np.zeros((len(self.trace.time_s), 0)) if logged is None else self.at(logged)

    @cached_property
    def corners(self) -> Corners:
        """What the controller plans at corners."""
        return self.trace.inputs.remembered("corners", Corners)

    # Joints

    @cached_property
    def q_rad(self) -> Floats:
        """(n, 6) commanded joints."""
        return self.at(self.trace.inputs.q_cmd_rad)

    @cached_property
    def rate_rad_s(self) -> Floats:
        """(n, 6) velocities of the joints."""
        return self.at(self.trace.inputs.rate_rad_s)

    @cached_property
    def acceleration_rad_s2(self) -> Floats:
        """(n, 6) accelerations of the joints."""
        return self.at(gradient(self.trace.inputs.rate_rad_s, self.trace.inputs.time_s))

    def jerk(self, joint: int) -> Floats:
        """Return how fast a joint's commanded acceleration changes, (n, c), as servos follow it."""
        inputs = self.trace.inputs
        jerk = gradient(gradient(inputs.rate_rad_s[:, joint], inputs.time_s), inputs.time_s)
        follows = [lag(lag(jerk, inputs.time_s, tau), inputs.time_s, tau) for tau in _FOLLOWS_S]
        return self.at(np.stack(follows, axis=1))

    def rings(self, joint: int) -> Floats:
        """Return how far a joint that hangs at a spring swings from its command (n, c), by its mode."""
        return self._swings(self.trace.inputs.q_cmd_rad[:, joint], RINGS_HZ)

    def swings(self, modes_hz: Sequence[float]) -> Floats:
        """Return the same of what hangs at the tip, along each axis of ``$BASE`` by itself, (k, n, 3·c)."""
        trace, columns = self.trace, []
        for axis, place_mm in zip(np.eye(3), trace.inputs.position_mm.T, strict=True):
            for swing in self._swings(place_mm, modes_hz).T:
                columns.append(from_base(swing[:, None] * axis, trace.frame, trace.inputs, trace.time_s))
        return np.stack(columns, axis=2).swapaxes(0, 1)[list(trace.columns)]

    def _swings(self, values: Floats, modes_hz: Sequence[float]) -> Floats:
        time_s, values = self.trace.inputs.time_s, np.ascontiguousarray(values)
        follows = [second_order(values, time_s, hz, _RINGS_DAMPING) for hz in modes_hz]
        return self.at(np.stack(follows, axis=1) - values[:, None])

    @cached_property
    def torque_Nm(self) -> Floats:
        """(n, 6) as logged or, beside a prediction, of all nominal loads: what the gears carry."""
        return self.at(self._torque)

    @cached_property
    def load_torque_Nm(self) -> Floats:
        """(n, 6) of the force at the tip alone, by the arm's statics: what bends the arm beside its cut."""
        inputs = self.trace.inputs
        return self.at(arm.torque_Nm(inputs.jacobian, self._force_N, inputs.moment_base_Nmm))

    @cached_property
    def _torque(self) -> Floats:
        inputs = self.trace.inputs
        return inputs.own_torque_Nm if inputs.torque_Nm is None else inputs.torque_Nm

    def torque_with_memory(self, joint: int) -> Floats:
        """Return what play operators leave of a joint's torque (n, c)."""
        return self.at(_plays(self._torque[:, joint]))

    def late(self) -> Floats:
        """Return by how much the signal (k, n, c) differs where it is late: by a time, or as a filter is."""
        trace, nominal = self.trace, self.trace.nominal
        shifted = [trace.late(by_s) - nominal for by_s in _LATE_S]
        filtered = [
            np.stack([lag(each, trace.time_s, by_s) for each in (nominal - nominal[:1]).T], axis=1)
            - (nominal - nominal[:1])
            for by_s in _LATE_S
        ]
        return np.moveaxis(np.stack([*shifted, *filtered]), (0, 1, 2), (2, 1, 0))

    @cached_property
    def with_memory(self) -> Floats:
        """(k, n, c) the signal itself and what play operators leave of it, of each component by itself."""
        return np.stack([np.column_stack([own, _plays(own)]) for own in self.trace.nominal.T])

    @cached_property
    def jacobian(self) -> Floats:
        """(n, 3, 6) by how much the tip moves with each joint, mm/rad."""
        return self.trace.inputs.jacobian[self.nearest, :3]

    @cached_property
    def directions(self) -> Floats:
        """(n, 6) of the joints' motion, ±1 with memory."""
        inputs = self.trace.inputs
        directions = [since_reversal(np.ascontiguousarray(q), inputs.time_s)[0] for q in inputs.q_cmd_rad.T]
        return np.stack(directions, axis=1)[self.nearest]

    def reversals(self, joint: int) -> Floats:
        """Return the direction of a joint's motion (n, c) with memory, alone and as play of several widths.

        Beside them what dies down after each reversal, what grows with the joint's load, and what fades as
        grease and brakes warm.
        """
        inputs = self.trace.inputs
        q = np.ascontiguousarray(inputs.q_cmd_rad[:, joint])
        direction, since_s = since_reversal(q, inputs.time_s)
        plays = [(q - play(q, width)) / width for width in _PLAYS_RAD]
        settling = [direction * np.exp(-since_s / tau) for tau in _SETTLES_S]
        load = np.abs(self._torque[:, joint])
        loaded = direction * load / max(float(load.max(initial=0.0)), 1e-12)
        fades = [direction * np.exp((inputs.time_s[0] - inputs.time_s) / tau) for tau in _WARMS_S]
        return np.stack([direction, *plays, *settling, loaded, *fades], axis=1)[self.nearest]

    @cached_property
    def drags(self) -> Floats:
        """(n, 18) the direction of each joint's motion, alone, times its angle, and times its square.

        So hoses and cables drag that hang at a joint.
        """
        reach = np.maximum(np.ptp(self.q_rad, axis=0), _LIMITS.still_rad_s)
        angle = (self.q_rad - self.q_rad.mean(axis=0)) / reach
        return np.concatenate([self.directions * angle**power for power in range(3)], axis=1)


def _plays(values: Floats) -> Floats:
    """Return what play operators of several widths leave of values (n,), (n, c)."""
    values = np.ascontiguousarray(values)
    reach = float(np.ptp(values))
    return np.stack([values - play(values, 0.5 * share * reach) for share in _PLAYS_LOAD], axis=1)
