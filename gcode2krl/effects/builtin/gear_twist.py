"""A gear twists under what it carries."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import size_from_zero
from gcode2krl.units import N_PER_KN, RAD_PER_DEG


class GearTwist(Effect):
    """Behind the gear: deg_per_kNm·(own torque) is added, positive with the angle.

    Own torque: `Inputs.own_torque_Nm`, that of the cutting load, and of weight and inertia as far as the cell
    states masses. An encoder behind the gear sees the twist. The tip follows the stiffness of the cell, which
    has the spring of the gear in it whether an encoder sees it or not.
    """

    name = "gear_twist"
    family = "joint"
    links = frozenset({"gear"})
    is_misread = True
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.OWN_TORQUE})
    feels_weight = True
    targets = staticmethod(every_joint)
    parameters = (
        size_from_zero(
            "deg_per_kNm",
            "deg/(kN·m)",
            high=1.0,
            start=0.02,
            source="gears of large arms 1-10 MN·m/rad (Haehn & Weigold 2020): 0.006-0.06; wrists 10 times",
        ),
    )

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what an encoder behind the gear sees."""
        return q_load_rad + _twist_rad(inputs, applied)

    def joints(self, q_true_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the joints without the twist, which the stiffness of the cell adds."""
        return q_true_rad - _twist_rad(inputs, applied)


def _twist_rad(inputs: Inputs, applied: Applied) -> Floats:
    """Return by how much (m, 6) the gears twist."""
    twist = np.zeros_like(inputs.q_cmd_rad)
    if applied["deg_per_kNm"] != 0.0:
        per_Nm = applied["deg_per_kNm"] * RAD_PER_DEG / N_PER_KN
        twist[:, applied.joint] = per_Nm * inputs.own_torque_Nm[:, applied.joint]
    return twist


EFFECT = GearTwist()
