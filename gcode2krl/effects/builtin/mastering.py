"""A joint's zero is not where the controller believes."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter
from gcode2krl.units import RAD_PER_DEG


class Mastering(Effect):
    """True angle = indicated angle + offset, whatever encoder indicates it."""

    name = "mastering"
    family = "joint"
    links = frozenset({"mechanics"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.CONSTANT})
    of_set_up = "small"
    targets = staticmethod(every_joint)
    parameters = (
        Parameter(
            name="offset_deg",
            unit="deg",
            low=-2.0,
            high=2.0,
            nominal=0.0,
            start=0.02,
            linear=True,
            source="uncalibrated accuracy of 1-3 mm is 0.02-0.1 deg; a slipped mark up to 2 deg",
        ),
    )

    def joints(self, q_true_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the true joints."""
        offset_rad = applied["offset_deg"] * RAD_PER_DEG
        return q_true_rad if offset_rad == 0.0 else q_true_rad + offset_rad * np.eye(6)[applied.joint]


EFFECT = Mastering()
