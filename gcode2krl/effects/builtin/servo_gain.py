"""A position loop whose velocity feed-forward is not one."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint_and_all
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import lag
from gcode2krl.effects.parameter import Parameter

_K_V_PER_S = 30.0


class ServoGain(Effect):
    """q_act' = k_v·(q_cmd - q_act) + (1 - missing)·q_cmd': a loop of gain k_v and what is fed forward to it.

    So q_act = q_cmd + missing·(lag(q_cmd) - q_cmd), a lag of 1/k_v: behind by missing/k_v times the speed,
    as soon as that has been steady for 1/k_v; below 0 ahead. All of it missing is `servo_lag` of 1/k_v. To
    first order the twin of that, of `dead_time` and of a `clock` of q_cmd. A loop has no error at rest, so a
    static gain is not in it (Groß et al. 2006, Electrical Feed Drives; velocity loop taken as much faster).
    """

    name = "servo_gain"
    family = "timing"
    links = frozenset({"servo"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.VELOCITY})
    targets = staticmethod(every_joint_and_all)
    parameters = (
        Parameter(
            name="missing_share",
            unit="",
            low=-0.5,
            high=1.0,
            nominal=0.0,
            start=0.3,
            linear=True,
            usual=lambda mismatch: mismatch.lag_s * _K_V_PER_S,
            source="0 with all of the speed fed forward, 1 with none; above it a loop leads",
        ),
        Parameter(
            name="k_v_per_s",
            unit="1/s",
            low=5.0,
            high=200.0,
            nominal=None,
            start=_K_V_PER_S,
            grid=(_K_V_PER_S,),
            minimum=0.1,
            source="position loops of robots 10-50 1/s, of machine tools up to 170 (10 m/min per mm)",
        ),
    )

    def servo(self, q_act_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the motor side."""
        if applied["missing_share"] == 0.0:
            return q_act_rad
        q = np.array(q_act_rad)
        for axis in applied.axes:
            behind = lag(q[:, axis], inputs.time_s, 1.0 / applied["k_v_per_s"]) - q[:, axis]
            q[:, axis] += applied["missing_share"] * behind
        return q


EFFECT = ServoGain()
