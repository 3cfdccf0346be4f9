"""Friction spikes at reversals of a joint."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import since_reversal
from gcode2krl.effects.parameter import Parameter, size_from_zero
from gcode2krl.units import RAD_PER_DEG


class Friction(Effect):
    """After each reversal q_act - q_cmd = -sign(qd)·spike·exp(-t/decay), t since the reversal.

    The direction is that of the commanded joint, with memory: standing still and going on the same way is no
    reversal, nor is the first move of the run.
    """

    name = "friction"
    family = "joint"
    links = frozenset({"servo"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.REVERSALS})
    targets = staticmethod(every_joint)
    parameters = (
        size_from_zero(
            "spike_deg", "deg", high=0.1, start=0.01, source="reversal spikes of geared axes 0.3-3 arcmin"
        ),
        Parameter(
            name="decay_s",
            unit="s",
            low=0.01,
            high=2.0,
            nominal=None,
            start=0.15,
            grid=(0.05, 0.15, 0.4),
            minimum=1e-4,
            source="integral action of position loops 0.05-0.5 s",
        ),
    )

    def servo(self, q_act_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the motor side."""
        spike_rad = applied["spike_deg"] * RAD_PER_DEG
        if spike_rad == 0.0:
            return q_act_rad
        direction, since_s = since_reversal(inputs.q_cmd_rad[:, applied.joint], inputs.time_s)
        q = np.array(q_act_rad)
        q[:, applied.joint] -= direction * spike_rad * np.exp(-since_s / applied["decay_s"])
        return q


EFFECT = Friction()
