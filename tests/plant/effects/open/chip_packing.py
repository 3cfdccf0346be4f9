"""Chips pack in a slot and come loose: extra force in heaps, most where the cutter is enclosed.

Without enough coolant aluminium chips weld to the flutes and are cut again; a recut chip costs up to as much
as the cut itself, for tenths of a second.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, Run, STEP_s


@declare(
    UNKNOWN,
    "force",
    0.005,
    20.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("smooth", "force", "force_by_place", "noise", links=("force", "mechanics")),
)
def chip_packing(draw: Draw):
    """`size` is the mean of the heaps as a share of the cutting force."""
    seed, lasts_s = int(draw.rng.integers(1 << 30)), draw.uniform(0.15, 0.5)

    def at(size):
        def load(run: Run):
            rng = np.random.default_rng([seed, run.number])
            n, keeps = len(run.slow_s), float(np.exp(-SLOW * STEP_s / lasts_s))
            heap = np.maximum(memory.coloured(rng.normal(size=n), keeps) - 0.8, 0.0)
            enclosed = np.minimum(run.cut.width_mm / run.world.cutter.diameter_mm, 1.0) ** 2
            more = (1.0 + size * 5.0 * heap * enclosed)[:, None]  # the mean of a heap is a fifth
            run.force_N, run.moment_Nmm = run.force_N * more, run.moment_Nmm * more

        return numbers(share=size, lasts_s=lasts_s), {"load": load}

    return None, at
