"""A load that hangs on the arm and is not in the model."""

from types import MappingProxyType

from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter
from gcode2krl.effects.weight import with_weight

_CENTRE = ("cx_mm", "cy_mm", "cz_mm")


class Gravity(Effect):
    """The weight of ``payload_kg``, its centre in the tool frame, bends the arm besides the cutting force.

    Static, by the model's own compliance; the force sensor does not see it (see `tool_weight`).
    """

    name = "gravity"
    family = "compliance"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.PLACE})
    vectors = MappingProxyType({"centre_mm": _CENTRE})
    parameters = (
        Parameter(
            name="payload_kg",
            unit="kg",
            low=-50.0,
            high=100.0,
            nominal=0.0,
            start=10.0,
            linear=True,
            source="stated payloads are 2-5 % off; a forgotten part of the end effector 5-50 kg",
        ),
        *(
            Parameter(
                name=name,
                unit="mm",
                low=-1000.0,
                high=1000.0,
                nominal=None,
                start=start,
                source="from the tip, z towards the holder; an end effector is 100-500 mm long",
            )
            for name, start in zip(_CENTRE, (0.0, 0.0, 200.0), strict=True)
        ),
    )

    def load(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load with this weight."""
        if applied["payload_kg"] == 0.0:
            return load
        lever_mm = inputs.tool_rotation @ applied.vector(_CENTRE)
        return with_weight(load, inputs, applied["payload_kg"], lever_mm)


EFFECT = Gravity()
