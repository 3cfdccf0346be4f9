"""The cut, the force sensor and the finished part."""

import numpy as np

from tests.plant import memory
from tests.plant.effects.registry import LIBRARY, SIZE, Draw, acting, declare, numbers, other_form
from tests.plant.robot import SLOW, Run, STEP_s

PARTS = ("tangential", "radial", "axial")


def _times(factors) -> dict:
    """True coefficients times six factors."""

    def world(run: Run):
        run.world = run.world.cutting(coefficients=run.world.cutter.coefficients * factors)

    return {"world": world}


def _stretched(draw: Draw, size: float, sign: float) -> float:
    return 1.0 + size if sign > 0.0 else 1.0 / (1.0 + size)


@declare(LIBRARY, "force", 0.06, 1.0, needs=("cut",))
def force_scale(draw: Draw):
    name = draw.target(PARTS)
    row, sign = PARTS.index(name), draw.sign()

    def at(size):
        scale = _stretched(draw, size, sign)
        factors = np.ones(6)
        factors[[row, row + 3]] = scale
        return numbers(scale=scale), _times(factors)

    return name, at


@declare(LIBRARY, "force", 0.03, 2.0, needs=("cut",))
def tool_wear(draw: Draw):
    def load(run: Run, size: float):
        grown = (1.0 + size * run.metres_cut)[:, None]
        run.force_N, run.moment_Nmm = run.force_N * grown, run.moment_Nmm * grown

    return None, acting(load, growth_per_m=SIZE)


@other_form("tool_wear")
def tool_wear_that_settles(draw: Draw):
    """Fast at first, then hardly any more: the fresh edge runs in."""
    length_m = draw.uniform(0.1, 0.4)

    def load(run: Run, size: float):
        grown = (1.0 + size * length_m * -np.expm1(-run.metres_cut / length_m))[:, None]
        run.force_N, run.moment_Nmm = run.force_N * grown, run.moment_Nmm * grown

    return None, acting(load, growth_per_m=SIZE, settles_m=length_m)


@declare(LIBRARY, "force", 0.01, 0.06, needs=("cut",))
def runout(draw: Draw):
    phase = draw.uniform(0.0, 2.0 * np.pi)

    def world(run: Run, size: float):
        teeth = run.world.cutter.teeth
        offsets = size * np.cos(2.0 * np.pi * np.arange(teeth) / teeth + phase)
        run.world = run.world.cutting(runout_mm=offsets)

    return None, acting(world, runout_mm=SIZE, angle_deg=float(np.degrees(phase)))


@other_form("runout")
def runout_of_one_tooth(draw: Draw):
    """One tooth set back, the others true: a chipped edge."""

    def world(run: Run, size: float):
        run.world = run.world.cutting(runout_mm=np.array([0.0, 0.0, -1.5 * size]))

    return None, acting(world, runout_mm=SIZE, teeth="one set back")


@declare(LIBRARY, "force", 0.2, 6.0, needs=("cut",))
def stock_offset(draw: Draw):
    name = draw.target(("x", "y"))
    sign = draw.sign()

    def world(run: Run, size: float):
        stock = run.world.stock_mm.copy()
        stock[:, "xy".index(name)] += sign * size
        run.world = run.world.but(stock_mm=stock)

    return name, acting(world, offset_mm=lambda size: sign * size)


@other_form("stock_offset")
def stock_turned(draw: Draw):
    """The block is off and clamped a little askew."""
    target, at = stock_offset(draw)
    turn = draw.sign()

    def askew(size):
        values, hooks = at(size)

        def world(run: Run):
            hooks["world"](run)
            run.world = run.world.but(stock_turn_deg=0.25 * turn * size)

        return {**values, "turn_deg": 0.25 * turn * size}, {"world": world}

    return target, askew


@declare(LIBRARY, "force", 0.06, 1.5, needs=("cut",))
def edge_force(draw: Draw):
    sign = draw.sign()

    def at(size):
        scale = _stretched(draw, size, sign)
        return numbers(scale=scale), _times(np.array([1.0, 1.0, 1.0, scale, scale, scale]))

    return None, at


@other_form("edge_force")
def edge_force_in_part(draw: Draw):
    """A blunt edge rubs more radially than tangentially."""

    def at(size):
        scale = 1.0 + size
        factors = np.array([1.0, 1.0, 1.0, 1.0 + 0.6 * size, scale, 1.0 + 0.6 * size])
        return numbers(scale=scale, tangential=0.6), _times(factors)

    return None, at


@declare(LIBRARY, "sensor", 5.0, 80.0, signal="force")
def force_offset(draw: Draw):
    way = draw.direction()

    def at(size):
        def sense(run: Run):
            run.sensed_N = run.sensed_N + size * way

        return dict(zip(("fx_N", "fy_N", "fz_N"), (size * way).tolist(), strict=True)), {"sense": sense}

    return None, at


