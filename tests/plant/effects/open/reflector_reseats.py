"""The reflector's ball sits anew in its nest before each run: another place each time, beyond the usual.

Dirt or a chip in a magnetic nest is worth hundredths to tenths of a millimetre; within a run nothing moves.
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run


@declare(UNKNOWN, "sensor", 0.002, 3.0, signal="tcp", all_runs=True, depends=tip_("step", "run_to_run"))
def reflector_reseats(draw: Draw):
    seed = int(draw.rng.integers(1 << 30))

    def at(size):
        def tip(run: Run):
            way = np.random.default_rng([seed, run.number]).normal(size=3)
            run.tip_mm = run.tip_mm + run.tip_axes @ (size * way)

        return numbers(mm=size), {"tip": tip}

    return None, at
