"""The drives' common supply sags when all of them pull at once: every joint follows later at high power.

The bus voltage falls with the sum of force times speed and comes back within tenths of a second; loops with
less voltage have less gain, so that their lag grows (a weak line or an ageing capacitor).
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s


@declare(
    UNKNOWN,
    "servo",
    1e-5,
    0.2,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "velocity", "acceleration", links=("servo",)),
)
def supply_sags(draw: Draw):
    """`size` in seconds of extra lag at the largest power of the run."""
    back_s = draw.log_uniform(0.05, 0.4)

    def at(size):
        def lags(run: Run):
            speed = run.rates(run.q_cmd)
            power = np.abs(np.sum(speed * run.rates(speed), axis=1)) + 0.3 * np.sum(speed**2, axis=1)
            sag = memory.lag(power / max(power.max(), 1e-12), np.full(len(power), back_s), STEP_s)
            run.lag_s += size * sag[:, None]

        return numbers(lag_s=size, back_s=back_s), {"lags": lags}

    return None, at
