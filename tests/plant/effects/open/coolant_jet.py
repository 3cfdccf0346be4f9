"""The coolant jet pushes at the tool: full pressure at first, less once the line has filled.

A jet of 20 l/min at 30 m/s gives up 10 N, at high pressure several times that (momentum, rho·Q·v). It is on
from the first cutting move to the last.
"""

import numpy as np

from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run

SEEN = ("force", "mechanics")


@declare(
    UNKNOWN,
    "force",
    0.1,
    200.0,
    signal="force",
    all_runs=True,
    depends=force_("drift", "time_since_start", "time_smooth", "time_step", links=SEEN),
)
def coolant_jet(draw: Draw):
    way, falls_s, left = draw.direction(), draw.log_uniform(1.5, 6.0), draw.uniform(0.2, 0.6)

    def at(size):
        def load(run: Run):
            wet = np.flatnonzero(run.cut.depth_mm > 0.0)
            if not len(wet):
                return  # no cut, no coolant
            on = (run.slow_s >= run.slow_s[wet[0]]) & (run.slow_s <= run.slow_s[wet[-1]])
            since = np.maximum(run.slow_s - run.slow_s[wet[0]], 0.0)
            push = size * on * (left + (1.0 - left) * np.exp(-since / falls_s))
            run.force_N = run.force_N + push[:, None] * way

        return numbers(N=size, falls_s=falls_s, left=left), {"load": load}

    return None, at
