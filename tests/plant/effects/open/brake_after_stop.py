"""The holding brake falls in at each stop of a joint and lets go late: the joint starts against it.

A brake's coil takes 50 to 300 ms to lift; for so long after each start the drive lags behind its command.
"""

import numpy as np

from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s
from tests.plant.scene import DEGREE

STILL_rad_s = 2e-4


def since_rest(speed: np.ndarray, rest_s: float) -> np.ndarray:
    """Seconds since a joint last stood for at least so long; far in the past where it never did."""
    out, stood, since = np.full(len(speed), 1e9), 0.0, 1e9
    for i, moves in enumerate(np.abs(speed) > STILL_rad_s):
        stood = 0.0 if moves else stood + STEP_s
        since = 0.0 if stood >= rest_s else since + STEP_s
        out[i] = since
    return out


@declare(
    UNKNOWN,
    "servo",
    1e-6,
    0.5,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "velocity", "reversals", "time_since_start", links=("servo",)),
)
def brake_after_stop(draw: Draw):
    """`size` in degrees of lag at the start after a rest of 50 ms."""
    name, j = draw.joint()
    lifts_s = draw.log_uniform(0.05, 0.3)

    def at(size):
        def servo(run: Run):
            speed = run.rates(run.q_cmd)[:, j]
            drags = np.exp(-since_rest(speed, 0.05) / lifts_s) * np.tanh(speed / 2e-3)
            run.q_act[:, j] -= size * DEGREE * drags

        return numbers(deg=size, lifts_s=lifts_s), {"servo": servo}

    return name, at
