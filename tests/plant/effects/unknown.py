"""Effects that are in no library: the right answer is that something is unexplained, and where."""

import numpy as np

from tests.plant.effects.depends import force, joint, tip
from tests.plant.effects.registry import UNKNOWN, Draw, declare, numbers
from tests.plant.robot import Run, fast
from tests.plant.scene import DEGREE


def _after(run: Run, share: float) -> np.ndarray:
    """1 from some fraction of the run on, (n, 1)."""
    return (run.t_s > share * run.t_s[-1]).astype(float)[:, None]


@declare(UNKNOWN, "part", 0.05, 2.0, signal="tcp", depends=tip("step", "time_step"))
def fixture_slip(draw: Draw):
    """The fixture, with the tracker's reference on it, slips in the middle of one run and stays there."""
    way, share = draw.direction() * np.array([1.0, 1.0, 0.1]), draw.uniform(0.2, 0.7)

    def at(size):
        def tip(run: Run):
            moved = _after(run, share) if run.number == 0 else 1.0
            run.tip_mm = run.tip_mm - size * way * moved

        return numbers(mm=size, direction=way, share=share), {"tip": tip}

    return None, at


@declare(UNKNOWN, "sensor", 0.04, 1.0, signal="tcp", depends=tip("smooth", "time_smooth", "place"))
def tracker_refraction(draw: Draw):
    """Warm air wanders through the beam: a slow error across it, growing with the distance."""
    stand = draw.rng.uniform([-3500.0, -3500.0, -200.0], [-2000.0, 3500.0, 800.0])
    hz, phase = draw.uniform(0.08, 0.4), draw.rng.uniform(0.0, 2.0 * np.pi, 2)

    def at(size):
        def tip(run: Run):
            beam = run.tip_mm - stand
            reach = np.linalg.norm(beam, axis=1, keepdims=True)
            across = np.cross(beam / reach, [0.0, 0.0, 1.0])
            wander = [np.sin(2.0 * np.pi * hz * (1.0 + 0.37 * i) * run.t_s + phase[i]) for i in (0, 1)]
            up = np.array([0.0, 0.0, 1.0])
            bent = wander[0][:, None] * across + wander[1][:, None] * up
            run.tip_mm = run.tip_mm + size * (reach / 3000.0) ** 2 * bent

        return numbers(mm=size, stand_mm=stand, hz=hz), {"tip": tip}

    return None, at


@declare(UNKNOWN, "geometry", 0.04, 0.4, signal="tcp", depends=tip("drift", "time_since_start"))
def spindle_growth(draw: Draw):
    """The spindle grows along its axis within seconds after it starts, as at high speed."""
    constant_s = draw.uniform(2.0, 8.0)

    def at(size):
        def tip(run: Run):
            run.tip_mm[:, 2] += size * np.expm1(-run.t_s / constant_s)

        return numbers(mm=size, time_constant_s=constant_s), {"tip": tip}

    return None, at


@declare(
    UNKNOWN, "force", 15.0, 300.0, depends=force("smooth", "place", "travel", links=("force", "mechanics"))
)
def cable_snag(draw: Draw):
    """A cable catches at one place: it pulls like a spring and lets go at once."""
    place, reach = draw.rng.uniform([-40.0, -60.0, 0.0], [140.0, 60.0, 30.0]), draw.uniform(40.0, 90.0)

    def at(size):
        def load(run: Run):
            where = run.place_mm[::4]
            beyond = where[:, 1] - place[1]
            caught = (beyond > 0.0) & (beyond < reach)
            pull = np.zeros_like(where)
            pull[caught, 1] = -size * beyond[caught] / reach
            pull[caught, 2] = 0.4 * size * beyond[caught] / reach
            run.force_N = run.force_N + pull

        return numbers(pull_N=size, from_y_mm=place[1], reach_mm=reach), {"load": load}

    return None, at


