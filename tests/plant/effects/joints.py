"""Backlash, friction, transmission, mastering, the coupling of the wrist."""

import numpy as np

from tests.plant import memory
from tests.plant.effects.registry import LIBRARY, SIZE, Draw, acting, declare, numbers, other_form
from tests.plant.robot import Run, STEP_s, fast, joint_torques, ripple, slack
from tests.plant.scene import DEGREE

STILL_rad_s = 2e-5


@declare(LIBRARY, "joint", 0.001, 0.05)
def backlash(draw: Draw):
    name, axes = draw.axes()
    start = draw.uniform(-1.0, 1.0)

    def gear(run: Run, size: float):
        for j in axes:
            run.q_load[:, j] += slack(run.q_act[:, j], size, start)

    return name, acting(gear, gap_deg=SIZE)


@other_form("backlash")
def lost_motion_with_torque(draw: Draw):
    """A play that the torque opens: 40 % of it without load, all of it from some torque on."""
    name, j = draw.joint()
    start, full_Nmm = draw.uniform(-1.0, 1.0), draw.log_uniform(5e4, 4e5)

    def load(run: Run, size: float):  # the torque is known after the cut
        press = np.minimum(np.abs(joint_torques(run)[:, j]) / full_Nmm, 1.0)
        open_ = fast(run, press[:, None])[:, 0]
        run.q_load[:, j] += slack(run.q_act[:, j], size * (0.4 + 0.6 * open_), start)

    return name, acting(load, gap_deg=SIZE, full_torque_Nm=full_Nmm / 1000.0)


@other_form("backlash")
def soft_play(draw: Draw):
    """Three plays of different width side by side (Prandtl-Ishlinskii): the flank is crossed gradually."""
    name, j = draw.joint()
    start = draw.uniform(-1.0, 1.0)

    def gear(run: Run, size: float):
        q = run.q_act[:, j]
        run.q_load[:, j] += sum(slack(q, size * w, start) for w in (0.5, 1.0, 1.5)) / 3.0

    return name, acting(gear, gap_deg=SIZE, plays=3)


@declare(LIBRARY, "joint", 0.0008, 0.03)
def friction(draw: Draw):
    name, j = draw.joint()
    decay_s = draw.log_uniform(0.03, 0.4)

    def servo(run: Run, size: float):
        speed = run.rates(run.q_cmd)[:, j]
        run.q_act[:, j] += memory.reversal_spikes(speed, size * DEGREE, decay_s, STEP_s, STILL_rad_s)

    return name, acting(servo, spike_deg=SIZE, decay_s=decay_s)


@other_form("friction")
def friction_of_bristles(draw: Draw):
    """LuGre friction against a drive whose integral part works it off."""
    name, j = draw.joint()
    decay_s, breakaway = draw.log_uniform(0.05, 0.4), draw.log_uniform(5e-5, 5e-4)
    extra = draw.uniform(0.0, 0.4)

    def servo(run: Run, size: float):
        speed = run.rates(run.q_cmd)[:, j].copy()
        torque = memory.lugre(speed, breakaway, 0.01, extra, STEP_s)
        left = memory.high_pass(torque, decay_s, STEP_s)
        run.q_act[:, j] -= 0.5 * size * DEGREE * left

    return name, acting(servo, spike_deg=SIZE, decay_s=decay_s, breakaway_rad=breakaway)


@declare(LIBRARY, "joint", 0.0008, 0.02)
def transmission(draw: Draw):
    name, j = draw.joint()
    harmonic, phase = draw.pick([1, 2]), draw.uniform(0.0, 2.0 * np.pi)

    def gear(run: Run, size: float):
        run.q_load[:, j] += ripple(run.q_act[:, j], j, size, harmonic, phase)

    return name, acting(gear, amplitude_deg=SIZE, harmonic=harmonic, phase=phase)


@other_form("transmission")
def transmission_of_two(draw: Draw):
    """Once and twice a motor turn together."""
    name, j = draw.joint()
    share, one, two = draw.uniform(0.4, 0.9), *draw.rng.uniform(0.0, 2.0 * np.pi, 2)

    def gear(run: Run, size: float):
        q = run.q_act[:, j]
        run.q_load[:, j] += ripple(q, j, size, 1, one) + ripple(q, j, share * size, 2, two)

    return name, acting(gear, amplitude_deg=SIZE, second_share=share, phase=float(one))


@other_form("transmission")
def transmission_that_swells(draw: Draw):
    """An amplitude that comes and goes along the range, as of two wheels with nearly the same teeth."""
    name, j = draw.joint()
    phase, period = draw.uniform(0.0, 2.0 * np.pi), draw.uniform(0.1, 0.4)

    def gear(run: Run, size: float):
        q = run.q_act[:, j]
        swell = 1.0 + 0.6 * np.cos(q * 2.0 * np.pi / period)
        run.q_load[:, j] += ripple(q, j, size * swell, 1, phase)

    return name, acting(gear, amplitude_deg=SIZE, harmonic=1, phase=phase, swell_rad=period)


@declare(LIBRARY, "joint", 0.002, 0.2, signal="tcp")
def mastering(draw: Draw):
    name, j = draw.joint()
    sign = draw.sign()

    def gear(run: Run, size: float):
        run.zero_rad[j] += sign * size * DEGREE

    return name, acting(gear, offset_deg=lambda size: sign * size)


@other_form("mastering")
def mastering_that_creeps(draw: Draw):
    """A zero that is a little further off on every run."""
    name, j = draw.joint()
    sign = draw.sign()

    def gear(run: Run, size: float):
        run.zero_rad[j] += sign * size * DEGREE * (1.0 + 0.15 * run.number)

    return name, acting(gear, offset_deg=lambda size: sign * size, creep=0.15)


@declare(LIBRARY, "joint", 2e-5, 5e-3)
def wrist_coupling(draw: Draw):
    sign = draw.sign()

    def gear(run: Run, size: float):
        run.q_load[:, 4] += sign * size * run.q_act[:, 3]
        run.q_load[:, 5] += sign * size * (run.q_act[:, 3] + run.q_act[:, 4])

    return None, acting(gear, ratio=lambda size: sign * size)


@other_form("wrist_coupling")
def wrist_coupling_of_wheels(draw: Draw):
    """A coupling that is not quite even: bevel wheels out of round."""
    sign, phase = draw.sign(), draw.uniform(0.0, 2.0 * np.pi)

    def at(size):
        def bend(q):
            return sign * size * (q + 0.25 * (np.sin(2.0 * q + phase) - np.sin(phase)))

        def gear(run: Run):
            run.q_load[:, 4] += bend(run.q_act[:, 3])
            run.q_load[:, 5] += bend(run.q_act[:, 3] + run.q_act[:, 4])

        return numbers(ratio=sign * size, uneven=0.25), {"gear": gear}

    return None, at
