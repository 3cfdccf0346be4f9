"""A drive that follows behind what is commanded."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint_and_all
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import lag
from gcode2krl.effects.parameter import Parameter


class ServoLag(Effect):
    """First order: tau·q_act' + q_act = q_cmd, from rest.

    To first order q_act is tau late, as with `dead_time`, `servo_gain` and a `clock` of q_cmd; the second
    order differs: tau²·q'' here, half of that for a pure delay.
    """

    name = "servo_lag"
    family = "timing"
    links = frozenset({"servo"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.VELOCITY})
    is_nuisance = True
    targets = staticmethod(every_joint_and_all)
    parameters = (
        Parameter(
            name="tau_s",
            unit="s",
            low=0.0,
            high=0.1,
            nominal=0.0,
            start=0.01,
            linear=True,
            minimum=0.0,
            usual=lambda mismatch: mismatch.lag_s,
            source="servo lag of large arms 10-30 ms",
        ),
    )

    def servo(self, q_act_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the motor side."""
        if applied["tau_s"] <= 0.0:
            return q_act_rad
        q = np.array(q_act_rad)
        for axis in applied.axes:
            q[:, axis] = lag(q[:, axis], inputs.time_s, applied["tau_s"])
        return q


EFFECT = ServoLag()
