"""The force sensor's reading is a whole number of steps."""

import numpy as np

from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter


class ForceSteps(Effect):
    """Along each axis of the sensor the reading is the nearest multiple of ``step_N``.

    Off by step/sqrt(12) rms where the force varies by several steps (Widrow 1956). A converter with too wide
    a range, or a table with too few decimals. Moments stay.
    """

    name = "force_steps"
    family = "sensor"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.FORCE})
    parameters = (
        Parameter(
            name="step_N",
            unit="N",
            low=0.0,
            high=200.0,
            nominal=0.0,
            start=5.0,
            minimum=0.0,
            source="12 bit over ± 20 kN 10 N, 16 bit 0.6 N; tables in whole N or tens of them",
        ),
    )

    def searched(self, link: str, target: Target, examined: frozenset[str]) -> bool:
        """Leave it out: a prediction rounds elsewhere than the reading, whose own values show the steps."""
        return False

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        step_N = applied["step_N"]
        if step_N == 0.0:
            return load
        sensed = np.einsum("nji,nj->ni", inputs.sensor_rotation, load[0])
        return np.einsum("nij,nj->ni", inputs.sensor_rotation, step_N * np.round(sensed / step_N)), load[1]


EFFECT = ForceSteps()
