"""The air bends the tracker's beam."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter
from gcode2krl.effects.signals import Signals
from gcode2krl.units import MM_PER_M

_INDEX_PER_K = -0.93e-6
"""dn/dT of air at 633 nm, 20 °C and 1013 hPa: -(n - 1)/T, n - 1 = 271e-6 (Edlen 1966; Ciddor 1996)."""
_STAND = ("tracker_x_m", "tracker_y_m")


class TrackerRefraction(Effect):
    """What the tracker states is too high by distance²/2·|dn/dT|·gradient, the distance that over ground.

    ``K_per_m``: by how much the air is warmer a metre further up. The beam bends towards the cold, dense air
    below, and the tracker looks along its end. The tracker stands at tracker_x_m, tracker_y_m in ``$BASE``.
    """

    name = "tracker_refraction"
    family = "sensor"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.PLACE})
    vectors = MappingProxyType({"tracker_m": _STAND})
    parameters = (
        Parameter(
            name="K_per_m",
            unit="K/m",
            low=-20.0,
            high=20.0,
            nominal=0.0,
            start=1.0,
            linear=True,
            usual=lambda mismatch: mismatch.air_K_m,
            source="halls 0.2-2 K/m, above heaters and machines 10 K/m",
        ),
        *(
            Parameter(
                name=name,
                unit="m",
                low=-30.0,
                high=30.0,
                nominal=None,
                start=start,
                grid=grid,
                source="trackers stand 2-10 m away",
            )
            for name, start, grid in zip(_STAND, (5.0, 0.0), ((-5.0, 5.0), (-5.0, 5.0)), strict=True)
        ),
    )

    def instruments(self, signals: Signals, applied: Applied) -> Signals:
        """Return the signals with what the tracker states."""
        if applied["K_per_m"] == 0.0:
            return signals
        too_high_mm = raised_mm(signals.inputs, applied)[:, None] * -signals.inputs.gravity
        return replace(signals, tcp_base_mm=signals.tcp_base_mm + too_high_mm)


def raised_mm(inputs: Inputs, applied: Applied) -> Floats:
    """Return by how much (m,) the tracker sees the tip too high."""
    away_m = inputs.position_mm / MM_PER_M - np.array([*applied.vector(_STAND), 0.0])
    over_ground_m = away_m - (away_m @ inputs.gravity)[:, None] * inputs.gravity
    bent_m = -_INDEX_PER_K * applied["K_per_m"] * np.sum(over_ground_m**2, axis=1) / 2.0
    raised: Floats = bent_m * MM_PER_M
    return raised


EFFECT = TrackerRefraction()
