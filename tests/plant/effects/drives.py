"""What a drive does to its command, in one joint or in all six alike: late, loose, ahead in jerk, too weak.

Six servos with synchronised gains err alike: target `all`. Then the tip moves on its path but late, or on a
path a little beside it.
"""

import numpy as np

from tests.plant import masses, memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import LIBRARY, SIZE, Draw, acting, declare, numbers, other_form
from tests.plant.robot import SLOW, Run, STEP_s, fast, joint_torques
from tests.plant.scene import DEGREE, JOINTS

SERVO = ("servo",)


@declare(
    LIBRARY,
    "servo",
    0.001,
    0.06,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "velocity", links=SERVO),
)
def dead_time(draw: Draw):
    """The drive answers `size` seconds late, otherwise exactly: bus cycles between controller and drive."""
    name, axes = draw.axes()

    def servo(run: Run, size: float):
        for j in axes:
            run.q_act[:, j] = np.interp(run.t_s - size, run.t_s, run.q_act[:, j])

    return name, acting(servo, dead_time_s=SIZE)


@other_form("dead_time")
def dead_time_of_two_clocks(draw: Draw):
    """The bus and the drive count their own cycles: the delay grows by up to its mean, then skips a cycle."""
    name, axes = draw.axes()
    skips_hz, begins = draw.log_uniform(0.05, 0.5), draw.uniform(0.0, 1.0)

    def servo(run: Run, size: float):
        late_s = size * (0.5 + np.mod(run.t_s * skips_hz + begins, 1.0))
        for j in axes:
            run.q_act[:, j] = np.interp(run.t_s - late_s, run.t_s, run.q_act[:, j])

    return name, acting(servo, dead_time_s=SIZE, skips_hz=skips_hz)


LOOP = joint_("smooth", "velocity", "acceleration", links=SERVO)


@declare(LIBRARY, "servo", 0.01, 0.5, signal="joint_actual", all_runs=True, depends=LOOP)
def servo_gain(draw: Draw):
    """A position loop, 15 to 60 1/s, to which `size` of the speed is not fed forward, or that much too much.

    q' = k_v·(command - q) + (1 - missing)·command': the error is the missing share of the loop's whole lag.
    """
    name, axes = draw.axes()
    sign, k_v = draw.sign(), draw.log_uniform(15.0, 60.0)

    def servo(run: Run, size: float):
        tau = np.full(len(run.t_s), 1.0 / k_v)
        for j in axes:
            command = run.q_act[:, j].copy()
            run.q_act[:, j] += sign * size * (memory.lag(command, tau, STEP_s) - command)

    return name, acting(servo, missing_share=lambda size: sign * size, k_v_per_s=k_v)


@other_form("servo_gain")
def servo_gain_over_a_slow_speed_loop(draw: Draw):
    """The speed loop inside is only two to six times as fast: the error swings in, e''/w + e' + k_v·e = v."""
    name, axes = draw.axes()
    sign, k_v, faster = draw.sign(), draw.log_uniform(15.0, 60.0), draw.uniform(2.0, 6.0)
    hz, damping = k_v * np.sqrt(faster) / (2.0 * np.pi), 0.5 * np.sqrt(faster)

    def servo(run: Run, size: float):
        for j in axes:
            speed = run.rates(run.q_act[:, j]).copy()
            run.q_act[:, j] -= sign * size / k_v * memory.second_order(speed, hz, damping, STEP_s)

    return name, acting(servo, missing_share=lambda size: sign * size, k_v_per_s=k_v, faster=faster)


JERK = joint_("smooth", "jerk", "acceleration", links=SERVO)


def _jerk(run: Run, j: int) -> np.ndarray:
    return run.rates(run.rates(run.rates(run.q_cmd[:, j])))


@declare(LIBRARY, "servo", 1e-9, 1e-2, signal="joint_actual", all_runs=True, depends=JERK, moments=True)
def jerk_feed_forward(draw: Draw):
    """Without (or with too much) feed-forward of jerk a drive is behind by `size` s³ times the jerk.

    Its speed and torque loops take `settle_s` each to answer.
    """
    name, axes = draw.axes()
    sign, settle_s = draw.sign(), draw.log_uniform(0.004, 0.02)

    def servo(run: Run, size: float):
        tau = np.full(len(run.t_s), settle_s)
        for j in axes:
            smooth = memory.lag(memory.lag(_jerk(run, j), tau, STEP_s), tau, STEP_s)
            run.q_act[:, j] -= sign * size * smooth

    return name, acting(servo, s3=lambda size: sign * size, settle_s=settle_s)


