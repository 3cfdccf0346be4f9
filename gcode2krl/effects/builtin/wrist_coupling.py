"""Axes of the wrist turn each other."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter


class WristCoupling(Effect):
    """The controller's decoupling of the wrist is off: q5 += ratio·q4, q6 += ratio·(q4 + q5).

    q4 and q5 on the right are the indicated ones. The motors' encoders do not see it, those behind the gears
    do.
    """

    name = "wrist_coupling"
    family = "joint"
    links = frozenset({"gear"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.PLACE})
    parameters = (
        Parameter(
            name="ratio",
            unit="",
            low=-0.05,
            high=0.05,
            nominal=0.0,
            start=0.001,
            linear=True,
            source="couplings of hollow wrists are 1/50-1/200 before the controller takes them out",
        ),
    )

    def joints_at(self, target: Target) -> frozenset[str]:
        """Return the joints that follow A4."""
        return frozenset({"A5", "A6"})

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what is behind the gears of the wrist."""
        if applied["ratio"] == 0.0:
            return q_load_rad
        q = np.array(q_load_rad)
        q[:, 4] += applied["ratio"] * q_load_rad[:, 3]
        q[:, 5] += applied["ratio"] * (q_load_rad[:, 3] + q_load_rad[:, 4])
        return q


EFFECT = WristCoupling()
