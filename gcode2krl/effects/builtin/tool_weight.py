"""Weight of the end effector in the reading of the force sensor."""

from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter


class ToolWeight(Effect):
    """The sensor's compensation leaves ``weight_N`` along gravity in the reading; negative = too much taken.

    It does not bend the arm: that is `gravity`.
    """

    name = "tool_weight"
    family = "sensor"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.CONSTANT, Dependence.PLACE})
    parameters = (
        Parameter(
            name="weight_N",
            unit="N",
            low=-500.0,
            high=500.0,
            nominal=0.0,
            start=20.0,
            linear=True,
            source="a tool and holder weigh 10-50 N, a spindle 200-500 N",
        ),
    )

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        return load[0] + applied["weight_N"] * inputs.gravity, load[1]


EFFECT = ToolWeight()
