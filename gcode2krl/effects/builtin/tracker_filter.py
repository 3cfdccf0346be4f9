"""The tracker averages over time."""

from dataclasses import replace

import numpy as np

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.effects.operators import lag
from gcode2krl.effects.parameter import Parameter
from gcode2krl.effects.signals import Signals


class TrackerFilter(Effect):
    """What the tracker states follows the tip by tau·p' + p = tip, from rest: late by tau, corners rounded.

    At steady speed v it is behind by tau·v; at a right angle the stated path passes the corner 0.51·tau·v
    inside. A first-order form stands for whatever window an instrument has. Its time stamps are right, unlike
    under `clock`: on a straight line at steady speed the two are twins, and corners tell them apart. The tip
    is where it was, and the part does not show it.
    """

    name = "tracker_filter"
    family = "sensor"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.VELOCITY})
    parameters = (
        Parameter(
            name="tau_s",
            unit="s",
            low=0.0,
            high=0.5,
            nominal=0.0,
            start=0.01,
            linear=True,
            minimum=0.0,
            source="trackers state means over 1-100 ms, the smoothing of their software up to 0.5 s",
        ),
    )

    def usual(self, mismatch: Mismatch, duration_s: float, clocks: int = 1) -> dict[str, float]:
        """Return what the clocks may be off by: a filter shows as a clock does."""
        return {"tau_s": clocks * mismatch.clock_s}

    def instruments(self, signals: Signals, applied: Applied) -> Signals:
        """Return the signals with what the tracker states."""
        if applied["tau_s"] == 0.0:
            return signals
        columns = [lag(column, signals.time_s, applied["tau_s"]) for column in signals.tcp_base_mm.T]
        return replace(signals, tcp_base_mm=np.stack(columns, axis=1))


EFFECT = TrackerFilter()
