"""The tool creeps out of its holder as the cut shakes it, and is not pushed back between the runs.

The helix pulls the shank; each tooth lets it slip by a little, so that it creeps with the impulse of the
force (pull-out of shrink and collet chucks, a known danger in hard roughing).
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, Run, STEP_s, fast

RUN_Ns = 2000.0  # impulse of one run of these programs


@declare(
    UNKNOWN,
    "geometry",
    0.001,
    0.5,
    signal="tcp",
    needs=("cut",),
    all_runs=True,
    depends=tip_("drift", "metres_cut", "force", "run_to_run", "time_smooth"),
)
def tool_creeps(draw: Draw):
    """`size` in mm for 2000 N·s."""
    over_N = draw.uniform(0.0, 60.0)

    def at(size):
        def tip(run: Run):
            press = np.maximum(np.linalg.norm(run.force_N, axis=1) - over_N, 0.0)
            impulse = np.cumsum(press) * SLOW * STEP_s + run.number * RUN_Ns
            out = fast(run, impulse[:, None]) / RUN_Ns
            run.tip_mm = run.tip_mm - size * out * run.tip_axes[:, :, 2]

        return numbers(mm=size, over_N=over_N), {"tip": tip}

    return None, at
