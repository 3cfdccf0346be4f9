"""A worn collet lets the tool tilt under side load, and it stays tilted until the load turns it back.

The shank sits on two rings; with clearance c over a grip of g the tip of a tool of length l moves by c·l/g,
with friction that holds it. A bell-mouthed collet of 0.01 mm clearance gives tens of micrometres at the tip.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, fast


@declare(
    UNKNOWN,
    "geometry",
    1e-4,
    1.0,
    signal="tcp",
    needs=("cut",),
    all_runs=True,
    depends=tip_("loop", "force_memory", "force", "own_torque_memory"),
)
def collet_tilts(draw: Draw):
    """`size` in mm at the tip, reached at 60 N beyond the friction."""
    grip_N = draw.uniform(20.0, 80.0)

    def at(size):
        def tip(run: Run):
            side = (run.force_N @ run.world.base.axes)[:, :2]
            grip = np.full(len(side), grip_N)
            moved = [np.tanh(memory.play(side[:, k].copy(), grip, 0.0) / 60.0) for k in (0, 1)]
            aside = np.stack([*moved, np.zeros(len(side))], axis=1)
            run.tip_mm = run.tip_mm + size * fast(run, aside)

        return numbers(mm=size, grip_N=grip_N), {"tip": tip}

    return None, at
