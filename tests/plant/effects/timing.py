"""Clocks, the time law, corners, unexpected stops, the servo's lag."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.plant import memory
from tests.plant.effects.registry import LIBRARY, SIZE, Draw, acting, declare, numbers, other_form
from tests.plant.robot import Run, STEP_s

CLOCKS = ("tracker", "force", "controller", "q_load", "q_cmd")


def _late(draw: Draw) -> tuple[str, float]:
    """Target and sign: a commanded position is logged ahead of the drives, the rest either way."""
    target = draw.target(CLOCKS)
    return target, -1.0 if target == "q_cmd" else draw.sign()


@declare(LIBRARY, "timing", 0.004, 0.08)
def clock(draw: Draw):
    target, sign = _late(draw)
    skew = draw.pick([0.0, draw.sign() * draw.log_uniform(5e-5, 5e-4)])

    def world(run: Run, size: float):
        run.delay(target, sign * size, skew)

    return target, acting(world, offset_s=lambda size: sign * size, skew=skew)


@other_form("clock")
def clock_that_jumps(draw: Draw):
    """The offset comes in the middle of the log, as after a lost buffer."""
    target, sign = _late(draw)
    share = draw.uniform(0.3, 0.6)

    def sense(run: Run, size: float):
        run.jumps[target] = (share * run.t_s[-1], sign * size)

    return target, acting(sense, offset_s=lambda size: sign * size, from_share=share)


@declare(LIBRARY, "timing", 0.02, 0.6, signal="tcp")
def velocity_rule(draw: Draw):
    sign, other = draw.sign(), draw.uniform(-0.5, 1.0)

    def at(size):
        k_s, acceleration = 0.168 * (1.0 + sign * size), 2000.0 * (1.0 + other * size)

        def world(run: Run):
            run.believed = run.believed.but(k_s=k_s, acceleration_mm_s2=acceleration)

        return numbers(k_s=k_s, acc_cp_m_s2=acceleration / 1000.0), {"world": world}

    return None, at


@other_form("velocity_rule")
def velocity_in_three_averages(draw: Draw):
    """A smoother window, longer or shorter than the controller's."""
    sign = draw.sign()

    def world(run: Run, size: float):
        run.believed = run.believed.but(k_s=0.168 * (1.0 + sign * size), ramp="three_averages")

    return None, acting(world, k_s=lambda size: 0.168 * (1.0 + sign * size), window="two averages of k/2")


def _corners(size: float, shape: str):
    def world(run: Run):
        cdis = np.where(run.way.cdis_mm > 0.0, run.way.cdis_mm + size, 0.0)
        run.way = replace(run.way, cdis_mm=cdis)
        run.believed = run.believed.but(corner=shape)

    return {"world": world}


@declare(LIBRARY, "timing", 0.1, 5.0, signal="tcp")
def corner(draw: Draw):
    return None, lambda size: (numbers(cdis_mm=0.5 + size), _corners(size, "parabola"))


@other_form("corner")
def corner_of_fourth_degree(draw: Draw):
    """A corner whose curvature grows and fades instead of standing."""
    return None, lambda size: (numbers(cdis_mm=0.5 + size, curve="quartic"), _corners(size, "quartic"))


def blended_rows(run: Run, count: int, seed: int) -> np.ndarray:
    """Rows of the waypoints that are passed without a stop, some of them."""
    rows = np.flatnonzero(run.way.cdis_mm > 0.0)
    pick = np.random.default_rng(seed + len(rows)).permutation(len(rows))[:count]
    return rows[np.sort(pick)]


def spread_rows(run: Run, count: int) -> np.ndarray:
    """Rows of the waypoints that are passed without a stop: the middle one of each of so many equal parts."""
    rows = np.flatnonzero(run.way.cdis_mm > 0.0)
    return rows[((np.arange(count) + 0.5) * len(rows) / count).astype(int)]


def _stopping(count: int, rows_of) -> Callable:
    """Exact stops at the rows that `rows_of(run)` gives."""

    def at(size):
        def world(run: Run):
            rows = rows_of(run)
            cdis, hold = run.way.cdis_mm.copy(), run.way.hold_s.copy()
            cdis[rows], hold[rows] = 0.0, size
            run.way = replace(run.way, cdis_mm=cdis, hold_s=hold)

        return numbers(count=count, hold_s=size), {"world": world}

    return at


@declare(LIBRARY, "timing", 0.02, 0.5, signal="tcp")
def advance_stop(draw: Draw):
    """The advance run stops every so many corners, as a command between them makes it do."""
    count = int(draw.rng.integers(1, 4))
    return None, _stopping(count, lambda run: spread_rows(run, count))


@other_form("advance_stop")
def advance_stop_anywhere(draw: Draw):
    """At corners that nothing foretells: the interpreter was busy."""
    count, seed = int(draw.rng.integers(1, 4)), int(draw.rng.integers(1 << 30))
    return None, _stopping(count, lambda run: blended_rows(run, count, seed))


@other_form("advance_stop")
def advance_crawl(draw: Draw):
    """The advance run is late and the move before some corners is driven slower, without a stop."""
    count, seed = int(draw.rng.integers(1, 4)), int(draw.rng.integers(1 << 30))

    def world(run: Run, size: float):
        rows = blended_rows(run, count, seed)
        speed = run.way.speed_mm_s.copy()
        speed[rows] *= 1.0 / (1.0 + size)
        run.way = replace(run.way, speed_mm_s=speed)

    return None, acting(world, count=count, slower=lambda size: 1.0 / (1.0 + size))


@declare(LIBRARY, "servo", 0.001, 0.03)
def servo_lag(draw: Draw):
    name, axes = draw.axes()

    def lags(run: Run, size: float):
        run.lag_s[:, axes] += size

    return name, acting(lags, tau_s=SIZE)


@other_form("servo_lag")
def servo_lag_with_pose(draw: Draw):
    """The lag grows with the inertia in front of the joint: the arm's reach, or the bend of the wrist."""
    name, j = draw.joint()
    slope = draw.sign() * draw.uniform(0.8, 1.6)

    def lags(run: Run, size: float):
        stretch = run.q_cmd[:, 2] - np.pi / 2.0 - 0.6 if j < 3 else run.q_cmd[:, 4] + 0.8
        run.lag_s[:, j] += size * np.maximum(1.0 + slope * stretch, 0.1)

    return name, acting(lags, tau_s=SIZE, with_pose=slope)


@other_form("servo_lag")
def servo_lag_of_second_order(draw: Draw):
    """Two lags in a row, of half the time each."""
    name, j = draw.joint()

    def at(size):
        half = np.full(1, size / 2.0)

        def lags(run: Run):
            run.lag_s[:, j] += size / 2.0

        def servo(run: Run):
            tau = np.repeat(half, len(run.t_s))
            run.q_act[:, j] = memory.lag(run.q_act[:, j].copy(), tau, STEP_s)

        return numbers(tau_s=size, order=2), {"lags": lags, "servo": servo}

    return name, at
