"""The hose pack hangs in a bow and swings when the arm accelerates: it pulls to and fro for seconds.

A bow of 0.3 to 1 m swings like a pendulum at 0.5 to 1 Hz, f = sqrt(g/l) / 2 pi.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, GRAVITY_m_s2, Run, STEP_s

SEEN = ("force", "mechanics")


@declare(
    UNKNOWN,
    "force",
    0.01,
    500.0,
    signal="force",
    all_runs=True,
    depends=force_("periodic", "acceleration", "tone", links=SEEN),
)
def hose_swings(draw: Draw):
    """`size` in N per 100 mm that the bow is aside."""
    bow_m, damping = draw.uniform(0.3, 1.0), draw.uniform(0.03, 0.1)
    hz = float(np.sqrt(GRAVITY_m_s2 / bow_m) / (2.0 * np.pi))

    def at(size):
        def load(run: Run):
            aside = np.zeros((len(run.slow_s), 3))
            for k in (0, 1):
                hung = memory.second_order(run.place_mm[:, k].copy(), hz, damping, STEP_s)
                aside[:, k] = (hung - run.place_mm[:, k])[::SLOW]
            run.force_N = run.force_N + size * aside / 100.0

        return numbers(N_per_100mm=size, hz=hz, damping=damping), {"load": load}

    return None, at
