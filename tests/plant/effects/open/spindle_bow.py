"""The spindle's housing warms on the side of the drive: the tool's axis bows sideways and tilts.

A motor or a belt on one side of a spindle gives a gradient across the housing; the nose moves by tens of
micrometres within the first minutes, at high speed sooner (ISO 230-3 measures it with five probes).
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.effects.surroundings import grown
from tests.plant.robot import Run


@declare(
    UNKNOWN,
    "geometry",
    0.001,
    0.5,
    signal="tcp",
    all_runs=True,
    depends=tip_("drift", "time_since_start", "spindle_speed", "time_smooth"),
)
def spindle_bow(draw: Draw):
    """It overshoots: the near side warms first, the far side follows."""
    angle, quick_s, late_s = draw.uniform(0.0, 2.0 * np.pi), draw.uniform(1.5, 4.0), draw.uniform(6.0, 15.0)
    way = np.array([np.cos(angle), np.sin(angle), 0.0])

    def at(size):
        def tip(run: Run):
            bow = grown(run, quick_s) - 0.8 * grown(run, late_s)
            run.tip_mm = run.tip_mm + size * bow[:, None] * (run.tip_axes @ way)

        return numbers(mm=size, quick_s=quick_s, late_s=late_s), {"tip": tip}

    return None, at
