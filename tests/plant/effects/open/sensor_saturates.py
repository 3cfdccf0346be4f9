"""An amplifier of the force sensor runs into its supply: large forces read too small.

A gain set one step too high clips softly from a fraction of the range on; the bias of the tool's weight
brings one axis nearer to it.
"""

import numpy as np

from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run


@declare(
    UNKNOWN,
    "sensor",
    1e-4,
    10.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("smooth", "force"),
)
def sensor_saturates(draw: Draw):
    """`size` is the square of 300 N over the level at which the reading stops: 1 stops at 300 N."""
    bias_N = draw.uniform(-80.0, 80.0)

    def at(size):
        def sense(run: Run):
            stop_N = 300.0 / np.sqrt(size)
            zero = stop_N * np.tanh(bias_N / stop_N)
            run.sensed_N = stop_N * np.tanh((run.sensed_N + bias_N) / stop_N) - zero

        return numbers(stop_N=300.0 / float(np.sqrt(size)), bias_N=bias_N), {"sense": sense}

    return None, at
