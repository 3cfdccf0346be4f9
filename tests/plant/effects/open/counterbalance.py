"""The gas spring that carries A2 has another pressure than the model: the arm sags with its angle.

Its torque about A2 goes with the sine of the angle from the dead point and with the gas' absolute
temperature; as the spring warms by 10 to 20 K in a shift the torque grows by some percent (ideal gas).
"""

import numpy as np

from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, Run
from tests.plant.scene import DEGREE


@declare(
    UNKNOWN,
    "compliance",
    1e-5,
    1.0,
    signal="tcp",
    hours=True,
    all_runs=True,
    depends=joint_("smooth", "wall_clock", "own_angle", "temperature", links=("mechanics",)),
)
def counterbalance(draw: Draw):
    """`size` is the sag in degrees at a right angle, once warm; cold half of it."""
    dead_deg, warms_h = draw.uniform(-130.0, -60.0), draw.uniform(0.5, 2.0)

    def at(size):
        def bend(run: Run):
            hours = (run.age_s + run.elapsed_s[::SLOW]) / 3600.0
            warm = 1.0 - 0.5 * np.exp(-hours / warms_h)
            run.extra_rad[:, 1] += size * DEGREE * warm * np.sin(run.q_load[::SLOW, 1] - dead_deg * DEGREE)

        return numbers(deg=size, dead_deg=dead_deg, warms_h=warms_h), {"bend": bend}

    return "A2", at
