"""What an instrument does to its reading: it smooths, hangs behind, or counts in coarse steps."""

import numpy as np
from scipy.ndimage import uniform_filter1d

from tests.plant import memory
from tests.plant.effects.depends import force as force_
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import LIBRARY, SIZE, Draw, acting, declare, other_form
from tests.plant.robot import Run, STEP_s

SMOOTHED = tip_("smooth", "velocity", "acceleration")


@declare(LIBRARY, "sensor", 0.001, 0.3, signal="tcp", all_runs=True, depends=SMOOTHED)
def tracker_filter(draw: Draw):
    """The tracker smooths its places by a first-order filter of `size` seconds."""

    def tip(run: Run, size: float):
        tau = np.full(len(run.t_s), size)
        run.tip_mm = np.stack([memory.lag(run.tip_mm[:, k].copy(), tau, STEP_s) for k in range(3)], axis=1)

    return None, acting(tip, tau_s=SIZE)


@other_form("tracker_filter")
def tracker_average(draw: Draw):
    """A moving average over the last `size` times two."""

    def tip(run: Run, size: float):
        width = max(1, round(2.0 * size / STEP_s))
        late = uniform_filter1d(run.tip_mm, width, axis=0, mode="nearest", origin=(width - 1) // 2)
        run.tip_mm = late if width > 1 else run.tip_mm

    return None, acting(tip, tau_s=SIZE, window_s=lambda size: 2.0 * size)


FULL_N = 300.0
HELD = force_("loop", "force_memory", "force")


@declare(LIBRARY, "sensor", 1e-4, 0.3, signal="force", needs=("cut",), all_runs=True, depends=HELD)
def force_hysteresis(draw: Draw):
    """A loop over each axis of the sensor, `size` of the largest force of the run wide (Masing's rule).

    The reading lacks that share of what a play of half the largest force does not follow.
    """

    def sense(run: Run, size: float):
        for k in range(3):
            force = np.append(0.0, run.sensed_N[:, k])  # from rest without a load
            half = np.full(len(force), 0.5 * np.abs(force).max())
            run.sensed_N[:, k] -= size * (force - memory.play(force, half, 0.0))[1:]

    return None, acting(sense, loss_percent=lambda size: 100.0 * size)


@other_form("force_hysteresis")
def force_hysteresis_of_a_rubbing_mount(draw: Draw):
    """The mount rubs with a force of its own, whatever the load: a plain play of the reading."""

    def sense(run: Run, size: float):
        half = np.full(len(run.slow_s), 0.5 * size * FULL_N)
        for k in range(3):
            run.sensed_N[:, k] = memory.play(run.sensed_N[:, k].copy(), half, 0.0)

    return None, acting(
        sense, loss_percent=lambda size: 100.0 * size, half_N=lambda size: 0.5 * size * FULL_N
    )


@other_form("force_hysteresis")
def force_hysteresis_of_bouc_wen(draw: Draw):
    """A smooth loop over 300 N."""
    sharp = draw.uniform(2.0, 5.0)

    def sense(run: Run, size: float):
        for k in range(3):
            run.sensed_N[:, k] -= size * FULL_N * memory.bouc_wen(run.sensed_N[:, k].copy(), FULL_N, sharp)

    return None, acting(sense, loss_percent=lambda size: 100.0 * size, sharpness=sharp)


@declare(
    LIBRARY, "sensor", 0.5, 150.0, signal="force", all_runs=True, depends=force_("smooth", "force", "noise")
)
def force_steps(draw: Draw):
    """The reading comes in a ladder of `size` newtons: a range that is far too wide."""

    def sense(run: Run, size: float):
        run.sensed_N = size * np.round(run.sensed_N / size)

    return None, acting(sense, step_N=SIZE)
