"""A cutting edge chips at one moment: from then on the cut costs more, in all later runs too.

A chipped edge rubs where it should cut; forces rise by a tenth to a half within one revolution.
"""

import numpy as np

from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run

SEEN = ("force", "mechanics")


@declare(
    UNKNOWN,
    "force",
    0.002,
    10.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("step", "time_step", "force", "metres_cut", links=SEEN),
)
def tool_chips(draw: Draw):
    """`size` is the rise as a share of the force."""
    number, at_s = int(draw.rng.integers(2)), draw.uniform(5.0, 9.0)

    def at(size):
        def load(run: Run):
            after = run.number > number or (run.number == number) * (run.slow_s >= at_s)
            more = (1.0 + size * np.broadcast_to(after, len(run.slow_s)))[:, None]
            run.force_N, run.moment_Nmm = run.force_N * more, run.moment_Nmm * more

        values = numbers(run=f"run-{number + 1}", at_s=at_s, size=size, unit="share of the force")
        return values, {"load": load}

    return None, at
