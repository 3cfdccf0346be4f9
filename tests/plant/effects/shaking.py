"""A tone of the floor, a bearing that wobbles, a spindle that slows down under load."""

import numpy as np

from tests.plant import arm as arms
from tests.plant import masses, memory
from tests.plant.effects.depends import force as force_
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import LIBRARY, SIZE, Draw, acting, declare, numbers, other_form
from tests.plant.robot import SLOW, Run, STEP_s, cut_at, fast, to_root

TONE = tip_("periodic", "tone", "time_smooth")


def _shaking(draw: Draw, wave_of):
    """The floor shakes along an axis of `$BASE`; `wave_of(draw)` gives more parameters and wave(2·pi·t).

    What shakes it goes on between the runs: t counts from the start of the earliest.
    """
    name, hz = draw.target(("x", "y", "z")), draw.uniform(3.0, 25.0)
    more, wave = wave_of(draw)

    def at(size):
        def tip(run: Run):
            run.tip_mm = run.tip_mm.copy()
            turn = 2.0 * np.pi * (run.age_s + run.elapsed_s)
            run.tip_mm[:, "xyz".index(name)] += size * wave(turn, hz)

        return numbers(mm=size, hz=hz, **more), {"tip": tip}

    return name, at


@declare(LIBRARY, "set-up", 1e-4, 3.0, signal="tcp", all_runs=True, depends=TONE)
def floor_vibration(draw: Draw):
    """The floor shakes the tracker or the robot with one tone of 3 to 25 Hz, `size` mm high."""

    def wave_of(draw: Draw):
        phase = draw.uniform(0.0, 2.0 * np.pi)
        return {"phase": phase}, lambda turn, hz: np.sin(hz * turn + phase)

    return _shaking(draw, wave_of)


@other_form("floor_vibration")
def floor_vibration_that_beats(draw: Draw):
    """Two machines of nearly the same speed: the tone swells and fades."""

    def wave_of(draw: Draw):
        beat_hz = draw.uniform(0.1, 0.4)
        return {"beat_hz": beat_hz}, lambda turn, hz: np.cos(0.5 * beat_hz * turn) * np.sin(hz * turn)

    return _shaking(draw, wave_of)


WOBBLES = tip_("periodic", "own_angle", "place")


def _wobbling(draw: Draw, second: float):
    """All that an axis carries tilts about a line across it, which goes round with the axis's angle."""
    name, j = draw.joint()
    per_turn = draw.uniform(0.38, 0.48) if draw.sign() > 0.0 else draw.uniform(4.0, 12.0)
    phase = draw.uniform(0.0, 2.0 * np.pi)

    def tip(run: Run, size: float):
        seats, axes = masses.hinges(run)
        axis, turn = axes[:, j], per_turn * run.q_act[::SLOW, j, None] + phase
        before = seats[:, 2] - seats[:, 1] if j == arms.ELBOW else axes[:, j - 1] if j else arms.X
        across = before - np.sum(before * axis, axis=1, keepdims=True) * axis
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        beside = np.cross(axis, across)
        tilt = np.cos(turn) * across + np.sin(turn) * beside
        tilt += second * (np.cos(2.0 * turn) * across + np.sin(2.0 * turn) * beside)
        lever = to_root(run.world, run.tip_mm)[::SLOW] - seats[:, j]
        way = size / 1000.0 * np.cross(tilt, lever) @ run.world.base.axes
        run.tip_mm = run.tip_mm + fast(run, way)

    return name, acting(tip, amplitude_mrad=SIZE, per_turn=per_turn, phase=phase)


@declare(LIBRARY, "geometry", 1e-3, 3.0, signal="tcp", all_runs=True, depends=WOBBLES)
def bearing_wobble(draw: Draw):
    """A worn bearing of a joint: its axis tilts by `size` mrad, round with the cage or with each roller.

    The cage of a rolling bearing turns at some 0.4 of the shaft; rollers pass several times a turn (Harris,
    Rolling Bearing Analysis, chapter on defect frequencies).
    """
    return _wobbling(draw, 0.0)


@other_form("bearing_wobble")
def bearing_wobble_of_two(draw: Draw):
    """Two worn spots: it tilts twice as often too."""
    return _wobbling(draw, 0.5)


DROOP = force_("smooth", "force", "force_memory", "spindle_speed", links=("force", "mechanics"))


def _drooping(draw: Draw, lag_of):
    """Thicker chips at a slower spindle; `lag_of(draw)` gives more parameters and late(torque).

    The feed stays, so that the chip of each tooth, and its share of the force, grows as the speed falls. What
    the edges take does not.
    """
    more, late = lag_of(draw)

    def at(size):
        def load(run: Run):
            if not run.links:
                return
            world, k = run.world, run.world.cutter.coefficients
            run.world = world.cutting(coefficients=np.append(k[:3], np.zeros(3)))
            chip = cut_at(run, run.slow_s, run.place_mm[::SLOW])
            run.world = world
            slower = late(run.cut.moment_Nmm[:, 2] / 1000.0) * size / 100.0
            thicker = (1.0 / np.maximum(1.0 - slower, 0.05) - 1.0)[:, None]
            run.force_N = run.force_N + thicker * chip.force_N @ world.base.axes.T
            run.moment_Nmm = run.moment_Nmm + thicker * chip.moment_Nmm @ world.base.axes.T

        return numbers(percent_per_Nm=size, **more), {"load": load}

    return None, at


@declare(LIBRARY, "force", 0.01, 30.0, signal="force", needs=("cut",), all_runs=True, depends=DROOP)
def spindle_droop(draw: Draw):
    """The spindle slows by `size` percent for each N·m of the cut, at once."""
    return _drooping(draw, lambda draw: ({}, lambda torque: torque))


@other_form("spindle_droop")
def spindle_droop_with_a_flywheel(draw: Draw):
    """Its rotor keeps it going for 20 to 200 ms."""

    def lag_of(draw: Draw):
        tau_s = draw.log_uniform(0.02, 0.2)

        def late(torque):
            return memory.lag(torque.copy(), np.full(len(torque), tau_s), SLOW * STEP_s)

        return {"tau_s": tau_s}, late

    return _drooping(draw, lag_of)
