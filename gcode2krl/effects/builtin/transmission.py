"""Periodic transmission error of a gear."""

import math

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.motor_effect import MotorEffect
from gcode2krl.effects.parameter import Parameter, Role, phase_parameter
from gcode2krl.units import RAD_PER_DEG


class Transmission(MotorEffect):
    """Behind the gear: amplitude·sin(harmonic·gear ratio·q + phase) is added, q in rad of the motor side.

    ``phase`` in rad; harmonic 1 is once a turn of the motor.
    """

    name = "transmission"
    family = "joint"
    links = frozenset({"gear"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.MOTOR_ANGLE})
    is_nuisance = True
    parameters = (
        Parameter(
            name="amplitude_deg",
            unit="deg",
            low=0.0,
            high=0.02,
            nominal=0.0,
            start=0.004,
            linear=True,
            minimum=0.0,
            usual=lambda mismatch: mismatch.play_deg,
            source="1-60 arcsec at once and twice a turn of the motor",
        ),
        Parameter(
            name="harmonic",
            unit="",
            low=0.1,
            high=12.0,
            nominal=None,
            start=1.0,
            grid=(1.0, 2.0),
            minimum=0.0,
            role=Role.COUNT,
            source="once and twice a turn of the motor are the strongest; tooth meshes are higher",
        ),
        phase_parameter(grid=(0.0, math.pi / 2.0)),
    )

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return what is behind the gear."""
        ratios = inputs.cell.robot.drives.gear_ratio
        amplitude_rad = applied["amplitude_deg"] * RAD_PER_DEG
        if ratios is None or amplitude_rad == 0.0:
            return q_load_rad
        q = np.array(q_load_rad)
        turn = applied["harmonic"] * ratios[applied.joint] * q[:, applied.joint]
        q[:, applied.joint] += amplitude_rad * np.sin(turn + applied["phase"])
        return q


EFFECT = Transmission()
