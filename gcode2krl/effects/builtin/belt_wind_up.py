"""The belt of a wrist axis creeps under load."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import JOINTS, Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import lag
from gcode2krl.effects.parameter import Parameter, size_from_zero
from gcode2krl.units import N_PER_KN, RAD_PER_DEG


class BeltWindUp(Effect):
    """Behind the gear: deg_per_kNm·w is added, relax·w' + w = own torque, settled at the start of each run.

    The delayed part of a standard linear solid (Zener); what gives way at once is `gear_twist` and in the
    stiffness of the cell. So the tip follows it as well as an encoder behind the belt. The torque is
    `Inputs.own_torque_Nm`.
    """

    name = "belt_wind_up"
    family = "joint"
    links = frozenset({"gear"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.OWN_TORQUE})
    feels_weight = True
    parameters = (
        size_from_zero(
            "deg_per_kNm",
            "deg/(kN·m)",
            high=2.0,
            start=0.1,
            source="belts of wrists 0.2-1 deg/(kN·m) at the joint, of which a tenth to a third creeps",
        ),
        Parameter(
            name="relax_s",
            unit="s",
            low=0.2,
            high=600.0,
            nominal=None,
            start=5.0,
            grid=(2.0, 20.0),
            minimum=1e-2,
            source="polyurethane and rubber belts relax within seconds to minutes",
        ),
    )

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return A4 to A6, whose motors drive them by belts."""
        return JOINTS[3:]

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what is behind the belt."""
        if applied["deg_per_kNm"] == 0.0:
            return q_load_rad
        q = np.array(q_load_rad)
        wound_Nm = lag(inputs.own_torque_Nm[:, applied.joint], inputs.time_s, applied["relax_s"])
        q[:, applied.joint] += applied["deg_per_kNm"] * RAD_PER_DEG / N_PER_KN * wound_Nm
        return q


EFFECT = BeltWindUp()
