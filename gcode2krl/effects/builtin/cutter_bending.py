"""The cutter bends."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import size_from_zero
from gcode2krl.units import UM_PER_MM


class CutterBending(Effect):
    """The tip yields by um_per_N of the cutting force across the tool's axis, as a cantilever does.

    F·L³/(3·E·I), the force at the free end. The arm does not move: neither joints nor what is before the
    cutter.
    """

    name = "cutter_bending"
    family = "compliance"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.FORCE})
    parameters = (
        size_from_zero(
            "um_per_N",
            "µm/N",
            high=10.0,
            start=0.2,
            source="carbide, I of 0.8 diameters: 16 mm wide and 60 long 0.1, 6 by 40 1.4, 3 by 30 9",
        ),
    )

    def yielding(self, tcp_mm: Floats, load: Load, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip of the bent cutter."""
        if applied["um_per_N"] == 0.0:
            return tcp_mm
        axis = inputs.tool_rotation[:, :, 2]
        lateral_N = load[0] - np.sum(load[0] * axis, axis=1, keepdims=True) * axis
        bent: Floats = tcp_mm + applied["um_per_N"] / UM_PER_MM * lateral_N
        return bent


EFFECT = CutterBending()
