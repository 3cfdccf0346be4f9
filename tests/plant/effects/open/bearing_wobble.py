"""A worn spindle bearing: the axis wobbles at a slow beat, wider under load.

The cage of a rolling bearing turns at some 0.4 of the shaft; with the sampling or with a second bearing
it beats at a few hertz (Harris, Rolling Bearing Analysis, chapter on defect frequencies).
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, fast


@declare(
    UNKNOWN,
    "geometry",
    0.001,
    1.0,
    signal="tcp",
    all_runs=True,
    depends=tip_("periodic", "tone", "time_smooth"),
)
def bearing_wobble(draw: Draw):
    hz, phase = draw.uniform(0.7, 3.0), draw.uniform(0.0, 2.0 * np.pi)

    def at(size):
        def tip(run: Run):
            pressed = np.linalg.norm(run.force_N, axis=1, keepdims=True) / 300.0
            wide = size * (0.6 + 0.4 * fast(run, np.minimum(pressed, 2.0)))
            turn = 2.0 * np.pi * hz * run.elapsed_s + phase
            around = np.stack([np.cos(turn), np.sin(turn), 0.1 * np.sin(2.0 * turn)], axis=1)
            run.tip_mm = run.tip_mm + wide * around

        return numbers(mm=size, hz=hz), {"tip": tip}

    return None, at
