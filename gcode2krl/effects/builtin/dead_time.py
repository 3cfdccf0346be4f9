"""A drive that does what is commanded some time later."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint_and_all
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import delayed
from gcode2krl.effects.parameter import Parameter


class DeadTime(Effect):
    """q_act(t) = q_cmd(t - delay): cycles of a bus, of an interpolator's and a drive's filters without a lag.

    At the drives alone it is what a `clock` of q_cmd that is ``delay_s`` ahead is; that one also sets the
    commanded path early. To first order it is `servo_lag`; corners keep their shape here.
    """

    name = "dead_time"
    family = "timing"
    links = frozenset({"servo"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.VELOCITY})
    targets = staticmethod(every_joint_and_all)
    parameters = (
        Parameter(
            name="delay_s",
            unit="s",
            low=0.0,
            high=0.2,
            nominal=0.0,
            start=0.01,
            linear=True,
            minimum=0.0,
            usual=lambda mismatch: mismatch.lag_s,
            source="1-3 cycles of 4 or 12 ms between interpolator and drives; filtered commands 40-100 ms",
        ),
    )

    def servo(self, q_act_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the motor side."""
        if applied["delay_s"] == 0.0:
            return q_act_rad
        q, axes = np.array(q_act_rad), list(applied.axes)
        q[:, axes] = delayed(q[:, axes], inputs.time_s, applied["delay_s"])
        return q


EFFECT = DeadTime()
