"""The reflector's magnet nest is loose on its post: it stays where the last jolt has left it.

Friction holds the nest up to an acceleration; beyond it slips, by hundredths of a millimetre, against the
jolt.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s


@declare(
    UNKNOWN,
    "sensor",
    1e-4,
    1.0,
    signal="tcp",
    all_runs=True,
    depends=tip_("loop", "acceleration", "reversals", "jerk"),
)
def nest_rattles(draw: Draw):
    """`size` in mm, the whole slack; friction holds up to 0.2 to 0.6 m/s²."""
    holds = draw.uniform(200.0, 600.0)

    def at(size):
        def tip(run: Run):
            jolt = run.rates(run.rates(run.place_mm))
            aside = np.zeros_like(jolt)
            for k in range(3):
                smooth = memory.lag(jolt[:, k].copy(), np.full(len(jolt), 0.01), STEP_s)
                held = memory.play(smooth, np.full(len(jolt), holds), 0.0)
                aside[:, k] = -0.5 * np.tanh(held / holds)
            run.tip_mm = run.tip_mm + size * aside

        return numbers(mm=size, holds_mm_s2=holds), {"tip": tip}

    return None, at
