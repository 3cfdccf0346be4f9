"""A gear that is softer under small torques."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter, size_from_zero
from gcode2krl.units import RAD_PER_DEG


class NonlinearStiffness(Effect):
    """The axis turns by soft·tanh(torque/torque_Nm) beyond the linear model, under the load at the tip.

    The torque is that of the load about the axis, J(q)ᵀ·F, positive with the angle. A cycloidal or wave gear
    is soft below some percent of its rated torque and linear above it.
    """

    name = "nonlinear_stiffness"
    family = "compliance"
    links = frozenset({"mechanics"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.OWN_TORQUE})
    targets = staticmethod(every_joint)
    parameters = (
        size_from_zero(
            "soft_deg",
            "deg",
            high=0.1,
            start=0.01,
            source="lost motion of cycloidal gears about 1 arcmin at 3 % of the rated torque",
        ),
        Parameter(
            name="torque_Nm",
            unit="N·m",
            low=1.0,
            high=3000.0,
            nominal=None,
            start=100.0,
            grid=(30.0, 100.0, 300.0),
            minimum=1e-3,
            source="3 % of the rated torque of gears of 1-10 kN·m",
        ),
    )

    def elastic(self, angle_rad: Floats, torque_Nm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the angles with the soft part."""
        if applied["soft_deg"] == 0.0:
            return angle_rad
        angle = np.array(angle_rad)
        reached = np.tanh(torque_Nm[:, applied.joint] / applied["torque_Nm"])
        angle[:, applied.joint] += applied["soft_deg"] * RAD_PER_DEG * reached
        return angle


EFFECT = NonlinearStiffness()
