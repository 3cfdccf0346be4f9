"""The zero of the force sensor is off."""

from types import MappingProxyType

from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter

_NAMES = ("fx_N", "fy_N", "fz_N")


class ForceOffset(Effect):
    """The sensor shows a constant force besides the true one, along its own axes (those of the flange)."""

    name = "force_offset"
    family = "sensor"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.CONSTANT})
    vectors = MappingProxyType({"offset_N": _NAMES})
    parameters = tuple(
        Parameter(
            name=name,
            unit="N",
            low=-200.0,
            high=200.0,
            nominal=0.0,
            start=10.0,
            linear=True,
            usual=lambda mismatch: mismatch.force_zero_N,
            source="zeroed under a load, or in another orientation: up to the tool's weight",
        )
        for name in _NAMES
    )

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        return load[0] + inputs.sensor_rotation @ applied.vector(_NAMES), load[1]


EFFECT = ForceOffset()
