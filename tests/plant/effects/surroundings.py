"""Spindle, tracker and cables: what warms, wanders and pulls beside the arm."""

import numpy as np

from tests.plant import arm as arms
from tests.plant import memory
from tests.plant.effects.depends import force as force_
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import LIBRARY, SIZE, Draw, acting, declare, numbers, other_form
from tests.plant.robot import SLOW, Run
from tests.plant.scene import DEGREE

RATED_rad_s = 13000.0 * np.pi / 30.0


def grown(run: Run, constant_s: float) -> np.ndarray:
    """Warming of a spindle that was cold at the start, 1 in the end at rated speed; loss with speed².

    dx/dt = ((speed/rated)² - x) / T, exact over stretches of one speed.
    """
    drive = (run.spindle_rad_s / RATED_rad_s) ** 2
    out, now, begin = np.empty(len(drive)), 0.0, 0
    for end in [*(np.flatnonzero(np.diff(drive)) + 1), len(drive)]:
        since = run.elapsed_s[begin:end] - run.elapsed_s[begin]
        out[begin:end] = drive[begin] + (now - drive[begin]) * np.exp(-since / constant_s)
        if end < len(drive):
            whole = run.elapsed_s[end] - run.elapsed_s[begin]
            now = drive[begin] + (now - drive[begin]) * np.exp(-whole / constant_s)
        begin = end
    return out


def _out(run: Run) -> np.ndarray:
    """Unit vectors out of the spindle along the tool, in `$BASE`."""
    return -run.tip_axes[:, :, 2]


GROWTH = tip_("drift", "time_since_start", "spindle_speed")


@declare(LIBRARY, "geometry", 0.004, 0.6, signal="tcp", all_runs=True, depends=GROWTH)
def spindle_growth(draw: Draw):
    """`size` in mm along the tool in the end at 13000 rpm; from 0 at each start of the spindle."""
    constant_s = draw.log_uniform(2.0, 12.0)

    def tip(run: Run, size: float):
        run.tip_mm = run.tip_mm + size * grown(run, constant_s)[:, None] * _out(run)

    return None, acting(tip, mm=SIZE, time_constant_s=constant_s)


@other_form("spindle_growth")
def spindle_growth_of_two(draw: Draw):
    """Shaft and housing warm with a time each."""
    quick_s, late_s, share = draw.log_uniform(1.0, 4.0), draw.log_uniform(10.0, 40.0), draw.uniform(0.3, 0.7)

    def at(size):
        def tip(run: Run):
            both = share * grown(run, quick_s) + (1.0 - share) * grown(run, late_s)
            run.tip_mm = run.tip_mm + size * both[:, None] * _out(run)

        values = numbers(mm=size, time_constant_s=quick_s, second_s=late_s, first_share=share)
        return values, {"tip": tip}

    return None, at


def _hours(run: Run) -> np.ndarray:
    return ((run.age_s + run.elapsed_s) / 3600.0)[:, None]


DRIFT = tip_("drift", "wall_clock", "time_smooth")


@declare(LIBRARY, "sensor", 0.005, 1.5, signal="tcp", hours=True, all_runs=True, depends=DRIFT)
def tracker_drift(draw: Draw):
    """The tracker's stand creeps by `size` in mm an hour from the first run's start."""
    way = draw.direction()

    def tip(run: Run, size: float):
        run.tip_mm = run.tip_mm + size * _hours(run) * way

    return None, acting(tip, mm_per_h=SIZE, direction=way)


@other_form("tracker_drift")
def tracker_drift_with_the_heating(draw: Draw):
    """The creep swings with the hall's heating and turns the tracker a little about its stand."""
    way, turn, period_h = draw.direction(), draw.direction() * 1e-4, draw.uniform(0.5, 1.5)
    stand = draw.rng.uniform([-3500.0, -3500.0, -200.0], [-2000.0, 3500.0, 800.0])

    def tip(run: Run, size: float):
        hours = _hours(run)
        gone = hours + 0.3 * period_h * np.sin(2.0 * np.pi * hours / period_h)
        turned = np.cross(turn, run.tip_mm - stand)
        run.tip_mm = run.tip_mm + size * gone * (way + turned)

    return None, acting(tip, mm_per_h=SIZE, direction=way, period_h=period_h)


AIR = tip_("smooth", "place", "constant")
STAND_mm = np.array([[-2200.0, -1800.0, -200.0], [-1200.0, 1800.0, 900.0]])


