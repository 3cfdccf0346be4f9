"""The film between a gear's teeth is squeezed out at rest and builds up in motion: the joint creeps.

Film thickness follows the rolling speed with a fraction of a second on the way up (Hamrock and Dowson) and
seconds on the way down, as oil has to be squeezed out; a helical or skewed gear turns by the film over its
angle.
"""

import numpy as np

from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s
from tests.plant.scene import DEGREE


def film(speed: np.ndarray, full: float, up_s: float, down_s: float) -> np.ndarray:
    """Thickness in 0 ... 1 that follows (|speed|/full)^0.7 quickly up and slowly down."""
    wanted = np.minimum(np.abs(speed) / full, 1.0) ** 0.7
    out, now = np.empty(len(speed)), 0.0
    rise, fall = 1.0 - np.exp(-STEP_s / up_s), 1.0 - np.exp(-STEP_s / down_s)
    for i, goal in enumerate(wanted):
        now += (goal - now) * (rise if goal > now else fall)
        out[i] = now
    return out


@declare(
    UNKNOWN,
    "joint",
    1e-5,
    0.3,
    signal="any",
    all_runs=True,
    depends=joint_("smooth", "velocity", "travel", "time_since_start"),
)
def oil_film(draw: Draw):
    """`size` in degrees at a full film; the encoder behind the gear and the arm both turn."""
    name, j = draw.joint()
    full, down_s, sign = draw.log_uniform(0.02, 0.1), draw.uniform(0.5, 3.0), draw.sign()

    def at(size):
        def gear(run: Run):
            thick = film(run.rates(run.q_act)[:, j], full, 0.1, down_s)
            run.q_load[:, j] += sign * size * DEGREE * thick

        return numbers(deg=size, full_rad_s=full, down_s=down_s), {"gear": gear}

    return name, at
