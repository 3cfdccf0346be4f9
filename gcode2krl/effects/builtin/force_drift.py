"""The zero of the force sensor drifts."""

from types import MappingProxyType

from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import DIRECTION, direction_parameters, size_from_zero


class ForceDrift(Effect):
    """The sensor's zero drifts with N_per_h along a direction of its own axes, from the earliest run on."""

    name = "force_drift"
    family = "sensor"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.RUN_TIME, Dependence.WALL_CLOCK})
    vectors = MappingProxyType({"direction": DIRECTION})
    direction = DIRECTION
    parameters = (
        size_from_zero(
            "N_per_h", "N/h", high=100.0, start=5.0, source="1-5 N/h once warm, more while it warms up"
        ),
        *direction_parameters("any"),
    )

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        drift_N = applied["N_per_h"] * inputs.run_hours[:, None] * applied.unit_vector()
        return load[0] + (inputs.sensor_rotation @ drift_N[:, :, None])[:, :, 0], load[1]


EFFECT = ForceDrift()
