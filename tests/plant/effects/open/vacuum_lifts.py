"""A vacuum clamp lifts the part a little under side load and draws it down slowly: the cut is deeper.

Holding force is pressure times area; where the load's lever reaches the seal it opens, the part rises by
tenths, and the extra depth costs force until the pump has drawn it down.
"""

import numpy as np

from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, Run, STEP_s


def lifted(press: np.ndarray, hold: float, down_s: float) -> np.ndarray:
    """Lift in 0 ... 1: at once with the load beyond the hold, back with the pump's time."""
    out, now, keeps = np.empty(len(press)), 0.0, np.exp(-SLOW * STEP_s / down_s)
    for i, load in enumerate(press):
        now = max(now * keeps, min(max(load / hold - 1.0, 0.0), 1.0))
        out[i] = now
    return out


@declare(
    UNKNOWN,
    "force",
    1e-3,
    5.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("loop", "force_memory", "force", "force_by_place", links=("force", "mechanics", "part")),
)
def vacuum_lifts(draw: Draw):
    """`size` is the extra force at full lift as a share."""
    hold_N, down_s = draw.uniform(60.0, 150.0), draw.uniform(0.3, 1.5)

    def at(size):
        def load(run: Run):
            lift = lifted(np.linalg.norm(run.force_N[:, :2], axis=1), hold_N, down_s)
            more = 1.0 + size * lift[:, None]
            run.force_N, run.moment_Nmm = run.force_N * more, run.moment_Nmm * more

        return numbers(share=size, hold_N=hold_N, down_s=down_s), {"load": load}

    return None, at
