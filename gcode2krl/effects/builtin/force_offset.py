"""The zero of the force sensor is off."""

from types import MappingProxyType

from gcode2krl.effects.effect import Applied, Effect, Load, Parameter
from gcode2krl.effects.inputs import Inputs

_NAMES = ("fx_N", "fy_N", "fz_N")


class ForceOffset(Effect):
    """The sensor shows a constant force besides the true one, along its own axes (those of the flange)."""

    name = "force_offset"
    family = "sensor"
    links = frozenset({"force"})
    vectors = MappingProxyType({"offset_N": _NAMES})
    parameters = tuple(
        Parameter(name, "N", -200.0, 200.0, nominal=0.0, start=10.0, linear=True,
                  source="zeroed under a load, or in another orientation: up to the tool's weight")
        for name in _NAMES
    )  # fmt: skip

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        return load[0] + inputs.sensor_rotation @ applied.vector(_NAMES), load[1]


EFFECT = ForceOffset()
