"""The spindle's bearings lose their preload spring's friction at one speed or warmth: the nose jumps axially.

Outer rings on springs stick in their seats and let go at once as the rings warm; the jump of 5 to 30
micrometres comes at the same time after each start of the spindle, and goes when it cools.
"""

from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.effects.surroundings import grown
from tests.plant.robot import Run


@declare(
    UNKNOWN,
    "geometry",
    1e-3,
    0.5,
    signal="tcp",
    all_runs=True,
    depends=tip_("step", "time_since_start", "time_step", "spindle_speed", "temperature"),
    moments=True,
)
def preload_jump(draw: Draw):
    """`size` in mm along the tool, once the shaft has a part of its warmth."""
    warms_s, lets_go = draw.uniform(5.0, 12.0), draw.uniform(0.3, 0.6)

    def at(size):
        def tip(run: Run):
            free = grown(run, warms_s) >= lets_go
            run.tip_mm = run.tip_mm - size * free[:, None] * run.tip_axes[:, :, 2]

        return numbers(mm=size, warms_s=warms_s, lets_go=lets_go), {"tip": tip}

    return None, at
