"""One axis' set-points come a cycle late at every so many cycles: a beat between bus and interpolator.

With bus and interpolator on clocks of their own one set-point is held twice now and then; the axis is late by
a fraction of a cycle in proportion to its speed and catches up.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s


@declare(
    UNKNOWN,
    "servo",
    1e-6,
    0.1,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("periodic", "velocity", "tone", links=("servo",)),
)
def interpolation_jitter(draw: Draw):
    """`size` is the delay in s at its worst."""
    name, j = draw.joint()
    every_s, tau_s = draw.uniform(0.4, 2.0), 0.02

    def at(size):
        def servo(run: Run):
            saw = np.mod(run.t_s, every_s) / every_s  # grows over the beat, then a cycle is caught up
            late = memory.lag(saw, np.full(len(saw), tau_s), STEP_s)
            run.q_act[:, j] -= size * late * run.rates(run.q_cmd)[:, j]

        return numbers(delay_s=size, every_s=every_s), {"servo": servo}

    return name, at
