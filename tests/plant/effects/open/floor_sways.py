"""A press next door: the floor sways in bursts that die away, whatever the robot does.

The stroke of a press or a passing truck sets the slab in motion at its own 1.5 to 4 Hz, lightly damped.
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run


@declare(
    UNKNOWN,
    "geometry",
    0.001,
    1.0,
    signal="tcp",
    all_runs=True,
    depends=tip_("periodic", "tone", "time_smooth"),
)
def floor_sways(draw: Draw):
    way, hz, every = draw.direction(), draw.uniform(1.5, 4.0), draw.uniform(3.0, 6.0)

    def at(size):
        def tip(run: Run):
            since = np.mod(run.elapsed_s + 0.7, every)
            burst = np.exp(-since / 0.6) * np.sin(2.0 * np.pi * hz * since)
            run.tip_mm = run.tip_mm + size * burst[:, None] * way

        return numbers(mm=size, hz=hz, every_s=every), {"tip": tip}

    return None, at
