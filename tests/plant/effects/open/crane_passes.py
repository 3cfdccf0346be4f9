"""A hall crane passes: the floor settles under its rail and rises again, within seconds.

A slab under a moving load bends by tenths of a millimetre over metres; the robot's foot tilts and the
tracker's stand does not tilt alike. It happens once, in one run.
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run


@declare(UNKNOWN, "geometry", 0.001, 1.0, signal="tcp", all_runs=True, depends=tip_("smooth", "time_smooth"))
def crane_passes(draw: Draw):
    number, at_s, width_s = int(draw.rng.integers(3)), draw.uniform(4.0, 9.0), draw.uniform(0.8, 2.5)
    way = draw.direction() * np.array([0.5, 0.5, 1.0])

    def at(size):
        def tip(run: Run):
            if run.number == number:
                under = np.exp(-0.5 * ((run.t_s - at_s) / width_s) ** 2)
                run.tip_mm = run.tip_mm - size * under[:, None] * way

        return numbers(mm=size, run=f"run-{number + 1}", at_s=at_s, width_s=width_s), {"tip": tip}

    return None, at
