"""A virtual joint is stiffer or softer than the model's."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_virtual_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter


class Stiffness(Effect):
    """True stiffness = ``scale``·the model's, about all three axes of one virtual joint."""

    name = "stiffness"
    family = "compliance"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.FORCE_BY_PLACE})
    is_nuisance = True
    targets = staticmethod(every_virtual_joint)
    parameters = (
        Parameter(
            name="scale",
            unit="",
            low=0.2,
            high=3.0,
            nominal=1.0,
            start=0.8,
            minimum=0.01,
            usual=lambda mismatch: mismatch.stiffness,
            source="identified within 8 % (Haehn & Weigold 2020); a worn bearing or another arm: factors",
        ),
    )

    def softness(self, softness: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the softness with that joint's over ``scale``."""
        if applied["scale"] == 1.0:
            return softness
        soft = np.array(softness)
        soft[VIRTUAL_JOINTS.index(applied.target or "")] /= applied["scale"]
        return soft


EFFECT = Stiffness()