@other_form("jerk_feed_forward")
def jerk_feed_forward_that_rings(draw: Draw):
    """A drive train of 15 to 40 Hz swings at each jump of the acceleration."""
    name, axes = draw.axes()
    sign, hz, damping = draw.sign(), draw.uniform(15.0, 40.0), draw.uniform(0.15, 0.5)

    def servo(run: Run, size: float):
        for j in axes:
            run.q_act[:, j] -= sign * size * memory.second_order(_jerk(run, j), hz, damping, STEP_s)

    return name, acting(servo, s3=lambda size: sign * size, hz=hz, damping=damping)


CLIPPED = joint_("smooth", "acceleration", "own_torque", "velocity", links=SERVO)


def _clipped(run: Run, j: int, share: float, hz: float) -> None:
    command = run.q_act[:, j]
    peak = np.abs(np.diff(command, 2)).max() / STEP_s**2
    run.q_act[:, j] = memory.limited(command.copy(), peak * (1.0 - share), hz, STEP_s)


@declare(LIBRARY, "servo", 0.02, 0.9, signal="joint_actual", all_runs=True, depends=CLIPPED, moments=True)
def current_limit(draw: Draw):
    """The drive gives `size` less than the largest acceleration of the run, falls behind and catches up.

    Current is torque, so a limit clips the acceleration; the loop that catches up has 8 to 20 Hz.
    """
    name, j = draw.joint()
    hz = draw.uniform(8.0, 20.0)

    def at(size):
        return numbers(short=size, hz=hz), {"servo": lambda run: _clipped(run, j, min(size, 0.95), hz)}

    return name, at


WOUND = joint_("smooth", "own_torque_memory", "own_torque", "force")
BELTS = ("A4", "A5", "A6")


def _creeping(draw: Draw, slower: tuple[float, ...]):
    """Creep of a belt under the joint's torque, in equal parts with these multiples of one time."""
    name = draw.target(BELTS)
    j, relax_s = JOINTS.index(name), draw.log_uniform(1.0, 40.0)

    def load(run: Run, size: float):  # the torque is known after the cut
        torque = joint_torques(run)[:, j] + masses.joint_moments(run)[:, j]
        taus = [np.full(len(torque), relax_s * times) for times in slower]
        crept = np.mean([memory.lag(torque, tau, SLOW * STEP_s) for tau in taus], axis=0)
        run.q_load[:, j] += size * DEGREE / 1e6 * fast(run, crept[:, None])[:, 0]

    return name, acting(load, deg_per_kNm=SIZE, relax_s=relax_s)


@declare(LIBRARY, "joint", 1e-3, 10.0, signal="any", needs=("cut",), all_runs=True, depends=WOUND)
def belt_wind_up(draw: Draw):
    """The belt of a wrist axis creeps by `size` degrees per kN·m of the joint's torque, with one time."""
    return _creeping(draw, (1.0,))


@other_form("belt_wind_up")
def belt_wind_up_of_two_times(draw: Draw):
    """Rubber and cord: half of it creeps within a fifth of the time of the other half."""
    return _creeping(draw, (0.4, 2.0))


@declare(
    LIBRARY,
    "joint",
    1e-6,
    2e-2,
    signal="any",
    all_runs=True,
    depends=joint_("smooth", "own_angle", "place", "constant"),
)
def axis_coupling(draw: Draw):
    """A3 is driven along by A2 a little: a parallel link of the wrong length. `size` degrees per degree.

    Counted from A2's zero, where its link lies level; what that leaves constant is a matter of A3's zero.
    """
    sign = draw.sign()

    def gear(run: Run, size: float):
        run.q_load[:, 2] += sign * size * run.q_act[:, 1]

    return None, acting(gear, ratio=lambda size: sign * size)


@other_form("axis_coupling")
def axis_coupling_of_a_crank(draw: Draw):
    """Two cranks of unequal radius: the coupling goes with the sine of A2's angle."""
    sign, phase = draw.sign(), draw.uniform(-0.5, 0.5)

    def gear(run: Run, size: float):
        run.q_load[:, 2] += sign * size * 2.0 * np.sin(0.5 * run.q_act[:, 1] + phase)

    return None, acting(gear, ratio=lambda size: sign * size, phase=phase)
