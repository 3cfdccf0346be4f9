"""The force sensor's beams are not quite linear: a large side force shows as a force along the axis.

Sheets state cross-talk of 1 to 3 % after a linear decoupling; what is left goes with the square of the
load.
"""

from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run


@declare(
    UNKNOWN,
    "sensor",
    1e-4,
    5.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("smooth", "force"),
)
def cross_talk(draw: Draw):
    """`size` is the share of a force of 200 N that shows in another axis; it grows with the square."""
    order = draw.rng.permutation(3)

    def at(size):
        def sense(run: Run):
            side = run.sensed_N[:, order[0]] - run.mismatch.force_zero_N[order[0]]
            run.sensed_N = run.sensed_N.copy()
            run.sensed_N[:, order[1]] += size * side**2 / 200.0

        return numbers(share=size, of="xyz"[order[0]], into="xyz"[order[1]]), {"sense": sense}

    return None, at
