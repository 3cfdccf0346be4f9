"""The cable carrier rubs along its trough: it drags against the motion, the harder the further A1 is turned.

A chain that leaves its bend rests on more links; drag is friction times the weight that lies in the trough,
here with the square of A1's angle from the middle, against the direction of motion.
"""

import numpy as np

from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, Run
from tests.plant.scene import DEGREE


@declare(
    UNKNOWN,
    "force",
    0.01,
    500.0,
    signal="force",
    all_runs=True,
    depends=force_("loop", "own_angle", "reversals", "velocity", "place", links=("force", "mechanics")),
)
def carrier_drags(draw: Draw):
    """`size` in N at 3 degrees from the middle."""
    middle_deg = draw.uniform(-1.0, 1.0)

    def at(size):
        def load(run: Run):
            angle = run.q_load[:, 0]
            along = np.tanh(run.rates(angle) / 0.002)[::SLOW]
            far = ((angle[::SLOW] / DEGREE - middle_deg) / 3.0) ** 2
            run.force_N = run.force_N + (size * far * along)[:, None] * np.array([0.0, 1.0, 0.0])

        return numbers(N=size, middle_deg=middle_deg), {"load": load}

    return None, at
