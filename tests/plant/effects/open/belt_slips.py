"""The belt of a motor's encoder slips when the motor speeds up hard: the reading creeps away.

Above a peripheral force a smooth belt slips in proportion to what is beyond (Euler and Eytelwein); the drive
follows the encoder, so that the joint truly goes astray, one way for each direction of acceleration.
"""

import numpy as np

from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s
from tests.plant.scene import DEGREE


@declare(
    UNKNOWN,
    "joint",
    1e-5,
    2.0,
    signal="any",
    all_runs=True,
    depends=joint_("drift", "acceleration", "travel", "own_torque_memory", "time_smooth"),
)
def belt_slips(draw: Draw):
    """`size` in degrees lost per second at the largest acceleration of the run."""
    name, j = draw.joint()
    holds = draw.uniform(0.2, 0.6)

    def at(size):
        def gear(run: Run):
            push = run.rates(run.rates(run.q_cmd))[:, j]
            push = push / max(np.abs(push).max(), 1e-12)
            slips = np.sign(push) * np.maximum(np.abs(push) - holds, 0.0) / (1.0 - holds)
            uneven = np.where(slips > 0.0, 1.0, 0.6)  # the belt is tighter on one side
            run.q_load[:, j] += size * DEGREE * np.cumsum(slips * uneven) * STEP_s

        return numbers(deg_per_s=size, holds=holds), {"gear": gear}

    return name, at
