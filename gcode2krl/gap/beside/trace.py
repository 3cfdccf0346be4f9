"""One measured signal of one run beside the model of it: what a link of the chain is judged by."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied, Inputs, Signals, simulate
from gcode2krl.effects.effect import JOINTS
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.beside.interpolation import (
    LastPath,
    cubic,
    follows_path,
    interpolate,
    linear,
    nearest_rows,
    values_of,
)
from gcode2krl.gap.beside.simulator import Simulator
from gcode2krl.gap.thresholds import THRESHOLDS

LIMITS = THRESHOLDS.beside
Span = tuple[float, float]
"""Start and end in s of the table's stamps."""


class Whose(Enum):
    """What an event is."""

    COMMAND = "in step with the command"
    SLIP = "a change that stays"
    IMPULSE = "an impulse"
    INSTRUMENT = "a burst of the instrument"


@dataclass(frozen=True, eq=False)
class Event:
    """One event of one run in one link's signal, in the link's inner unit."""

    link: str
    run: str
    whose: Whose
    span_s: Span
    at_s: float
    """Where it is largest; of a slip where the level has changed by half."""
    line: int
    """Of the G-code that the robot is on; 0 where it is on none."""
    peak: Floats
    """(k,) the largest deviation from the level around it."""
    change: Floats
    """(k,) by how much the level is another one behind it."""
    power: float
    """Sum of the squares of its deviations over its rows."""
    is_shared: bool = False
    """Another table is rough at that moment, too."""


class Signal:
    """What a link compares: names and units, clocks, and how its model is simulated."""

    name: str
    signal: str
    """Name of its signal in the report."""
    unit: str
    """Unit of the report."""
    needs: str
    """What a run must hold for the link to be examined."""
    table: str = "controller"
    """The table of a run whose clock stamps it."""
    of_joints: bool = False
    """Its components are joints."""
    of_tip: bool = False
    """Its components are those of the tip."""
    tells_time: bool = False
    """It shows when the robot is where: timing is the part of it along the motion."""
    model_rms: float = 0.0
    """Accuracy of its model in the inner unit where that, not noise, is the limit."""
    least_off: float = 0.0
    """RMS in the inner unit below which the run keeps to the planned times."""
    least_step: float = 0.0
    """Shorter ways along the signal, in the inner unit, are noise of the instrument, not motion."""
    own_clock: str = ""
    """The clock that the signal has of its own besides that of its table."""
    sets_clocks: bool = False
    """Clocks are set run by run first, since the signal changes fast all the time."""
    instrument: tuple[str, ...] = ()
    """Names of the nuisance that belongs to the instrument alone: the joints do nothing of it."""

    def __repr__(self) -> str:
        return f"<link {self.name}>"

    def simulated(self, trace: "Trace", applied: Sequence[Applied]) -> Signals:
        """Return the signals of its model with some effects at work."""
        return simulate(trace.inputs, applied)

    def planned(self, inputs: Inputs) -> Floats:
        """Return the planned signal (m, k) that shows how far a run has come."""
        raise NotImplementedError(f"{self.name} does not show how far a run has come")

    @property
    def clock(self) -> str:
        """Return the name of the clock by which it may be late."""
        return self.own_clock or self.table

    @property
    def has_instrument(self) -> bool:
        """Tell whether an instrument measures it; what is commanded has no noise."""
        return self.model_rms == 0.0

    def mismatch(self, trace: "Trace", mismatch: Mismatch) -> Iterator[tuple[str, Floats]]:
        """Yield what its instrument may be off by: names, and columns (k, n, c) for one deviation."""
        return iter(())

    def has_time_law(self, unmeasured: frozenset[str]) -> bool:
        """Tell whether the time law may be slightly off in it, given the links without data."""
        return self.tells_time


