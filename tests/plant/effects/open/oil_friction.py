"""Cold oil in one gear: friction rises with speed, and most when it barely moves.

Stribeck's curve: boundary friction falls to a minimum and viscous friction rises beyond; in cold oil the
viscous part is several times the warm one (Bittencourt and Axelsson 2014, on robot joints). The drive
follows late by what its stiffness gives.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s
from tests.plant.scene import DEGREE


def stribeck(speed: np.ndarray, slow: float, peak: float, viscous: float) -> np.ndarray:
    """Friction over its Coulomb level at a speed, odd."""
    boundary = np.tanh(speed / (0.1 * slow)) * (1.0 + peak * np.exp(-((speed / slow) ** 2)))
    return boundary + viscous * speed


@declare(
    UNKNOWN,
    "servo",
    1e-6,
    0.1,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "velocity", "reversals", links=("servo",)),
)
def oil_friction(draw: Draw):
    """`size` is the lag in degrees at the Coulomb level."""
    name, j = draw.joint()
    slow, peak, viscous = draw.log_uniform(0.003, 0.02), draw.uniform(0.5, 1.5), draw.uniform(10.0, 60.0)

    def at(size):
        def servo(run: Run):
            rubs = stribeck(run.rates(run.q_cmd)[:, j], slow, peak, viscous)
            run.q_act[:, j] -= size * DEGREE * memory.lag(rubs, np.full(len(rubs), 0.015), STEP_s)

        return numbers(deg=size, slow_rad_s=slow, peak=peak, viscous_s_rad=viscous), {"servo": servo}

    return name, at
