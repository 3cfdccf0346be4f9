"""A gear's output or its encoder runs out of centre."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import phase_parameter, size_from_zero
from gcode2krl.units import RAD_PER_DEG


class JointEccentricity(Effect):
    """Behind the gear: amplitude·sin(q + phase) is added, q in rad of the motor side.

    An encoder ring that is off by e on a radius r gives e/r. Over some degrees it looks like an offset and a
    slope.
    """

    name = "joint_eccentricity"
    family = "joint"
    links = frozenset({"gear"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.OWN_ANGLE})
    targets = staticmethod(every_joint)
    parameters = (
        size_from_zero(
            "amplitude_deg", "deg", high=0.1, start=0.01, source="10-50 µm on a radius of 100 mm: 0.006-0.03"
        ),
        phase_parameter(),
    )

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what is behind the gear."""
        amplitude_rad = applied["amplitude_deg"] * RAD_PER_DEG
        if amplitude_rad == 0.0:
            return q_load_rad
        q = np.array(q_load_rad)
        q[:, applied.joint] += amplitude_rad * np.sin(q[:, applied.joint] + applied["phase"])
        return q


EFFECT = JointEccentricity()