@declare(UNKNOWN, "geometry", 0.02, 0.4, signal="tcp", depends=tip("periodic", "tone"))
def bearing_wobble(draw: Draw):
    """A worn spindle bearing: the axis wobbles at a slow beat, wider under load."""
    hz, phase = draw.uniform(0.7, 3.0), draw.uniform(0.0, 6.28)

    def at(size):
        def tip(run: Run):
            pressed = np.linalg.norm(run.force_N, axis=1, keepdims=True) / 300.0
            wide = size * (0.6 + 0.4 * fast(run, np.minimum(pressed, 2.0)))
            turn = 2.0 * np.pi * hz * run.t_s + phase
            around = np.stack([np.cos(turn), np.sin(turn), 0.1 * np.sin(2.0 * turn)], axis=1)
            run.tip_mm = run.tip_mm + wide * around

        return numbers(mm=size, hz=hz), {"tip": tip}

    return None, at


@declare(
    UNKNOWN,
    "servo",
    0.001,
    0.01,
    signal="joint_actual",
    depends=joint("periodic", "motor_angle", links=("servo",)),
)
def encoder_interpolation(draw: Draw):
    """A motor encoder whose sine and cosine are uneven: the reading errs with each of its lines."""
    name, j = draw.joint()
    lines, phase = draw.pick([17, 23, 31]), draw.uniform(0.0, 6.28)

    def at(size):
        def sense(run: Run):
            angle = run.q_act[:, j] * lines * 19.0
            uneven = size * DEGREE * (np.sin(angle + phase) + 0.4 * np.sin(2.0 * angle))
            run.q_act[:, j] += uneven  # the reading only: the arm has moved already

        return numbers(deg=size, lines=lines), {"sense": sense}

    return name, at


@declare(UNKNOWN, "joint", 0.003, 0.08, signal="tcp", depends=joint("step", "time_step"))
def collision_step(draw: Draw):
    """The arm is hit: from then on a joint and its neighbour stand a little elsewhere."""
    name, j = draw.joint()
    share, other = draw.uniform(0.2, 0.7), draw.uniform(-0.8, 0.8)

    def at(size):
        def load(run: Run):
            hit = _after(run, share)[:, 0] if run.number == 0 else 1.0
            run.q_load[:, j] += size * DEGREE * hit
            run.q_load[:, (j + 1) % 6] += other * size * DEGREE * hit

        return numbers(deg=size, share=share), {"load": load}

    return name, at


@declare(UNKNOWN, "geometry", 0.04, 1.0, signal="tcp", depends=tip("periodic", "tone", "time_smooth"))
def floor_sways(draw: Draw):
    """A press next door: the floor tilts to and fro in bursts, whatever the robot does."""
    way, hz, every = draw.direction(), draw.uniform(1.5, 4.0), draw.uniform(3.0, 6.0)

    def at(size):
        def tip(run: Run):
            since = np.mod(run.t_s + 0.7, every)
            burst = np.exp(-since / 0.6) * np.sin(2.0 * np.pi * hz * since)
            run.tip_mm = run.tip_mm + size * burst[:, None] * way

        return numbers(mm=size, hz=hz, every_s=every), {"tip": tip}

    return None, at


@declare(UNKNOWN, "force", 0.15, 1.5, needs=("cut",), depends=force("smooth", "force_by_place", "place"))
def hard_spot(draw: Draw):
    """A weld or an inclusion in the block: the force is higher in one region of it."""
    place, radius = draw.rng.uniform([30.0, -45.0], [130.0, 45.0]), draw.uniform(40.0, 70.0)

    def at(size):
        def load(run: Run):
            away = np.linalg.norm(run.place_mm[::4, :2] - place, axis=1) / radius
            harder = (1.0 + size * np.exp(-(away**2)))[:, None]
            run.force_N, run.moment_Nmm = run.force_N * harder, run.moment_Nmm * harder

        return numbers(share=size, place_mm=place, radius_mm=radius), {"load": load}

    return None, at
