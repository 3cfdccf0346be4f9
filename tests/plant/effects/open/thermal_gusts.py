"""Gusts of warm air from a door or a heater cross the tracker's beam: seconds of wander, then quiet.

The beam's bend goes with the temperature gradient across it; in a gust it changes within tenths of a second
(Estler et al. 2002, on large-scale metrology).
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s


@declare(
    UNKNOWN, "sensor", 0.001, 0.5, signal="tcp", all_runs=True, depends=tip_("smooth", "time_smooth", "noise")
)
def thermal_gusts(draw: Draw):
    seed, memory_s, lasts_s = int(draw.rng.integers(1 << 30)), draw.uniform(0.3, 1.0), draw.uniform(1.0, 2.5)
    beam = draw.direction() * np.array([1.0, 1.0, 0.2])

    def at(size):
        def tip(run: Run):
            rng = np.random.default_rng([seed, run.number])
            n, keeps = len(run.t_s), float(np.exp(-STEP_s / memory_s))
            gust = np.zeros(n)
            for start in rng.uniform(0.0, run.t_s[-1], 3):
                gust += np.exp(-0.5 * ((run.t_s - start) / (0.4 * lasts_s)) ** 2)
            wander = np.stack([memory.coloured(rng.normal(size=n), keeps) for _ in range(3)], axis=1)
            along = beam / np.linalg.norm(beam)
            across = wander - (wander @ along)[:, None] * along
            run.tip_mm = run.tip_mm + size * gust[:, None] * across

        return numbers(mm=size, memory_s=memory_s, lasts_s=lasts_s), {"tip": tip}

    return None, at
