"""A drive that follows behind what is commanded."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.effect import Applied, Effect, Parameter, every_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import lag


class ServoLag(Effect):
    """First order: tau·q_act' + q_act = q_cmd, from rest."""

    name = "servo_lag"
    family = "timing"
    links = frozenset({"servo"})
    targets = staticmethod(every_joint)
    parameters = (
        Parameter(
            "tau_s", "s", 0.0, 0.1, nominal=0.0, start=0.01, linear=True, minimum=0.0,
            source="servo lag of large arms 10-30 ms",
        ),
    )  # fmt: skip

    def servo(self, q_act_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the motor side."""
        if applied["tau_s"] <= 0.0:
            return q_act_rad
        q = np.array(q_act_rad)
        q[:, applied.joint] = lag(q[:, applied.joint], inputs.time_s, applied["tau_s"])
        return q


EFFECT = ServoLag()
