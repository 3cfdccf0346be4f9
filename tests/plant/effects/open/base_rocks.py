"""The robot's base plate stands on three of four feet and rocks over a diagonal as the arm passes it.

Weight and inertia of the arm about the diagonal press one foot or the other down; near the balance the plate
tips from one to the other, a turn of clearance over foot distance, here against a soft shim.
"""

import numpy as np

from tests.plant import masses
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, fast, to_root


@declare(
    UNKNOWN,
    "set-up",
    1e-4,
    3.0,
    signal="tcp",
    all_runs=True,
    depends=tip_("smooth", "own_torque", "place", "acceleration", "own_angle"),
)
def base_rocks(draw: Draw):
    """`size` in mm at 1.5 m from foot to foot; the balance lies within the work."""
    side, soft = draw.sign(), draw.log_uniform(0.1, 0.5)
    line = np.array([np.cos(np.pi / 4.0), side * np.sin(np.pi / 4.0), 0.0])

    def at(size):
        def tip(run: Run):
            moment = masses.moment_about(run, np.zeros(3)) @ line
            middle, wide = np.median(moment), max(float(moment.std()), 1.0)
            turn = size / 1500.0 * np.tanh((moment - middle) / (soft * wide))
            place = to_root(run.world, run.tip_mm)
            swing = np.cross(fast(run, turn[:, None] * line), place) @ run.world.base.axes
            run.tip_mm = run.tip_mm + swing

        return numbers(mm=size, soft=soft, side=side), {"tip": tip}

    return None, at
