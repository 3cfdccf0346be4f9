"""A weld or an inclusion in the block: the force is higher in one region of it.

A repair weld in an aluminium block is harder by half; castings have chilled corners.
"""

import numpy as np

from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, Run

SEEN = ("force", "mechanics")


@declare(
    UNKNOWN,
    "force",
    0.002,
    5.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("smooth", "force_by_place", "place", "force", links=SEEN),
)
def hard_spot(draw: Draw):
    place, radius = draw.rng.uniform([30.0, -45.0], [130.0, 45.0]), draw.uniform(40.0, 70.0)

    def at(size):
        def load(run: Run):
            away = np.linalg.norm(run.place_mm[::SLOW, :2] - place, axis=1) / radius
            harder = (1.0 + size * np.exp(-(away**2)))[:, None]
            run.force_N, run.moment_Nmm = run.force_N * harder, run.moment_Nmm * harder

        return numbers(share=size, place_mm=place, radius_mm=radius), {"load": load}

    return None, at
