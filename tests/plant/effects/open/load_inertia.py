"""The load's inertia in the controller is wrong, its weight is right: a following error at acceleration.

The drive's feed-forward torque misses the difference of inertia times the acceleration; the position loop
sees it as a disturbance of its stiffness.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s


@declare(
    UNKNOWN,
    "servo",
    1e-7,
    0.1,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "acceleration", links=("servo",)),
)
def load_inertia(draw: Draw):
    """`size` in s²: the error over the acceleration, 1 / (loop stiffness over missing inertia)."""
    name, j = draw.joint()
    tau_s, sign = draw.uniform(0.005, 0.02), draw.sign()

    def at(size):
        def servo(run: Run):
            push = run.rates(run.rates(run.q_cmd))[:, j]
            run.q_act[:, j] -= sign * size * memory.lag(push, np.full(len(push), tau_s), STEP_s)

        return numbers(s2=sign * size, tau_s=tau_s), {"servo": servo}

    return name, at
