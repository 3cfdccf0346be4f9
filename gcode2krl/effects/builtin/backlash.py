"""Backlash of a gear."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint_and_all
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import play
from gcode2krl.effects.parameter import Parameter
from gcode2krl.units import RAD_PER_DEG


class Backlash(Effect):
    """Play with memory between motor and arm: q_load - q_act within ± gap/2, changing only at its ends.

    The run begins in the middle of the gap (an assumption, forgotten at the first reversal). Gravity that
    preloads a gear is not in it.
    """

    name = "backlash"
    family = "joint"
    links = frozenset({"gear"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.REVERSALS})
    is_nuisance = True
    targets = staticmethod(every_joint_and_all)
    parameters = (
        Parameter(
            name="gap_deg",
            unit="deg",
            low=0.0,
            high=0.1,
            nominal=0.0,
            start=0.01,
            minimum=0.0,
            usual=lambda mismatch: mismatch.play_deg,
            source="reversal error of a large KUKA 0.3-1 arcmin; worn gears several times that",
        ),
    )

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what is behind the gear."""
        q = np.array(q_load_rad)
        for axis in applied.axes:
            q[:, axis] = play(q[:, axis], applied["gap_deg"] * RAD_PER_DEG / 2.0)
        return q


EFFECT = Backlash()
