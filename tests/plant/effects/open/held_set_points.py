"""Packets of set-points are lost: all drives hold the last one for some cycles and then catch up.

A lost packet of a field bus repeats the last value; the loops see a step of speed times the hold and take it
up with their own time. Lost packets come by chance, a handful a run.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s


@declare(
    UNKNOWN,
    "servo",
    1e-4,
    0.3,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "time_smooth", "time_step", "velocity", "noise", links=("servo",)),
    moments=True,
)
def held_set_points(draw: Draw):
    """`size` in seconds of the longest hold."""
    seed, count = int(draw.rng.integers(1 << 30)), draw.uniform(3.0, 9.0)

    def at(size):
        def servo(run: Run):
            rng = np.random.default_rng([seed, run.number])
            behind = np.zeros(len(run.t_s))
            for begin, share in rng.uniform([0.5, 0.4], [run.t_s[-1], 1.0], (int(count), 2)):
                since = run.t_s - begin
                behind += np.where((since >= 0.0) & (since < size * share), since, 0.0)
            behind = memory.lag(behind, np.full(len(behind), 0.008), STEP_s)
            run.q_act -= behind[:, None] * run.rates(run.q_cmd)

        return numbers(hold_s=size, count=int(count)), {"servo": servo}

    return None, at
