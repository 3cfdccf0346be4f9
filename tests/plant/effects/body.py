"""Lengths, frames, warmth; stiffness and what else gives way."""

import numpy as np

from tests.plant import memory
from tests.plant.effects.registry import LIBRARY, SIZE, Draw, acting, declare, numbers, other_form
from tests.plant.robot import Run, STEP_s, fast, joint_torques
from tests.plant.scene import DEGREE, LENGTHS, VIRTUAL, euler

SIX = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")


@declare(LIBRARY, "geometry", 0.05, 3.0, signal="tcp")
def link_length(draw: Draw):
    name = draw.target(LENGTHS)
    row, sign = LENGTHS.index(name), draw.sign()

    def world(run: Run, size: float):
        lengths = run.world.lengths_mm.copy()
        lengths[row] += sign * size
        run.world = run.world.but(lengths_mm=lengths)

    return name, acting(world, mm=lambda size: sign * size)


@other_form("link_length")
def link_length_that_sags(draw: Draw):
    """A wrong length that also changes a little with the pose (weight of the arm)."""
    target, at = link_length(draw)

    def sagging(size):
        values, hooks = at(size)

        def tip(run: Run):
            run.tip_mm[:, 2] -= 0.1 * size * np.cos(run.q_load[:, 1] + 1.2)

        return numbers(**values, sag_mm=0.1 * size), {**hooks, "tip": tip}

    return target, sagging


def _six(draw: Draw, size: float, way: np.ndarray) -> np.ndarray:
    """Six numbers of a frame: millimetres and, at 500 mm from the work, as large in degrees."""
    return size * way * np.array([1.0, 1.0, 1.0, *([1.0 / 500.0 / DEGREE] * 3)])


@declare(LIBRARY, "geometry", 0.08, 3.0, signal="tcp")
def base_frame(draw: Draw):
    way = np.concatenate([draw.direction(), draw.direction() * draw.uniform(0.2, 1.0)])

    def at(size):
        six = _six(draw, size, way)

        def tip(run: Run):
            turn = euler(*six[3:])
            run.tip_mm = run.tip_mm @ turn.T + six[:3]
            run.tip_axes = turn @ run.tip_axes

        return dict(zip(SIX, six.tolist(), strict=True)), {"tip": tip}

    return None, at


@other_form("base_frame")
def base_frame_that_stretches(draw: Draw):
    """Shift and turn with a scale on top: a reference bar that was warm."""
    target, at = base_frame(draw)
    ppm = draw.uniform(20.0, 60.0) * draw.sign()

    def stretched(size):
        values, hooks = at(size)

        def tip(run: Run):
            hooks["tip"](run)
            run.tip_mm = run.tip_mm * (1.0 + ppm * 1e-6 * min(size, 2.0))

        return {**values, "scale_ppm": ppm}, {"tip": tip}

    return target, stretched


@declare(LIBRARY, "geometry", 0.08, 3.0, signal="tcp")
def tool_frame(draw: Draw):
    way = np.concatenate([draw.direction(), draw.direction() * draw.uniform(0.2, 1.0)])

    def at(size):
        six = _six(draw, size, way)

        def tip(run: Run):
            run.tip_mm = run.tip_mm + run.tip_axes @ six[:3]
            run.tip_axes = run.tip_axes @ euler(*six[3:])

        return dict(zip(SIX, six.tolist(), strict=True)), {"tip": tip}

    return None, at


@declare(LIBRARY, "geometry", 0.05, 1.0, signal="tcp", hours=True)
def thermal(draw: Draw):
    way, constant_h = draw.direction(), draw.log_uniform(0.5, 3.0)

    def tip(run: Run, size: float):
        hours = (run.age_s + run.elapsed_s) / 3600.0
        grown = size * constant_h * -np.expm1(-hours / constant_h)
        run.tip_mm = run.tip_mm + grown[:, None] * way

    return None, acting(tip, mm_per_h=SIZE, time_constant_h=constant_h, direction=way)


@other_form("thermal")
def thermal_of_two_bodies(draw: Draw):
    """Spindle and arm warm up apart, each with its own time and direction."""
    one, two = draw.direction(), draw.direction()
    fast_h, slow_h = draw.log_uniform(0.15, 0.5), draw.log_uniform(1.0, 4.0)

    def tip(run: Run, size: float):
        hours = ((run.age_s + run.elapsed_s) / 3600.0)[:, None]
        quick, late = (size * c * -np.expm1(-hours / c) for c in (fast_h, slow_h))
        run.tip_mm = run.tip_mm + quick * (0.5 * one + 0.5 * two) + late * two

    return None, acting(tip, mm_per_h=SIZE, time_constant_h=slow_h, second_h=fast_h)


def _softer(row: int, factors) -> dict:
    def world(run: Run):
        k = run.world.stiffness_Nmm_rad.copy()
        k[row] *= factors
        run.world = run.world.but(stiffness_Nmm_rad=k)

    return {"world": world}


@declare(LIBRARY, "compliance", 0.12, 0.65, signal="tcp", needs=("cut",))
def stiffness(draw: Draw):
    name = draw.target(VIRTUAL)
    sign = draw.pick([-1.0, -1.0, 1.0])

    def at(size):
        scale = 1.0 - size if sign < 0.0 else 1.0 / (1.0 - size)
        return numbers(scale=scale), _softer(VIRTUAL.index(name), scale)

    return name, at


