"""The pedestal tilts under the robot."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter, Role
from gcode2krl.units import MM_PER_M, N_PER_KN, RAD_PER_MRAD


class PedestalCompliance(Effect):
    """The whole robot tilts about its foot by mrad_per_kNm of the moment there, about horizontal lines.

    The moment is that of the cutting load and of weight and inertia of links and payload as far as the cell
    states masses. Turns about the vertical and the sinking of the pedestal are not in it.
    """

    name = "pedestal_compliance"
    family = "compliance"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.FORCE_BY_PLACE, Dependence.PLACE, Dependence.ACCELERATION})
    parameters = (
        Parameter(
            name="mrad_per_kNm",
            unit="mrad/(kN·m)",
            low=0.0,
            high=1.0,
            nominal=0.0,
            start=0.02,
            linear=True,
            minimum=0.0,
            role=Role.SIZE,
            source="a bolted steel pedestal on concrete 20-200 MN·m/rad; rails ten times softer",
        ),
    )

    def yielding(self, tcp_mm: Floats, load: Load, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip of the tilted robot."""
        if applied["mrad_per_kNm"] == 0.0:
            return tcp_mm
        lever_mm = inputs.position_mm - inputs.axes_mm[:, 0]
        moment_Nmm = np.cross(lever_mm, load[0]) + load[1] + _of_bodies(inputs)
        moment_Nmm -= (moment_Nmm @ inputs.gravity)[:, None] * inputs.gravity
        tilt_rad = applied["mrad_per_kNm"] * RAD_PER_MRAD / (N_PER_KN * MM_PER_M) * moment_Nmm
        return tcp_mm + np.cross(tilt_rad, lever_mm)


def _of_bodies(inputs: Inputs) -> Floats:
    """Return the moment (m, 3) in N·mm of links and payload about the robot's foot."""
    lever_mm = inputs.bodies.centre_mm - inputs.axes_mm[:, :1]
    moment: Floats = np.cross(lever_mm, inputs.bodies_push_N).sum(axis=1)
    return moment


EFFECT = PedestalCompliance()
