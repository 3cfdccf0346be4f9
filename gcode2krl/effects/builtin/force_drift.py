"""The zero of the force sensor drifts."""

from types import MappingProxyType

from gcode2krl.effects.effect import DIRECTION, Applied, Effect, Load, Parameter, direction_parameters
from gcode2krl.effects.inputs import Inputs


class ForceDrift(Effect):
    """The sensor's zero drifts with N_per_h along a direction of its own axes, from the earliest run on."""

    name = "force_drift"
    family = "sensor"
    links = frozenset({"force"})
    vectors = MappingProxyType({"direction": DIRECTION})
    direction = DIRECTION
    parameters = (
        Parameter(
            "N_per_h", "N/h", 0.0, 100.0, nominal=0.0, start=5.0, linear=True, minimum=0.0,
            source="1-5 N/h once warm, more while it warms up",
        ),
        *direction_parameters("any"),
    )  # fmt: skip

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        drift_N = applied["N_per_h"] * inputs.run_hours[:, None] * applied.unit_vector()
        return load[0] + (inputs.sensor_rotation @ drift_N[:, :, None])[:, :, 0], load[1]


EFFECT = ForceDrift()
