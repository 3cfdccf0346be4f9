"""Elastic hysteresis of a gear."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.operators import play
from gcode2krl.effects.parameter import size_from_zero
from gcode2krl.units import RAD_PER_DEG


class Hysteresis(Effect):
    """The axis turns by loss·play(torque)/full beyond the linear model, under the load at the tip.

    ``full`` is the run's largest torque about the axis, and the play operator's width is ``full``, ± full/2:
    cycled between ± full the loop is ``loss_deg`` wide, and the angle lags the torque (losses, never gains).
    Proportional to the load cycle (Masing's rule), so a run without load shows nothing. Our choice where the
    form leaves the width open.
    """

    name = "hysteresis"
    family = "compliance"
    links = frozenset({"mechanics"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.OWN_TORQUE})
    targets = staticmethod(every_joint)
    parameters = (
        size_from_zero(
            "loss_deg",
            "deg",
            high=0.1,
            start=0.01,
            source="hysteresis loss of cycloidal and wave gears 0.5-2 arcmin",
        ),
    )

    def elastic(self, angle_rad: Floats, torque_Nm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the angles with the lagging part."""
        torque = torque_Nm[:, applied.joint]
        full_Nm = float(np.nanmax(np.abs(torque), initial=0.0))
        if applied["loss_deg"] == 0.0 or full_Nm == 0.0:
            return angle_rad
        angle = np.array(angle_rad)
        angle[:, applied.joint] += applied["loss_deg"] * RAD_PER_DEG * play(torque, full_Nm / 2.0) / full_Nm
        return angle


EFFECT = Hysteresis()
