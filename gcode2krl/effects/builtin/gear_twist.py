"""A gear twists under what it carries."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter, Role
from gcode2krl.units import N_PER_KN, RAD_PER_DEG


class GearTwist(Effect):
    """Behind the gear: deg_per_kNm·(own torque) is added, positive with the angle.

    Own torque: `Inputs.own_torque_Nm`, that of the cutting load, and of weight and inertia as far as the cell
    states masses. An encoder behind the gear sees the twist; without one the tip does. The stiffness of the
    cell does not know of such encoders and bends the arm by the cutting load all the same.
    """

    name = "gear_twist"
    family = "joint"
    links = frozenset({"gear"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.OWN_TORQUE})
    targets = staticmethod(every_joint)
    parameters = (
        Parameter(
            name="deg_per_kNm",
            unit="deg/(kN·m)",
            low=0.0,
            high=1.0,
            nominal=0.0,
            start=0.02,
            linear=True,
            minimum=0.0,
            role=Role.SIZE,
            source="gears of large arms 1-10 MN·m/rad (Haehn & Weigold 2020): 0.006-0.06; wrists 10 times",
        ),
    )

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what is behind the gear."""
        if applied["deg_per_kNm"] == 0.0:
            return q_load_rad
        q = np.array(q_load_rad)
        twist_rad_Nm = applied["deg_per_kNm"] * RAD_PER_DEG / N_PER_KN
        q[:, applied.joint] += twist_rad_Nm * inputs.own_torque_Nm[:, applied.joint]
        return q


EFFECT = GearTwist()
