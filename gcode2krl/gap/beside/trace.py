"""One measured signal of one run beside the model of it: what a link of the chain is judged by."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects import Applied, Inputs, Signals, commanded, simulate

_PATHS = {"tcp_base_mm": "position_mm", "q_cmd_rad": "q_cmd_rad", "q_act_rad": "q_cmd_rad",
          "q_load_rad": "q_cmd_rad"}  # fmt: skip
"""Signals that follow the commanded path closely: the path is interpolated by cubics, the rest by lines."""


_CLOCK_STEP_S = 0.004
_MOST_KNOWN = 64
_PATHS_KNOWN: OrderedDict[Any, tuple[Inputs, Signals]] = OrderedDict()
"""Commanded paths by what they were planned with; the inputs are kept, so that their id stays their own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """A measured signal (n, k), the inputs of its model, and which signals of the model it is."""

    link: str
    run: str
    run_number: int
    """Number of the run."""
    signal: str
    """Name in the report: tcp, force, joint_load …"""
    unit: str
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
    declared_sigma: float | None = None
    in_sensor_frame: bool = False
    """The values are along the sensor's axes, which are those of the flange."""
    in_tool_frame: bool = False
    hints: dict[str, float] = field(default_factory=dict)

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
        step = 1e-3
        return (self._at(self._plain, self.time_s + step) - self._at(self._plain, self.time_s - step)) / (
            2.0 * step
        )

    @cached_property
    def clock_rate(self) -> Floats:
        """(n, k) how fast the signal changes with its own clock: that of ``plus`` where both have one."""
        if self.minus is None or self.link != "gear":
            return self.rate
        step, signals = _CLOCK_STEP_S, self._plain
        times = self.time_s - self.plus_late_s
        apart = [interpolate(signals, self.plus, times + s) for s in (step, -step)]
        found: Floats = (apart[0] - apart[1])[:, list(self.columns)] / (2.0 * step)
        return found

    @cached_property
    def _plain(self) -> Signals:
        return self._simulated(self.base)

    def sample(self, applied: Sequence[Applied]) -> Floats:
        """Return what the instrument would show (n, k) with these effects at work besides the base."""
        if not applied:
            return self._at(self._plain, self.time_s)
        return self._at(self._simulated((*self.base, *applied)), self.time_s)

    def signals(self, applied: Sequence[Applied]) -> Signals:
        """Return all signals of the model with these effects at work besides the base."""
        return self._simulated((*self.base, *applied))

    def _simulated(self, applied: tuple[Applied, ...]) -> Signals:
        """Return the signals of the model; the commanded path is one for all runs and simulated once."""
        if self.link != "path":
            return simulate(self.inputs, applied)
        values = tuple((one.effect.name, one.target, *one.values.items()) for one in applied)
        key = (id(self.inputs.plan), id(self.inputs.time_s), id(self.inputs.q_cmd_rad), values)
        if key not in _PATHS_KNOWN:
            _PATHS_KNOWN[key] = (self.inputs, commanded(self.inputs, applied))
            if len(_PATHS_KNOWN) > _MOST_KNOWN:
                _PATHS_KNOWN.popitem(last=False)
        return _PATHS_KNOWN[key][1]

    def _at(self, signals: Signals, stamps: Floats) -> Floats:
        times = signals.true_time(self.plus, stamps - self.plus_late_s)
        if self.minus is None:
            values = interpolate(signals, self.plus, times)
        else:
            other = signals.true_time(self.minus, stamps)
            if np.array_equal(times, other):
                apart = values_of(signals, self.plus) - values_of(signals, self.minus)
                values = linear(times, signals.time_s, apart)
            else:
                values = interpolate(signals, self.plus, times) - interpolate(signals, self.minus, other)
        if self.in_sensor_frame or self.in_tool_frame:
            values = self._turned(signals, values, times)
        return values[:, list(self.columns)]

    def _turned(self, signals: Signals, values: Floats, times: Floats) -> Floats:
        inputs = signals.inputs
        rotation = inputs.sensor_rotation if self.in_sensor_frame else inputs.tool_rotation
        row = nearest_rows(inputs.time_s, times)
        turned: Floats = np.einsum("nji,nj->ni", rotation[row], values)
        return turned


def values_of(signals: Signals, name: str) -> Floats:
    """Return a signal (m, c); the motor side is the measured one where the inputs have it."""
    if name == "q_act_rad" and signals.inputs.q_act_rad is not None:
        return signals.inputs.q_act_rad
    values: Floats = getattr(signals, name)
    return values


def interpolate(signals: Signals, name: str, times_s: Floats) -> Floats:
    """Return a signal at other times: the commanded path in it by cubics, what deviates from it by lines.

    A line between samples 12 ms apart is off by a·dt²/8, 0.04 mm at 2 m/s²; a cubic is not.
    """
    values = values_of(signals, name)
    path = getattr(signals.inputs, _PATHS[name], None) if name in _PATHS else None
    if path is None:
        return linear(times_s, signals.time_s, values)
    return cubic(times_s, signals.time_s, path) + linear(times_s, signals.time_s, values - path)


def linear(times_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return the columns (m, c) at other times, linearly; the ends are held."""
    row, share = _place(times_s, own_s)
    found: Floats = values[row] + share[:, None] * (values[row + 1] - values[row])
    return found


def cubic(times_s: Floats, own_s: Floats, values: Floats) -> Floats:
    """Return the columns (m, c) at other times by cubic Hermite pieces with central slopes; ends are held."""
    row, u = _place(times_s, own_s)
    slope = np.gradient(values, own_s, axis=0)
    width, u = (own_s[row + 1] - own_s[row])[:, None], u[:, None]
    a, b = values[row], values[row + 1]
    da, db = slope[row] * width, slope[row + 1] * width
    found: Floats = a + u * (da + u * (3.0 * (b - a) - 2.0 * da - db + u * (2.0 * (a - b) + da + db)))
    return found


def nearest_rows(own_s: Floats, times_s: Floats) -> Ints:
    """Return the row (n,) of the sample nearest to each time."""
    row, share = _place(times_s, own_s)
    return row + (share > 0.5)


def _place(times_s: Floats, own_s: Floats) -> tuple[Ints, Floats]:
    row = np.clip(np.searchsorted(own_s, times_s, side="right") - 1, 0, len(own_s) - 2)
    share = np.clip((times_s - own_s[row]) / (own_s[row + 1] - own_s[row]), 0.0, 1.0)
    return row, share
