"""Rolled plate bows when its skin is cut away: the robot's tip is where it should be, the part is not.

Residual stress in 30 mm aluminium plate is worth tenths of a millimetre of bow; it comes with the material
that is removed, most of it when the skin is through, and it stays (Heymès et al. 1997, on 7xxx plate).
"""

import numpy as np

from tests.plant.effects.depends import Depends
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, Run

MIDDLE_mm = np.array([80.0, 0.0])


@declare(
    UNKNOWN,
    "part",
    0.001,
    1.0,
    signal="scan",
    needs=("cut", "scan"),
    all_runs=True,
    depends=Depends("part", ("metres_cut", "time_smooth", "place"), "drift", ("part",)),
)
def stress_release(draw: Draw):
    """`size` in mm of bow 80 mm from the middle, upwards; each run cuts a fresh block.

    Where the plate has risen under the tool the cut is too deep; for the scan it is drawn flat again.
    """
    skin_m, bend = draw.uniform(0.1, 0.35), draw.uniform(0.3, 1.0)

    def at(size):
        def tip(run: Run):
            freed = 1.0 / (1.0 + np.exp(-(run.metres_cut - skin_m) / (0.2 * skin_m)))
            out = (run.place_mm[::SLOW, :2] - MIDDLE_mm) / 80.0
            bow = 0.5 + np.minimum(out[:, 0] ** 2, 2.0) + bend * np.minimum(out[:, 1] ** 2, 2.0)
            run.part_mm = run.part_mm + (size * freed * bow)[:, None] * np.array([0.0, 0.0, 1.0])

        return numbers(mm=size, skin_m=skin_m), {"tip": tip}

    return None, at