def _beam(run: Run, stand: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions of the beam, and how far it reaches over the floor in units of 2 m, (n, 1).

    A ray that climbs crosses the layers of air aslant: its sag is that of its level part.
    """
    beam = run.tip_mm - stand
    level = np.linalg.norm(beam[:, :2], axis=1, keepdims=True)
    return beam / np.linalg.norm(beam, axis=1, keepdims=True), level / 2000.0


@declare(LIBRARY, "sensor", 0.004, 2.0, signal="tcp", all_runs=True, depends=AIR)
def tracker_refraction(draw: Draw):
    """Warm air above cold bends the beam upwards by `size` mm at 2 m, with the square of its level length.

    Rays bend towards the denser air: sag = grad(n)·L²/2, grad(n) = -0.93e-6 per kelvin times the gradient.
    """
    stand = draw.rng.uniform(*STAND_mm)

    def tip(run: Run, size: float):
        _, reach = _beam(run, stand)
        run.tip_mm = run.tip_mm + size * reach**2 * np.array([0.0, 0.0, 1.0])

    return None, acting(tip, mm_at_2m=SIZE, stand_mm=stand)


@other_form("tracker_refraction", tip_("smooth", "time_smooth", "place"))
def tracker_refraction_that_wanders(draw: Draw):
    """The air moves: slow errors across the beam in both directions."""
    stand, hz = draw.rng.uniform(*STAND_mm), draw.uniform(0.08, 0.4)
    phase = draw.rng.uniform(0.0, 2.0 * np.pi, 2)

    def tip(run: Run, size: float):
        beam, reach = _beam(run, stand)
        up = np.array([0.0, 0.0, 1.0])
        swing = [np.sin(2.0 * np.pi * hz * (1.0 + 0.37 * i) * run.t_s + phase[i]) for i in (0, 1)]
        bent = swing[0][:, None] * np.cross(beam, up) + (0.5 + swing[1])[:, None] * up
        run.tip_mm = run.tip_mm + size * reach**2 * bent

    return None, acting(tip, mm_at_2m=SIZE, stand_mm=stand, hz=hz)


READ = force_("smooth", "travel", "own_angle", "place")
PULL = force_("smooth", "travel", "own_angle", "place", links=("force", "mechanics"))


def _travel_deg(run: Run, j: int) -> np.ndarray:
    """Travel of a joint since the start at the slow samples."""
    return (run.q_load[::SLOW, j] - run.q_load[0, j]) / DEGREE


def _pulling(j: int, way: np.ndarray, law) -> dict:
    """A force on the tool by the travel of a joint, `law(travel in deg)` in N; it bends the arm."""

    def load(run: Run):
        run.force_N = run.force_N + law(_travel_deg(run, j))[:, None] * way

    return {"load": load}


@declare(LIBRARY, "force", 0.02, 60.0, signal="force", all_runs=True, depends=PULL)
def cable_pull(draw: Draw):
    """A cable pulls at the end effector with the travel of a joint, `size` in N per degree along its axes."""
    name, j = draw.joint()
    way = draw.direction()

    def load(run: Run, size: float):
        _, axes = arms.pose(run.body(), np.ascontiguousarray(run.q_load[::SLOW]))
        along = axes @ run.believed.tool.axes.T @ way
        run.force_N = run.force_N + size * _travel_deg(run, j)[:, None] * along

    return name, acting(load, N_per_deg=SIZE, direction=way)


@other_form("cable_pull", READ)
def cable_pull_of_the_sensor(draw: Draw):
    """The sensor's own cable pulls at the sensor alone: no arm bends."""
    name, j = draw.joint()
    way = draw.direction()

    def sense(run: Run, size: float):
        run.sensed_N = run.sensed_N + size * _travel_deg(run, j)[:, None] * way

    return name, acting(sense, N_per_deg=SIZE, direction=way)


@other_form("cable_pull", PULL)
def cable_pull_at_the_tool(draw: Draw):
    """A drum pulls at the tool along a line that stays in the hall, and bends the arm too."""
    name, j = draw.joint()
    way = draw.direction()

    def at(size):
        return numbers(N_per_deg=size, direction=way), _pulling(j, way, lambda travel: size * travel)

    return name, at


@other_form("cable_pull", force_("loop", "travel", "own_angle", "reversals", links=("force", "mechanics")))
def cable_pull_that_rubs(draw: Draw):
    """The cable drags in its guide: a loop over the travel."""
    name, j = draw.joint()
    way, share = draw.direction(), draw.uniform(0.15, 0.35)

    def at(size):
        def law(travel):
            half = np.full(len(travel), share * (travel.max() - travel.min()) / 2.0)
            return size * memory.play(travel.copy(), half, 0.0)

        return numbers(N_per_deg=size, direction=way, drag_share=share), _pulling(j, way, law)

    return name, at


@other_form("cable_pull", PULL)
def cable_pull_that_tightens(draw: Draw):
    """A bow that straightens: the further, the harder."""
    name, j = draw.joint()
    way, soft_deg = draw.direction(), draw.uniform(3.0, 10.0)

    def at(size):
        def law(travel):
            return size * travel * (0.5 + np.abs(travel) / soft_deg)

        return numbers(N_per_deg=size, direction=way, soft_deg=soft_deg), _pulling(j, way, law)

    return name, at
