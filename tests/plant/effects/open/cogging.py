"""The motor cogs: its magnets favour some angles, so the drive lags and leads within a turn.

Cogging repeats with the least common multiple of slots and poles, 6 to 18 times a motor turn here. The speed
loop suppresses it where it comes slowly, inertia where it comes fast (Jahns and Soong 1996).
"""

import numpy as np

from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run
from tests.plant.scene import DEGREE, GEAR_RATIO


@declare(
    UNKNOWN,
    "servo",
    1e-6,
    0.05,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("periodic", "motor_angle", "velocity", links=("servo", "gear", "mechanics")),
)
def cogging(draw: Draw):
    name, j = draw.joint()
    count, phase, middle_hz = draw.pick([6, 12, 18]), draw.uniform(0.0, 2.0 * np.pi), draw.uniform(6.0, 20.0)

    def at(size):
        def servo(run: Run):
            angle = count * GEAR_RATIO[j] * run.q_cmd[:, j]
            hz = np.abs(run.rates(angle)) / (2.0 * np.pi) / middle_hz
            band = 2.0 * hz / (1.0 + hz**2)  # most at the middle, less on either side
            run.q_act[:, j] += size * DEGREE * band * np.sin(angle + phase)

        return numbers(deg=size, count=count, middle_hz=middle_hz), {"servo": servo}

    return name, at
