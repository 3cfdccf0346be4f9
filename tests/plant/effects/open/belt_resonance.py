"""The toothed belt between motor and gear is a spring: the load rings when the motor accelerates.

A belt of 1e5 to 1e6 N/m with the motor's wheel and the gear's inertia has its first mode at some 8 to 20 Hz
(Hace, Jezernik, Sabanovic 2005, on belt-driven servos).
"""

from tests.plant import memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, STEP_s


@declare(
    UNKNOWN,
    "joint",
    1e-3,
    3.0,
    signal="tcp",
    all_runs=True,
    depends=joint_("periodic", "acceleration", "tone"),
)
def belt_resonance(draw: Draw):
    """`size` scales how far the load rings; 1 is the free mode."""
    name, j = draw.joint()
    hz, damping = draw.uniform(8.0, 20.0), draw.log_uniform(0.02, 0.06)

    def at(size):
        def gear(run: Run):
            rings = memory.second_order(run.q_act[:, j].copy(), hz, damping, STEP_s)
            run.q_load[:, j] += size * (rings - run.q_act[:, j])

        return numbers(share=size, hz=hz, damping=damping), {"gear": gear}

    return name, at
