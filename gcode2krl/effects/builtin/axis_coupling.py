"""A2 turns A3."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter
from gcode2krl.units import N_PER_KN, RAD_PER_DEG


class AxisCoupling(Effect):
    """q3 += ratio·q2 + deg_per_kNm·(torque of A2): a rod beside the upper arm, or its casting that twists.

    q2 is the indicated angle, the torque is `Inputs.own_torque_Nm`. The motors' encoders do not see it, those
    behind the gears do.
    """

    name = "axis_coupling"
    family = "joint"
    links = frozenset({"gear"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.PLACE, Dependence.FORCE_BY_PLACE})
    feels_weight = True
    parameters = (
        Parameter(
            name="ratio",
            unit="",
            low=-0.05,
            high=0.05,
            nominal=0.0,
            start=0.001,
            linear=True,
            source="a parallelogram whose rods differ by 0.1-1 % of their length",
        ),
        Parameter(
            name="deg_per_kNm",
            unit="deg/(kN·m)",
            low=-1.0,
            high=1.0,
            nominal=0.0,
            start=0.01,
            linear=True,
            source="a tenth of what a gear of a large arm twists, 0.006-0.06",
            minor=True,
        ),
    )

    def joints_at(self, target: Target) -> frozenset[str]:
        """Return the joint that follows A2."""
        return frozenset({"A3"})

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what is behind the gears."""
        if applied["ratio"] == 0.0 and applied["deg_per_kNm"] == 0.0:
            return q_load_rad
        q = np.array(q_load_rad)
        q[:, 2] += applied["ratio"] * q_load_rad[:, 1]
        if applied["deg_per_kNm"] != 0.0:
            q[:, 2] += applied["deg_per_kNm"] * RAD_PER_DEG / N_PER_KN * inputs.own_torque_Nm[:, 1]
        return q


EFFECT = AxisCoupling()