@declare(LIBRARY, "sensor", 1.0, 20.0, signal="force", hours=True)
def force_drift(draw: Draw):
    way = draw.direction()

    def sense(run: Run, size: float):
        hours = (run.age_s + run.elapsed_s[::SLOW]) / 3600.0
        run.sensed_N = run.sensed_N + size * hours[:, None] * way

    return None, acting(sense, N_per_h=SIZE, direction=way)


@other_form("force_drift")
def force_drift_that_settles(draw: Draw):
    """A drift that dies away as the sensor's electronics warm up."""
    way, constant_h = draw.direction(), draw.uniform(0.6, 3.0)

    def sense(run: Run, size: float):
        hours = (run.age_s + run.elapsed_s[::SLOW]) / 3600.0
        run.sensed_N = run.sensed_N - size * constant_h * np.expm1(-hours / constant_h)[:, None] * way

    return None, acting(sense, N_per_h=SIZE, direction=way, time_constant_h=constant_h)


@declare(LIBRARY, "sensor", 5.0, 200.0, signal="force")
def tool_weight(draw: Draw):
    def sense(run: Run, size: float):
        down = np.einsum("nji,j->ni", run.sensor_axes, np.array([0.0, 0.0, -1.0]))
        run.sensed_N = run.sensed_N + size * down

    return None, acting(sense, weight_N=SIZE)


def turned_since_first(axes: np.ndarray) -> np.ndarray:
    """Rotation vector from the first pose, in the sensor's axes there, (n, 3)."""
    turn = np.einsum("ji,njk->nik", axes[0], axes)
    return 0.5 * np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], axis=1
    )


@declare(LIBRARY, "sensor", 6.0, 60.0, signal="force")
def hose_pack(draw: Draw):
    way, matrix = draw.direction(), draw.rng.uniform(-1.0, 1.0, (3, 3))

    def sense(run: Run, size: float):
        turned = turned_since_first(run.sensor_axes)
        run.sensed_N = run.sensed_N + size * (way + turned @ (3.0 * matrix).T)

    return None, acting(sense, h0_N=lambda size: size * way, H_N_rad=lambda size: 3.0 * size * matrix)


@other_form("hose_pack")
def hose_pack_with_place(draw: Draw):
    """A hose that also pulls harder the further the tool is from where it hangs."""
    way, place = draw.direction(), draw.rng.uniform([-200.0, -300.0, 100.0], [200.0, 300.0, 400.0])

    def sense(run: Run, size: float):
        pull = (place - run.place_mm[::SLOW]) / 300.0
        along = np.einsum("nji,nj->ni", run.sensor_axes, pull)
        run.sensed_N = run.sensed_N + size * (way + 0.5 * along)

    return None, acting(sense, h0_N=lambda size: size * way, hangs_mm=place)


@declare(LIBRARY, "sensor", 0.004, 0.15, signal="force", needs=("cut",))
def force_delay(draw: Draw):
    def sense(run: Run, size: float):
        for k in range(3):
            run.sensed_N[:, k] = np.interp(run.slow_s - size, run.slow_s, run.sensed_N[:, k])
            run.sensed_Nmm[:, k] = np.interp(run.slow_s - size, run.slow_s, run.sensed_Nmm[:, k])

    return None, acting(sense, delay_s=SIZE)


@other_form("force_delay")
def force_filter(draw: Draw):
    """A filter of first order instead of a pure delay."""

    def sense(run: Run, size: float):
        tau = np.full(len(run.slow_s), size)
        for values in (run.sensed_N, run.sensed_Nmm):
            for k in range(3):
                values[:, k] = memory.lag(values[:, k].copy(), tau, SLOW * STEP_s)

    return None, acting(sense, delay_s=SIZE, filter="first order")


@declare(LIBRARY, "part", 0.03, 0.6, signal="scan", needs=("cut", "scan"))
def tool_diameter(draw: Draw):
    sign = draw.pick([-1.0, -1.0, 1.0])

    def world(run: Run, size: float):
        run.world = run.world.cutting(diameter_mm=run.world.cutter.diameter_mm + sign * size)

    return None, acting(world, offset_mm=lambda size: sign * size)


@other_form("tool_diameter")
def tool_tapered(draw: Draw):
    """A mill that is worn thinner towards its tip."""

    def world(run: Run, size: float):
        run.world = run.world.cutting(diameter_mm=run.world.cutter.diameter_mm - 0.7 * size)
        run.depth_taper_mm = 0.3 * size

    return None, acting(world, offset_mm=lambda size: -size, at_top=lambda size: -0.7 * size)
