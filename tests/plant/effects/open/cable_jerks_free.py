"""A cable hooks at the cell's fence, is drawn tight and jerks free: a pull that ends at once.

It pulls like a spring with the way of the tip from where it hooked; at its breaking force or after some
tenths of a second the hook slips and the load is gone within milliseconds.
"""

import numpy as np

from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, Run


@declare(
    UNKNOWN,
    "force",
    0.1,
    1000.0,
    signal="force",
    all_runs=True,
    depends=force_("smooth", "time_smooth", "time_step", "travel", "place", links=("force", "mechanics")),
)
def cable_jerks_free(draw: Draw):
    """`size` in N just before it comes free."""
    number, at_s, lasts_s = int(draw.rng.integers(2)), draw.uniform(4.0, 10.0), draw.uniform(0.3, 1.2)

    def at(size):
        def load(run: Run):
            if run.number != number:
                return
            tight = (run.slow_s >= at_s - lasts_s) & (run.slow_s < at_s)
            way = run.place_mm[::SLOW] - np.array(
                [np.interp(at_s - lasts_s, run.t_s, x) for x in run.place_mm.T]
            )
            pull = -way * tight[:, None]
            largest = np.linalg.norm(pull, axis=1).max()
            rising = np.where(tight, (run.slow_s - at_s + lasts_s) / lasts_s, 0.0)[:, None]
            line = np.array([0.6, 0.6, 0.53]) * rising  # where the arm stands still while it is hooked
            run.force_N = run.force_N + size * (pull / largest if largest > 1.0 else line)

        moments = [{"run": f"run-{number + 1}", "t_s": at_s}]
        return numbers(N=size, lasts_s=lasts_s) | {"moments": moments}, {"load": load}

    return None, at
