"""The reflector's mirrors are not centred in its ball: the place read depends on how the beam comes in.

Off-centre mirrors or a wrong index of a solid prism move the apparent centre across the beam with the angle
of incidence, up to 0.05 mm and more at 30 degrees (ASME B89.4.19 tests for it). The ball keeps its
orientation in the tool and looks 25 degrees past the tracker, so the angle changes with the place.
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run
from tests.plant.scene import euler


@declare(
    UNKNOWN,
    "sensor",
    0.002,
    0.5,
    signal="tcp",
    all_runs=True,
    depends=tip_("smooth", "place"),
)
def reflector_incidence(draw: Draw):
    """`size` in mm at 30 degrees of incidence; the tracker stands 1 m from the work."""
    side = draw.uniform(-0.6, 0.6) + np.pi
    past = euler(25.0 * draw.sign(), 0.0, 0.0)
    stand = np.array([1000.0 * np.cos(side) + 80.0, 1000.0 * np.sin(side), draw.uniform(100.0, 500.0)])

    def at(size):
        def tip(run: Run):
            beam = stand - run.tip_mm
            beam = beam / np.linalg.norm(beam, axis=1, keepdims=True)
            middle = past @ stand / np.linalg.norm(stand)
            aim = np.einsum("nij,j->ni", run.tip_axes, middle)  # where the ball looks
            cosine = np.clip(np.sum(beam * aim, axis=1), -1.0, 1.0)
            across = aim - cosine[:, None] * beam
            angle = np.arccos(cosine)[:, None]
            unit = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
            run.tip_mm = run.tip_mm + size * (np.degrees(angle) / 30.0) ** 2 * unit

        return numbers(mm=size, stand_mm=stand), {"tip": tip}

    return None, at
