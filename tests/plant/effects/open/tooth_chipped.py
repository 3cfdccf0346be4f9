"""A tooth of a gear's last wheel is chipped: the joint kicks each time that this tooth carries.

A cycloidal or planetary last stage has 40 to 120 teeth a turn; the one that is chipped gives way for a third
of its pitch, always at the same angle of the joint.
"""

import numpy as np

from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, joints_for
from tests.plant.scene import DEGREE, World


@declare(
    UNKNOWN,
    "joint",
    1e-5,
    0.5,
    signal="any",
    all_runs=True,
    depends=joint_("smooth", "own_angle", "place"),
)
def tooth_chipped(draw: Draw):
    """`size` in degrees in the middle of the tooth, which lies somewhere in the work."""
    name, j = draw.joint()
    teeth, sign = draw.uniform(120.0, 360.0), draw.sign()
    place = draw.rng.uniform([[40.0, -30.0, -5.0]], [[120.0, 30.0, 5.0]])
    spot = float(joints_for(World(), place)[0, j])

    def at(size):
        def gear(run: Run):
            off = (run.q_act[:, j] - spot) / (2.0 * np.pi / teeth / 3.0)
            run.q_load[:, j] += sign * size * DEGREE * np.exp(-0.5 * off**2)

        return numbers(deg=size, at_deg=spot / DEGREE, teeth=teeth), {"gear": gear}

    return name, at
