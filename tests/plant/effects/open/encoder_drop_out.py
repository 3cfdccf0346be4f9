"""A scratch on the disc of a load encoder: each pass over it loses some counts, and they stay lost.

Without a reference mark on the way the count is off from then on; passes to and fro need not cancel.
"""

import numpy as np

from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, joints_for
from tests.plant.scene import DEGREE, World


@declare(
    UNKNOWN,
    "sensor",
    1e-6,
    0.2,
    signal="joint_load",
    needs=("q_load",),
    all_runs=True,
    depends=joint_("step", "time_step", "own_angle", "travel", links=("gear",)),
)
def encoder_drop_out(draw: Draw):
    """`size` in degrees lost at each pass in one direction, where the tip is at some place of the work."""
    name, j = draw.joint()
    place = draw.rng.uniform([[40.0, -30.0, -5.0]], [[120.0, 30.0, 5.0]])
    scratch = float(joints_for(World(), place)[0, j])

    def at(size):
        def sense(run: Run):
            q = run.q_load[:, j]
            passes = np.diff((q > scratch).astype(int), prepend=int(q[0] > scratch)) > 0
            run.q_load[:, j] -= size * DEGREE * np.cumsum(passes)

        return numbers(deg=size, at_deg=scratch / DEGREE), {"sense": sense}

    return name, at
