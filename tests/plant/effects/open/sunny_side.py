"""The sun through a hall's window warms one side of the upper arm: it bows away from the sun, until it sets.

A beam of height h with dT across it bows by alpha·dT·L²/(2h): 1.1 m of aluminium, 0.25 m high and 4 K make
0.2 mm. The bow turns with A1, so that its direction in the room changes with the pose.
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run


@declare(
    UNKNOWN,
    "geometry",
    1e-3,
    3.0,
    signal="tcp",
    hours=True,
    all_runs=True,
    depends=tip_("drift", "wall_clock", "temperature", "time_smooth", "run_to_run"),
)
def sunny_side(draw: Draw):
    """`size` in mm at noon, which comes some hours after the first run."""
    noon_h, side = draw.uniform(1.0, 4.0), draw.sign()

    def at(size):
        def tip(run: Run):
            hours = (run.age_s + run.elapsed_s) / 3600.0
            sun = np.maximum(np.cos(np.pi / 2.0 * (hours - noon_h) / 4.0), 0.0)
            turn = -run.q_load[:, 0] + side * np.pi / 2.0
            way = np.stack([np.cos(turn), np.sin(turn), -0.3 * np.ones(len(turn))], axis=1)
            run.tip_mm = run.tip_mm + size * sun[:, None] * way

        return numbers(mm=size, noon_h=noon_h), {"tip": tip}

    return None, at
