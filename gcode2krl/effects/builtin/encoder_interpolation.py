"""The interpolation of a motor's encoder."""

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.motor_effect import MotorEffect
from gcode2krl.effects.parameter import Parameter, Role, phase_parameter, size_from_zero
from gcode2krl.units import RAD_PER_DEG, RAD_PER_REV


class EncoderInterpolation(MotorEffect):
    """Motor side: amplitude·sin(periods·gear ratio·q + phase) is added, q in rad as commanded.

    Its sine and cosine signals are not alike, or not about zero (Heydemann 1981). ``periods`` a turn of the
    motor; one error a period, twice that for signals of unlike size. Between two samples the motor may pass
    whole periods: each value is the mean over its sample, which leaves nothing of an error that is faster.
    The encoder alone is wrong: behind the gear the joint does nothing of it.
    """

    name = "encoder_interpolation"
    family = "joint"
    links = frozenset({"servo"})
    is_misread = True
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.MOTOR_ANGLE})
    parameters = (
        size_from_zero(
            "amplitude_deg",
            "deg",
            high=0.01,
            start=2e-4,
            source="1 % of a period of 512 a turn through a gear of 250: 3e-5; a resolver's 0.1 deg: 4e-4",
        ),
        Parameter(
            name="periods",
            unit="",
            low=1.0,
            high=4096.0,
            nominal=None,
            start=512.0,
            grid=(1.0, 2.0, 3.0, 4.0, 256.0, 512.0, 1024.0),
            minimum=0.0,
            role=Role.COUNT,
            source="resolvers have 1-4 pole pairs, optical encoders of motors 256-2048 periods a turn",
        ),
        phase_parameter(),
    )

    def servo(self, q_act_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the motor side as the encoder states it."""
        return q_act_rad + _error_rad(inputs, applied)

    def gear(self, q_load_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the joints less what only the encoder says."""
        return q_load_rad - _error_rad(inputs, applied)


def _error_rad(inputs: Inputs, applied: Applied) -> Floats:
    """Return the error of the reading (m, 6)."""
    ratios = inputs.cell.robot.drives.gear_ratio
    error = np.zeros_like(inputs.q_cmd_rad)
    if ratios is None or applied["amplitude_deg"] == 0.0:
        return error
    turn = applied["periods"] * ratios[applied.joint] * inputs.q_cmd_rad[:, applied.joint]
    seen = np.sin(turn + applied["phase"]) * np.sinc(_passed(turn) / RAD_PER_REV)
    error[:, applied.joint] = applied["amplitude_deg"] * RAD_PER_DEG * seen
    return error


def _passed(turn: Floats) -> Floats:
    """Return by how much (m,) a sine's argument changes over a sample."""
    return np.gradient(turn) if len(turn) > 1 else np.zeros_like(turn)


EFFECT = EncoderInterpolation()
