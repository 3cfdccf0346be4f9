"""The force sensor's reading lags its load."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import play
from gcode2krl.effects.parameter import size_from_zero


class ForceHysteresis(Effect):
    """Along each axis of the sensor: reading = F - loss·(F - play(F)), the play ± half the largest |F| wide.

    Cycled between ± the largest force of the run the loop is ``loss_percent`` of that wide: unloaded, the
    reading is half of it too high. Proportional to the load cycle, as the hysteresis of strain gauges and
    their glue is (Masing's rule); data sheets state it at full scale. Forces alone: moments stay.
    """

    name = "force_hysteresis"
    family = "sensor"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.FORCE})
    parameters = (
        size_from_zero(
            "loss_percent",
            "%",
            high=20.0,
            start=1.0,
            source="load cells 0.02-0.5 % of full scale; bolted and preloaded sensors some %",
        ),
    )

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        if applied["loss_percent"] == 0.0:
            return load
        sensed = np.einsum("nji,nj->ni", inputs.sensor_rotation, load[0])
        lost = np.stack([_lost(column) for column in sensed.T], axis=1) * applied["loss_percent"] / 100.0
        return load[0] - np.einsum("nij,nj->ni", inputs.sensor_rotation, lost), load[1]


def _lost(force_N: Floats) -> Floats:
    """Return the force (m,) less its play of half its largest value; from rest without a load."""
    full_N = float(np.nanmax(np.abs(force_N), initial=0.0))
    return force_N - play(np.append(0.0, force_N), full_N / 2.0)[1:]


EFFECT = ForceHysteresis()
