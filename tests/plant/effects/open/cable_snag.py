"""A cable of the dress pack catches when A1 has turned so far: from there it pulls like a spring.

A one-sided stop at an angle; when the arm turns back the cable is loose again.
"""

import numpy as np

from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, Run
from tests.plant.scene import DEGREE

SEEN = ("force", "mechanics")


@declare(
    UNKNOWN,
    "force",
    0.05,
    500.0,
    signal="force",
    all_runs=True,
    depends=force_("smooth", "own_angle", "place", "travel", links=SEEN),
)
def cable_snag(draw: Draw):
    """`size` in N per degree of A1 beyond the stop."""
    from_deg, side = draw.uniform(-1.2, 1.2), draw.sign()
    way = draw.direction()

    def at(size):
        def load(run: Run):
            beyond = np.maximum(side * (run.q_load[::SLOW, 0] / DEGREE - from_deg), 0.0)
            run.force_N = run.force_N + size * beyond[:, None] * way

        return numbers(N_per_deg=size, from_deg=from_deg, side=side), {"load": load}

    return None, at