@other_form("stiffness")
def stiffness_of_one_axis(draw: Draw):
    """Only the two tilting directions are softer: a bearing, not the gear."""
    name = draw.target(VIRTUAL)

    def at(size):
        scale = 1.0 - size
        return numbers(scale=scale, only="tilt"), _softer(VIRTUAL.index(name), np.array([scale, scale, 1.0]))

    return name, at


def _giving(j: int, angle_of) -> dict:
    """Extra angle behind the load encoder as a function of the joint's torque in N·mm."""

    def bend(run: Run):
        run.extra_rad[:, j] += angle_of(joint_torques(run)[:, j])

    return {"bend": bend}


@declare(LIBRARY, "compliance", 0.002, 0.04, signal="tcp", needs=("cut",))
def nonlinear_stiffness(draw: Draw):
    name, j = draw.joint()
    knee_Nm = draw.log_uniform(60.0, 300.0) if j < 3 else draw.log_uniform(15.0, 60.0)

    def at(size):
        soft = size * DEGREE
        hooks = _giving(j, lambda torque: soft * np.tanh(torque / (1000.0 * knee_Nm)))
        return numbers(soft_deg=size, torque_Nm=knee_Nm), hooks

    return name, at


@other_form("nonlinear_stiffness")
def cubic_stiffness(draw: Draw):
    """An extra angle that grows with the third power of the torque."""
    name, j = draw.joint()
    full_Nm = draw.log_uniform(200.0, 500.0) if j < 3 else draw.log_uniform(40.0, 100.0)

    def at(size):
        soft = size * DEGREE
        hooks = _giving(j, lambda torque: soft * (torque / (1000.0 * full_Nm)) ** 3)
        return numbers(soft_deg=size, full_Nm=full_Nm, power=3), hooks

    return name, at


@declare(LIBRARY, "compliance", 0.001, 0.03, signal="tcp", needs=("cut",))
def hysteresis(draw: Draw):
    name, j = draw.joint()

    def at(size):
        def angle(torque):
            full = max(np.abs(torque).max(), 1.0)
            return size * DEGREE * memory.play(torque.copy(), np.full(len(torque), full / 2.0), 0.0) / full

        return numbers(loss_deg=size), _giving(j, angle)

    return name, at


@other_form("hysteresis")
def hysteresis_of_bouc_wen(draw: Draw):
    """A smooth loop: Bouc-Wen."""
    name, j = draw.joint()
    sharp = draw.uniform(2.0, 5.0)

    def at(size):
        def angle(torque):
            full = max(np.abs(torque).max(), 1.0)
            return 0.5 * size * DEGREE * memory.bouc_wen(torque.copy(), full, sharp)

        return numbers(loss_deg=size, sharpness=sharp), _giving(j, angle)

    return name, at


@declare(LIBRARY, "compliance", 1.0, 30.0, signal="tcp")
def gravity(draw: Draw):
    centre = draw.rng.uniform([-60.0, -150.0, 50.0], [60.0, 150.0, 300.0])

    def at(size):
        def world(run: Run):
            run.payload.append((size, centre))

        values = dict(zip(("cx_mm", "cy_mm", "cz_mm"), centre.tolist(), strict=True))
        return numbers(payload_kg=size, **values), {"world": world}

    return None, at


def swing(run: Run, way: np.ndarray, hz: float, damping: float, share: float) -> np.ndarray:
    """What a mode adds to the quasi-static place along a direction, mm, at the fast samples.

    y" + 2ζω·y' + ω²·y = share·(ω²·bend - acceleration); added is y - share·bend.
    """
    bend = fast(run, run.bending_mm)[:, :] @ way
    push = run.rates(run.rates(run.place_mm)) @ way
    drive = share * (bend - push / (2.0 * np.pi * hz) ** 2)
    return memory.second_order(drive, hz, damping, STEP_s) - share * bend


@declare(LIBRARY, "compliance", 0.1, 3.0, signal="tcp")
def vibration(draw: Draw):
    way, hz, damping = draw.direction(), draw.uniform(7.0, 25.0), draw.log_uniform(0.01, 0.06)

    def tip(run: Run, size: float):
        run.tip_mm = run.tip_mm + swing(run, way, hz, damping, size)[:, None] * way

    return None, acting(tip, hz=hz, damping=damping, participation=SIZE, direction=way)


@other_form("vibration")
def vibration_of_two_modes(draw: Draw):
    """Two modes in different directions."""
    ways, hz = (draw.direction(), draw.direction()), (draw.uniform(7.0, 13.0), draw.uniform(14.0, 25.0))
    damping = draw.log_uniform(0.01, 0.06)

    def tip(run: Run, size: float):
        added = [swing(run, w, f, damping, size)[:, None] * w for w, f in zip(ways, hz, strict=True)]
        run.tip_mm = run.tip_mm + added[0] + 0.7 * added[1]

    return None, acting(tip, hz=hz[0], second_hz=hz[1], damping=damping, participation=SIZE)
