"""A drive that runs into its current limit."""

import math

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import JOINTS, Applied, Effect, Target, every_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import limited
from gcode2krl.effects.parameter import Parameter
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG

_SMALLER = 0.8
"""Start of a fit: so much of the largest acceleration of the run."""


class CurrentLimit(Effect):
    """The joint's acceleration is held within ``limit_deg_s2``: q_act falls behind, then catches up.

    Within the limit the drive does what is commanded. What it is behind it catches up as a position loop of
    ``k_v_per_s`` does, no faster than a fifth of the limit could brake again (our choice). The limit is one
    of acceleration, as if the torque were all inertia: gravity and cutting force take none of it. Not given,
    it is what the run demands at most, and nothing is cut off.
    """

    name = "current_limit"
    family = "timing"
    links = frozenset({"servo"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.ACCELERATION})
    targets = staticmethod(every_joint)
    parameters = (
        Parameter(
            name="limit_deg_s2",
            unit="deg/s2",
            low=1.0,
            high=2000.0,
            nominal=math.nan,
            start=100.0,
            minimum=0.01,
            source="axes of large arms reach 100-150 deg/s in 0.3-1 s: 100-500 deg/s2; wrists some 1000",
        ),
        Parameter(
            name="k_v_per_s",
            unit="1/s",
            low=5.0,
            high=200.0,
            nominal=None,
            start=30.0,
            grid=(30.0,),
            minimum=0.1,
            source="position loops of robots 10-50 1/s",
        ),
    )

    def nominal(self, inputs: Inputs, target: Target = None) -> dict[str, float]:
        """Return the largest acceleration of the run, which no limit takes anything of."""
        return {p.name: p.unset for p in self.parameters} | {"limit_deg_s2": _demanded_deg_s2(inputs, target)}

    def start(self, inputs: Inputs, target: Target = None) -> dict[str, float]:
        """Return a limit a fifth below that."""
        nominal = self.nominal(inputs, target)
        return nominal | {"limit_deg_s2": _SMALLER * nominal["limit_deg_s2"]}

    def servo(self, q_act_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the motor side."""
        limit_rad_s2 = applied["limit_deg_s2"] * RAD_PER_DEG
        if not math.isfinite(limit_rad_s2):
            return q_act_rad
        q = np.array(q_act_rad)
        q[:, applied.joint] = limited(q[:, applied.joint], inputs.time_s, limit_rad_s2, applied["k_v_per_s"])
        return q


def _demanded_deg_s2(inputs: Inputs, target: Target) -> float:
    """Return the largest commanded acceleration of a joint."""
    if len(inputs) < 3:
        return 0.0
    step_s = np.diff(inputs.time_s)
    speed = np.diff(inputs.q_cmd_rad[:, JOINTS.index(target or "")]) / step_s
    return DEG_PER_RAD * float(np.abs(2.0 * np.diff(speed) / (step_s[1:] + step_s[:-1])).max())


EFFECT = CurrentLimit()
