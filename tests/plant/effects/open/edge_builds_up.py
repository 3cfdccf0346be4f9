"""Aluminium welds to the cutting edge, grows and breaks away: the force creeps up and falls again.

A built-up edge changes the rake and the depth; its cycle goes with the length of cut, not with time (Trent
and Wright, Metal Cutting).
"""

import numpy as np

from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run


@declare(
    UNKNOWN,
    "force",
    1e-3,
    5.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("periodic", "metres_cut", "force", "time_smooth", links=("force", "mechanics")),
)
def edge_builds_up(draw: Draw):
    """`size` is the share by which the force has grown when the edge breaks away."""
    cycle_m, begins = draw.uniform(0.08, 0.25), draw.uniform(0.0, 1.0)

    def at(size):
        def load(run: Run):
            grown = np.mod(run.metres_cut / cycle_m + begins, 1.0)
            more = 1.0 + size * grown[:, None]
            run.force_N, run.moment_Nmm = run.force_N * more, run.moment_Nmm * more

        return numbers(share=size, cycle_m=cycle_m), {"load": load}

    return None, at