_KINK_ROWS = 5
"""Samples of a jump of the rate and one on either side."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """A measured signal (n, k), the inputs of its model, and which signals of the model it is."""

    link: Signal
    run: str
    run_number: int
    simulator: Simulator
    factor: float
    """From the inner unit to that of the report."""
    components: tuple[str, ...]
    columns: tuple[int, ...]
    """Columns of the model's signals that were measured."""
    plus: str
    minus: str | None = None
    """The measured signal is ``plus`` - ``minus`` of the model."""
    inputs: Inputs
    base: tuple[Applied, ...] = ()
    """Effects that were found before: they are part of the model."""
    time_s: Floats
    """(n,) stamps of the table."""
    measured: Floats
    segments: Ints
    """(s, 2) stretches without a gap."""
    plus_late_s: float = 0.0
    """By how much the samples of ``plus`` are older than their stamps, beyond the table's clock."""
    clock_set_s: float = 0.0
    """What was taken off the stamps for the run's own clock."""
    declared_sigma: float | None = None
    in_sensor_frame: bool = False
    """The values are along the sensor's axes, which are those of the flange."""
    in_tool_frame: bool = False
    still: bool = False
    """Each row is a pose in which the robot stands."""
    left_out: tuple[str, ...] = ()
    """What was taken out of the measured values because it is the instrument's, in a person's words."""
    events: tuple[Event, ...] = ()
    """What was rough or far off for a moment and is not in step with the command (`events`)."""

    @property
    def signal(self) -> str:
        """Return the name in the report: tcp, force, joint_load …"""
        return self.link.signal

    @property
    def unit(self) -> str:
        """Return the unit of the report."""
        return self.link.unit

    @property
    def of_six_encoders(self) -> bool:
        """Tell whether it is of two columns of all joints, whose encoders are alike."""
        return self.link.of_joints and self.minus is not None and self.measured.shape[1] == len(JOINTS)

    @property
    def shape(self) -> tuple[int, int]:
        """Return rows and components."""
        return self.measured.shape[0], self.measured.shape[1]

    @cached_property
    def nominal(self) -> Floats:
        """(n, k) what the model says."""
        return self.sample(())

    @cached_property
    def residual(self) -> Floats:
        """(n, k) measured less model."""
        return self.measured - self.nominal

    @cached_property
    def rate(self) -> Floats:
        """(n, k) time derivative of the model, from the model's own samples."""
        if self.still:
            return np.zeros(self.shape)
        step = 1e-3
        return (self.at(self._plain, self.time_s + step) - self.at(self._plain, self.time_s - step)) / (
            2.0 * step
        )

    @cached_property
    def clock_rate(self) -> Floats:
        """(n, k) how fast the signal changes with its own clock: that of ``plus`` where both have one."""
        if not self.link.own_clock:
            return self.rate
        step, signals = LIMITS.clock_difference_s, self._plain
        times = self.time_s - self.plus_late_s
        apart = [interpolate(signals, self.plus, times + s) for s in (step, -step)]
        found: Floats = (apart[0] - apart[1])[:, list(self.columns)] / (2.0 * step)
        return found

    @cached_property
    def kinks(self) -> Floats:
        """(n, k) the largest jump of the model's rate within two of its samples, 0 where it bends evenly.

        Where a clock is off by less than a sample, the row may be on either side of the jump.
        """
        signals = self._plain
        values, own_s = values_of(signals, self.plus), signals.time_s
        if self.still or not follows_path(self.plus) or len(own_s) < _KINK_ROWS:
            return np.zeros(self.shape)
        # less what its neighbours have: an even acceleration is no kink
        jumps = np.diff(np.diff(values, axis=0) / np.diff(own_s)[:, None], axis=0)
        kinks = np.zeros_like(values)
        kinks[2:-2] = np.abs(jumps[1:-1] - 0.5 * (jumps[:-2] + jumps[2:]))
        near = np.maximum(kinks, np.maximum(np.roll(kinks, 1, axis=0), np.roll(kinks, -1, axis=0)))
        if self.in_sensor_frame or self.in_tool_frame:  # whichever way they are turned
            near = np.repeat(np.linalg.norm(near, axis=1, keepdims=True), near.shape[1], axis=1)
        found: Floats = near[nearest_rows(own_s, self.time_s - self.plus_late_s)][:, list(self.columns)]
        return found

    @cached_property
    def _plain(self) -> Signals:
        return self._simulated(self.base)

    @cached_property
    def _last_paths(self) -> tuple[LastPath, LastPath]:
        """Of ``plus`` and of ``minus``, whose clocks may differ."""
        return LastPath(), LastPath()

    def late(self, by_s: float) -> Floats:
        """Return what the model says (n, k) of an instrument that states what was true some time before."""
        return self.at(self._plain, self.time_s - by_s)

    def as_stated(self, vectors: Floats, rows: Ints) -> Floats:
        """Return vectors (n, 3) along ``$BASE``, at these rows (n,) of the model, along the signal's axes."""
        return self._turned(self.inputs, vectors, rows)

    def sample(self, applied: Sequence[Applied]) -> Floats:
        """Return what the instrument would show (n, k) with these effects at work besides the base."""
        if not applied:
            return self.at(self._plain, self.time_s)
        return self.at(self._simulated((*self.base, *applied)), self.time_s)

    def model_error(self, applied: Sequence[Applied]) -> Floats:
        """Return by how much the model may be off (n, k) where it, not noise, is the limit.

        To its accuracy come what its samples miss of a sharp corner: by how much every other one misses more,
        and at a kink half a sample at the jump of the rate.
        """
        signals = self.signals(applied)
        times = signals.true_time(self.plus, self.time_s)
        values = values_of(signals, self.plus)[:, list(self.columns)]
        fine, coarse = cubic(times, signals.time_s, values), cubic(times, signals.time_s[::2], values[::2])
        kink = self.kinks * float(np.median(np.diff(signals.time_s))) / 4.0
        return self.link.model_rms + np.abs(fine - coarse) + kink

    def signals(self, applied: Sequence[Applied]) -> Signals:
        """Return all signals of the model with these effects at work besides the base."""
        return self._simulated((*self.base, *applied))

    def _simulated(self, applied: tuple[Applied, ...]) -> Signals:
        return self.link.simulated(self, applied)

    def at(self, signals: Signals, stamps: Floats) -> Floats:
        """Return what the instrument would show (n, k) of simulated signals at its stamps (n,)."""
        times = signals.true_time(self.plus, stamps - self.plus_late_s)
        if self.minus is not None:
            # the inputs are this signal as it was stamped: a clock of its own shows in the other one
            times = times - signals.own_late_s(self.minus, stamps)
        if self.minus is None:
            values = interpolate(signals, self.plus, times, self._last_paths[0])
        else:
            other = signals.table_time(self.minus, stamps)
            if np.array_equal(times, other):
                apart = values_of(signals, self.plus) - values_of(signals, self.minus)
                values = linear(times, signals.time_s, apart)
            else:
                plus, minus = self._last_paths
                values = interpolate(signals, self.plus, times, plus)
                values = values - interpolate(signals, self.minus, other, minus)
        if self.in_sensor_frame or self.in_tool_frame:
            values = self._turned(signals.inputs, values, nearest_rows(signals.inputs.time_s, times))
        return values[:, list(self.columns)]

    def _turned(self, inputs: Inputs, values: Floats, rows: Ints) -> Floats:
        if not (self.in_sensor_frame or self.in_tool_frame):
            return values
        rotation = inputs.sensor_rotation if self.in_sensor_frame else inputs.tool_rotation
        turned: Floats = np.einsum("nji,nj->ni", rotation[rows], values)
        return turned
