"""The tracker loses its beam and starts anew from another distance: an offset till the next loss.

An absolute distance meter sets the interferometer anew to 10 to 50 micrometres; chips or a hand in the beam
do it some times a run (ASME B89.4.19, on re-acquisition).
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run

STAND_mm = np.array([-1800.0, 1500.0, 400.0])


@declare(
    UNKNOWN,
    "sensor",
    1e-3,
    1.0,
    signal="tcp",
    all_runs=True,
    depends=tip_("step", "time_step", "run_to_run", "noise"),
)
def beam_comes_back(draw: Draw):
    """`size` in mm along the beam, drawn anew at each loss."""
    seed, every_s = int(draw.rng.integers(1 << 30)), draw.uniform(3.0, 7.0)

    def at(size):
        def tip(run: Run):
            rng = np.random.default_rng([seed, run.number])
            losses = np.cumsum(rng.exponential(every_s, 12))
            offsets = np.concatenate([[0.0], rng.normal(size=12)])
            beam = run.tip_mm - STAND_mm
            beam = beam / np.linalg.norm(beam, axis=1, keepdims=True)
            along = offsets[np.searchsorted(losses, run.t_s)]
            run.tip_mm = run.tip_mm + size * along[:, None] * beam

        return numbers(mm=size, every_s=every_s), {"tip": tip}

    return None, at
