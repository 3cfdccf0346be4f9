"""The pedestal tilts under the robot."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter, Role, size_from_zero
from gcode2krl.units import MM_PER_M, N_PER_KN, RAD_PER_MRAD

_SIZES = ("x_mrad_per_kNm", "y_mrad_per_kNm")


class PedestalCompliance(Effect):
    """The whole robot tilts about a foot under it, by the moment there times a compliance.

    About the robot's own x and y axes, of which a pedestal is not equally stiff about both; the foot is
    ``foot_mm`` below the robot's root, along the axis of A1. The moment is that of the cutting load and,
    times ``own_weight``, of weight and inertia of links and payload as far as the cell states masses. Turns
    about the vertical and the sinking of the pedestal are not in it.
    """

    name = "pedestal_compliance"
    family = "compliance"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.FORCE_BY_PLACE, Dependence.PLACE, Dependence.ACCELERATION})
    feels_weight = True
    parameters = (
        *(
            size_from_zero(
                name,
                "mrad/(kN·m)",
                high=1.0,
                start=0.02,
                source="a bolted steel pedestal on concrete 20-200 MN·m/rad; rails ten times softer",
            )
            for name in _SIZES
        ),
        Parameter(
            name="foot_mm",
            unit="mm",
            low=0.0,
            high=1500.0,
            nominal=None,
            start=500.0,
            grid=(0.0, 700.0),
            minimum=0.0,
            source="a robot on the floor has none below it, pedestals are 0.3-1 m high",
        ),
        Parameter(
            name="own_weight",
            unit="",
            low=0.0,
            high=1.0,
            nominal=None,
            start=1.0,
            grid=(0.0, 1.0),
            minimum=0.0,
            role=Role.COUNT,
            source="0 where a calibrated arm has the sag by its own weight in its model, 1 where nothing has",
        ),
    )

    def yielding(self, tcp_mm: Floats, load: Load, inputs: Inputs, applied: Applied) -> Floats:
        """Return the tip of the tilted robot."""
        if not any(applied[name] for name in _SIZES):
            return tcp_mm
        x, y, z = inputs.cell.base_matrix()[:3, :3]  # the root's axes along those of $BASE
        foot_mm = inputs.axes_mm[:, 0] - applied["foot_mm"] * z
        lever_mm = inputs.position_mm - foot_mm
        moment_Nmm = np.cross(lever_mm, load[0]) + load[1]
        moment_Nmm += applied["own_weight"] * _of_bodies(inputs, foot_mm)
        tilt = sum(
            applied[name] * (moment_Nmm @ axis)[:, None] * axis
            for name, axis in zip(_SIZES, (x, y), strict=True)
        )
        return tcp_mm + np.cross(RAD_PER_MRAD / (N_PER_KN * MM_PER_M) * tilt, lever_mm)


def _of_bodies(inputs: Inputs, foot_mm: Floats) -> Floats:
    """Return the moment (m, 3) in N·mm of links and payload about a foot (m, 3)."""
    lever_mm = inputs.bodies.centre_mm - foot_mm[:, None]
    moment: Floats = np.cross(lever_mm, inputs.bodies_push_N).sum(axis=1)
    return moment


EFFECT = PedestalCompliance()
