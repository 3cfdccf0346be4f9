"""A following error in step with the commanded jerk."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint_and_all
from gcode2krl.effects.inputs import Inputs, gradient
from gcode2krl.effects.operators import lag
from gcode2krl.effects.parameter import Parameter


class JerkFeedForward(Effect):
    """q_act - q_cmd = per_jerk·jerk, the commanded jerk after two lags of ``settle_s``; below 0 behind.

    A drive that is fed speed and torque but not how the torque changes is off where the acceleration changes,
    at both ends of every ramp. The jerk is that of the sampled command: what is shorter than two samples is
    spread over them.
    """

    name = "jerk_feed_forward"
    family = "timing"
    links = frozenset({"servo"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.JERK})
    targets = staticmethod(every_joint_and_all)
    parameters = (
        Parameter(
            name="per_jerk_s3",
            unit="s3",
            low=-1e-4,
            high=1e-4,
            nominal=0.0,
            start=-1e-6,
            linear=True,
            source="product of the loops' time constants: 1, 5 and 30 ms are 1.5e-7, soft loops 1e-5",
        ),
        Parameter(
            name="settle_s",
            unit="s",
            low=0.001,
            high=0.1,
            nominal=None,
            start=0.01,
            grid=(0.01,),
            minimum=1e-4,
            source="velocity loops of drives settle within 4-25 ms",
        ),
    )

    def servo(self, q_act_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the motor side."""
        if applied["per_jerk_s3"] == 0.0:
            return q_act_rad
        q, time_s, settle_s = np.array(q_act_rad), inputs.time_s, applied["settle_s"]
        for axis in applied.axes:
            jerk = _jerk(inputs.q_cmd_rad[:, [axis]], time_s)
            q[:, axis] += applied["per_jerk_s3"] * lag(lag(jerk, time_s, settle_s), time_s, settle_s)
        return q


def _jerk(q_rad: Floats, time_s: Floats) -> Floats:
    """Return the third derivative (m,) of an angle (m, 1), that of the nearest whole stencil at the ends."""
    jerk = gradient(gradient(gradient(q_rad, time_s), time_s), time_s)[:, 0]
    inner = np.clip(np.arange(len(jerk)), min(3, len(jerk) // 2), max(len(jerk) - 4, len(jerk) // 2))
    whole: Floats = jerk[inner]
    return whole


EFFECT = JerkFeedForward()
