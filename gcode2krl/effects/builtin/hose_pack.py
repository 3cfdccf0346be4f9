"""The hose pack pulls at the force sensor."""

from types import MappingProxyType

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter

_H0 = ("h0_x_N", "h0_y_N", "h0_z_N")
_H = tuple(f"H_{row}{column}_N_rad" for row in "xyz" for column in "xyz")
_SOURCE = "hose packs pull with 10-50 N"


class HosePack(Effect):
    """The sensor shows h0 + H·rho besides the true force, along the sensor's axes.

    rho is the rotation vector, along ``$BASE``, from the run's first orientation of the tool to the present
    one: a linear form of what Haehn & Weigold 2020 fit by a polynomial of the quaternion (eq. 17).
    """

    name = "hose_pack"
    family = "sensor"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.PLACE})
    vectors = MappingProxyType({"h0_N": _H0, "H_N_rad": _H})
    parameters = (
        *(
            Parameter(
                name=name,
                unit="N",
                low=-100.0,
                high=100.0,
                nominal=0.0,
                start=10.0,
                linear=True,
                source=_SOURCE,
            )
            for name in _H0
        ),
        *(
            Parameter(
                name=name,
                unit="N/rad",
                low=-200.0,
                high=200.0,
                nominal=0.0,
                start=20.0,
                linear=True,
                source=_SOURCE,
            )
            for name in _H
        ),
    )

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        slope = applied.vector(_H).reshape(3, 3)
        pull_N = applied.vector(_H0) + from_first_pose(inputs.rotation) @ slope.T
        return load[0] + (inputs.sensor_rotation @ pull_N[:, :, None])[:, :, 0], load[1]


def from_first_pose(rotation: Floats) -> Floats:
    """Return the rotation vectors (m, 3) in rad from the first of the quaternions (m, 4) to each."""
    matrices = fr.rotation_from_quaternion(rotation)
    turn = fr.quaternion_from_rotation(matrices @ matrices[0].T)
    sine = np.linalg.norm(turn[:, :3], axis=1)
    turned = sine > 0.0
    factor = np.where(turned, 2.0 * np.arctan2(sine, turn[:, 3]) / np.where(turned, sine, 1.0), 2.0)
    vectors: Floats = turn[:, :3] * factor[:, None]
    return vectors


EFFECT = HosePack()
