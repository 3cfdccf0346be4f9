"""What a drive does to its command, in one joint or in all six alike: late, scaled, ahead in jerk, too weak.

Six servos with synchronised gains err alike: target `all`. Then the tip moves on its path but late, or on a
path a little beside it.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import LIBRARY, Draw, declare, numbers, other_form
from tests.plant.robot import Run, STEP_s
from tests.plant.scene import DEGREE

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

    def at(size):
        def servo(run: Run):
            for j in axes:
                run.q_act[:, j] = np.interp(run.t_s - size, run.t_s, run.q_act[:, j])

        return numbers(dead_time_s=size), {"servo": servo}

    return name, at


@declare(
    LIBRARY,
    "servo",
    2e-5,
    0.03,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "own_angle", "travel", links=SERVO),
)
def servo_gain(draw: Draw):
    """The drive goes `size` times too far, counted from the run's start: a wrong scale of its encoder."""
    name, axes = draw.axes()
    sign = draw.sign()

    def at(size):
        def servo(run: Run):
            run.q_act[:, axes] += sign * size * (run.q_act[:, axes] - run.q_act[0, axes])

        return numbers(gain=1.0 + sign * size), {"servo": servo}

    return name, at


JERK = joint_("smooth", "jerk", "acceleration", links=SERVO)


@declare(LIBRARY, "servo", 1e-9, 1e-2, signal="joint_actual", all_runs=True, depends=JERK, moments=True)
def jerk_feed_forward(draw: Draw):
    """Without (or with too much) feed-forward of jerk the error is `size` s³ times the commanded jerk."""
    name, axes = draw.axes()
    sign = draw.sign()

    def at(size):
        def servo(run: Run):
            for j in axes:
                jerk = run.rates(run.rates(run.rates(run.q_cmd[:, j])))
                smooth = memory.lag(jerk, np.full(len(jerk), 0.002), STEP_s)
                run.q_act[:, j] -= sign * size * smooth

        return numbers(s3=sign * size), {"servo": servo}

    return name, at


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


WOUND = joint_("loop", "reversals", "own_torque_memory", "travel")


@declare(LIBRARY, "joint", 1e-5, 0.1, signal="any", all_runs=True, depends=WOUND)
def belt_wind_up(draw: Draw):
    """A belt behind the motor winds up by `size` degrees over the first travel after each reversal.

    dw = (sign(v) - w)·|dq|/soft, Dahl's friction on an elastic belt: smooth where a play has a flank.
    """
    name, j = draw.joint()
    soft = draw.log_uniform(0.002, 0.03)

    def at(size):
        def gear(run: Run):
            run.q_load[:, j] -= size * DEGREE * memory.dahl(run.q_act[:, j].copy(), soft)

        return numbers(deg=size, soft_rad=soft), {"gear": gear}

    return name, at


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
    """A3 is driven along by A2 a little: a parallel link of the wrong length. `size` degrees per degree."""
    sign = draw.sign()

    def at(size):
        def gear(run: Run):
            run.q_load[:, 2] += sign * size * (run.q_act[:, 1] + np.pi / 2.0)

        return numbers(ratio=sign * size), {"gear": gear}

    return None, at


@other_form("axis_coupling")
def axis_coupling_of_a_crank(draw: Draw):
    """Two cranks of unequal radius: the coupling goes with the sine of A2's angle."""
    sign, phase = draw.sign(), draw.uniform(-0.5, 0.5)

    def at(size):
        def gear(run: Run):
            run.q_load[:, 2] += sign * size * 2.0 * np.sin(0.5 * (run.q_act[:, 1] + np.pi / 2.0) + phase)

        return numbers(ratio=sign * size, phase=phase), {"gear": gear}

    return None, at
