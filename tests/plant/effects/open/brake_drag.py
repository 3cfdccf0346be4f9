"""A holding brake that does not lift all the way: it drags until it has warmed.

The drive's integral part works off a part of the constant torque; what is left is a following error against
the motion. Friction of a brake lining fades with heat within seconds to a minute.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run
from tests.plant.scene import DEGREE


@declare(
    UNKNOWN,
    "servo",
    1e-6,
    0.2,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("loop", "reversals", "time_since_start", "velocity", links=("servo",)),
)
def brake_drag(draw: Draw):
    name, j = draw.joint()
    fades_s, still = draw.log_uniform(3.0, 15.0), 2e-3

    def at(size):
        def servo(run: Run):
            speed = run.rates(run.q_cmd)[:, j]
            drag = np.exp(-run.elapsed_s / fades_s) * np.tanh(speed / still)
            late = memory.lag(drag, np.full(len(drag), 0.03), 0.001)
            run.q_act[:, j] -= size * DEGREE * late

        return numbers(deg=size, fades_s=fades_s), {"servo": servo}

    return name, at
