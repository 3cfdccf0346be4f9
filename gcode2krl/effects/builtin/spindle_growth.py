"""The spindle grows while it runs."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import lag
from gcode2krl.effects.parameter import Parameter
from gcode2krl.units import RAD_PER_REV, S_PER_MIN, UM_PER_MM

_RPM_PER_RAD_S = S_PER_MIN / RAD_PER_REV
_RPM_PER_KRPM = 1e3


class SpindleGrowth(Effect):
    """The tip goes out along the tool by g, time_constant·g' + g = um_per_krpm·speed, from 0 in each run.

    The tool's z points to the holder, so the tip moves along -z. The heat of bearings goes with the speed and
    reaches the shaft with a delay; that the chip becomes thicker is not in it.
    """

    name = "spindle_growth"
    family = "geometry"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.RUN_START, Dependence.SPINDLE_SPEED})
    parameters = (
        Parameter(
            name="um_per_krpm",
            unit="µm/(1000/min)",
            low=-20.0,
            high=20.0,
            nominal=0.0,
            start=2.0,
            linear=True,
            source="motor spindles grow 20-60 µm at 10-24 krpm; centrifugal force shortens fast ones",
        ),
        Parameter(
            name="time_constant_s",
            unit="s",
            low=0.5,
            high=3600.0,
            nominal=None,
            start=60.0,
            grid=(3.0, 60.0, 600.0),
            minimum=1e-3,
            source="a shaft and its bearings some seconds to minutes, the housing 10-30 min",
        ),
    )

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip of the grown spindle."""
        if applied["um_per_krpm"] == 0.0:
            return tcp_mm
        growth_mm = applied["um_per_krpm"] / UM_PER_MM * warmth_krpm(inputs, applied["time_constant_s"])
        return tcp_mm - growth_mm[:, None] * inputs.tool_rotation[:, :, 2]


def warmth_krpm(inputs: Inputs, time_constant_s: float) -> Floats:
    """Return the spindle's speed (m,) in 1000/min as the heat follows it, cold at the start of the run."""
    speed = inputs.spindle_rad_s * _RPM_PER_RAD_S / _RPM_PER_KRPM
    since_s = inputs.time_s - inputs.time_s[:1]
    return lag(speed, inputs.time_s, time_constant_s) - speed[:1] * np.exp(-since_s / time_constant_s)


EFFECT = SpindleGrowth()
