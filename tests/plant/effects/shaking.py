"""Floor and spindle: a tone of the floor, a bearing that wobbles, a spindle that slows down under load."""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import force as force_
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import LIBRARY, Draw, declare, numbers, other_form
from tests.plant.robot import SLOW, Run, STEP_s, fast

TONE = tip_("periodic", "tone", "time_smooth")


@declare(LIBRARY, "set-up", 1e-4, 3.0, signal="tcp", all_runs=True, depends=TONE)
def floor_vibration(draw: Draw):
    """The floor shakes the tracker or the robot with one tone of 3 to 25 Hz, `size` mm along one line."""
    hz, phase, way = draw.uniform(3.0, 25.0), draw.uniform(0.0, 2.0 * np.pi), draw.direction()

    def at(size):
        def tip(run: Run):
            wave = np.sin(2.0 * np.pi * hz * run.elapsed_s + phase)
            run.tip_mm = run.tip_mm + size * wave[:, None] * way

        return numbers(mm=size, hz=hz, direction=way), {"tip": tip}

    return None, at


@other_form("floor_vibration")
def floor_vibration_that_beats(draw: Draw):
    """Two machines of nearly the same speed: the tone swells and fades."""
    hz, beat_hz, way = draw.uniform(3.0, 25.0), draw.uniform(0.1, 0.4), draw.direction()

    def at(size):
        def tip(run: Run):
            swell = np.cos(np.pi * beat_hz * run.elapsed_s)
            wave = swell * np.sin(2.0 * np.pi * hz * run.elapsed_s)
            run.tip_mm = run.tip_mm + size * wave[:, None] * way

        return numbers(mm=size, hz=hz, beat_hz=beat_hz, direction=way), {"tip": tip}

    return None, at


@declare(LIBRARY, "geometry", 0.001, 1.0, signal="tcp", all_runs=True, depends=TONE)
def bearing_wobble(draw: Draw):
    """A worn spindle bearing: the axis wobbles at a slow beat, wider under load.

    The cage of a rolling bearing turns at some 0.4 of the shaft; with the sampling or with a second bearing
    it beats at a few hertz (Harris, Rolling Bearing Analysis, chapter on defect frequencies).
    """
    hz, phase = draw.uniform(0.7, 3.0), draw.uniform(0.0, 2.0 * np.pi)

    def at(size):
        def tip(run: Run):
            pressed = np.linalg.norm(run.force_N, axis=1, keepdims=True) / 300.0
            wide = size * (0.6 + 0.4 * fast(run, np.minimum(pressed, 2.0)))
            turn = 2.0 * np.pi * hz * run.elapsed_s + phase
            around = np.stack([np.cos(turn), np.sin(turn), 0.1 * np.sin(2.0 * turn)], axis=1)
            run.tip_mm = run.tip_mm + wide * around

        return numbers(mm=size, hz=hz), {"tip": tip}

    return None, at


DROOP = force_("smooth", "force", "force_memory", "spindle_speed", links=("force", "mechanics"))


@declare(LIBRARY, "force", 1e-4, 1.0, signal="force", needs=("cut",), all_runs=True, depends=DROOP)
def spindle_droop(draw: Draw):
    """The spindle slows by `size` of its speed under 300 N, in 20 to 200 ms; chips get thicker by as much.

    The feed stays, so that the chip of each tooth and the force grow as the speed falls.
    """
    tau_s = draw.log_uniform(0.02, 0.2)

    def at(size):
        def load(run: Run):
            press = np.linalg.norm(run.force_N, axis=1) / 300.0
            slow = memory.lag(press, np.full(len(press), tau_s), SLOW * STEP_s)
            more = 1.0 / np.maximum(1.0 - size * slow, 0.3)
            run.force_N = run.force_N * more[:, None]
            run.moment_Nmm = run.moment_Nmm * more[:, None]

        return numbers(share=size, tau_s=tau_s), {"load": load}

    return None, at
