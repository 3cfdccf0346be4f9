"""Mode-coupling chatter of a robot: the arm's slow mode grows while the tool is deep in the material.

Two modes of nearly equal stiffness feed each other above a depth of cut; with robots this comes at their
structural 8 to 20 Hz, not at the spindle's (Pan, Zhang, Zhu, Wang 2006, "Chatter analysis of robotic
machining process").
"""

import numpy as np

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import SLOW, Run, STEP_s, fast

GROWS_s, FADES_s = 0.25, 0.1


def swollen(deep: np.ndarray, dt_s: float) -> np.ndarray:
    """Amplitude 0 ... 1 that grows exponentially where it is deep, up to 1, and fades elsewhere."""
    out, now = np.empty(len(deep)), 0.02
    for i in range(len(deep)):
        now += dt_s * (now * (1.0 - now) / GROWS_s if deep[i] else -(now - 0.02) / FADES_s)
        out[i] = now
    return out - 0.02


@declare(
    UNKNOWN,
    "geometry",
    0.001,
    3.0,
    signal="tcp",
    needs=("cut",),
    all_runs=True,
    depends=tip_("periodic", "force", "tone", "force_by_place"),
)
def chatter(draw: Draw):
    hz, way, limit_mm = draw.uniform(8.0, 20.0), draw.direction(), draw.uniform(1.5, 3.5)

    def at(size):
        def tip(run: Run):
            grown = fast(run, swollen(run.cut.depth_mm > limit_mm, SLOW * STEP_s)[:, None])
            wave = np.sin(2.0 * np.pi * hz * run.t_s)[:, None]
            run.tip_mm = run.tip_mm + size * grown * wave * way

        return numbers(mm=size, hz=hz, limit_mm=limit_mm), {"tip": tip}

    return None, at
