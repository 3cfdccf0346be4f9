"""Rolled plate bows when its skin is cut away, and takes the fixture's reference with it.

Residual stress in 30 mm aluminium plate is worth tenths of a millimetre of bow; it comes with the material
that is removed, most of it when the skin is through, and it stays (Heymès et al. 1997, on 7xxx plate).
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, fast

MIDDLE_mm = np.array([80.0, 0.0])


@declare(
    UNKNOWN,
    "part",
    0.001,
    5.0,
    signal="tcp",
    needs=("cut",),
    all_runs=True,
    depends=tip_("drift", "metres_cut", "time_smooth", "place"),
)
def stress_release(draw: Draw):
    """`size` in mm of bow 80 mm from the middle; each run cuts a fresh block."""
    skin_m, bend = draw.uniform(0.1, 0.35), draw.uniform(0.3, 1.0)

    def at(size):
        def tip(run: Run):
            freed = 1.0 / (1.0 + np.exp(-(run.metres_cut - skin_m) / (0.2 * skin_m)))
            freed = fast(run, freed[:, None])[:, 0]
            out = (run.place_mm[:, :2] - MIDDLE_mm) / 80.0
            bow = 0.5 + np.minimum(out[:, 0] ** 2, 2.0) + bend * np.minimum(out[:, 1] ** 2, 2.0)
            run.tip_mm = run.tip_mm.copy()
            run.tip_mm[:, 2] -= size * freed * bow

        return numbers(mm=size, skin_m=skin_m), {"tip": tip}

    return None, at
