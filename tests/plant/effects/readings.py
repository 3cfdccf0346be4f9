"""What encoders read: twist of the gear, uneven lines, a disc that does not run true."""

import numpy as np

from tests.plant import masses, memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import LIBRARY, SIZE, Draw, acting, declare, numbers, other_form
from tests.plant.robot import SLOW, Run, STEP_s, fast, joint_torques
from tests.plant.scene import DEGREE, GEAR_RATIO

GEAR = ("gear",)
LINES = (2, 3, 4)  # pole pairs of a resolver on the motor


def _reads(run: Run, j: int, slow_rad: np.ndarray) -> None:
    """The load encoder reads this much more; the arm stands where it stood."""
    run.q_load[:, j] += fast(run, slow_rad[:, None])[:, 0]


TWIST = joint_("smooth", "own_torque", "force", "acceleration", links=GEAR)


@declare(
    LIBRARY, "joint", 1e-4, 3.0, signal="joint_load", needs=("cut", "q_load"), all_runs=True, depends=TWIST
)
def gear_twist(draw: Draw):
    """The encoder behind the gear sees it twist, `size` in deg per kN·m of the joint's torque.

    The torque is that of the cut, of the arm's weight and of its inertia. The arm stands where its springs
    let it stand: that the encoder sees a part of it moves nothing.
    """
    name, j = draw.joint()

    def sense(run: Run, size: float):
        torque = joint_torques(run)[:, j] + masses.joint_moments(run)[:, j]
        _reads(run, j, size * DEGREE * torque / 1e6)

    return name, acting(sense, deg_per_kNm=SIZE)


def stiffening(torque: np.ndarray, knee: float) -> np.ndarray:
    """x of torque = x + x³/knee², the load of a linear spring of the same start (Newton)."""
    x = np.sign(torque) * np.minimum(np.abs(torque), knee)
    for _ in range(12):
        x = x - (x + x**3 / knee**2 - torque) / (1.0 + 3.0 * x**2 / knee**2)
    return x


@other_form("gear_twist")
def gear_twist_that_stiffens(draw: Draw):
    """A cubic spring under the cut, beside a weight that hangs straight on: soft at first, then stiffer."""
    name, j = draw.joint()
    knee_Nm = draw.log_uniform(100.0, 400.0) if j < 3 else draw.log_uniform(20.0, 80.0)

    def sense(run: Run, size: float):
        torque = stiffening(joint_torques(run)[:, j] / 1000.0, knee_Nm)
        _reads(run, j, size * DEGREE * torque / 1000.0)

    return name, acting(sense, deg_per_kNm=SIZE, knee_Nm=knee_Nm)


@other_form("gear_twist")
def gear_twist_that_lags(draw: Draw):
    """Rubber between gear and link: it gives way a little later than it is loaded."""
    name, j = draw.joint()
    tau_s = draw.log_uniform(0.005, 0.03)

    def sense(run: Run, size: float):
        torque = joint_torques(run)[:, j] + masses.joint_moments(run)[:, j]
        late = memory.lag(torque, np.full(len(torque), tau_s), SLOW * STEP_s)
        _reads(run, j, size * DEGREE * late / 1e6)

    return name, acting(sense, deg_per_kNm=SIZE, tau_s=tau_s)


INTERPOLATION = joint_("periodic", "motor_angle", links=("servo", "gear"))


@declare(LIBRARY, "sensor", 2e-5, 0.02, signal="joint_actual", all_runs=True, depends=INTERPOLATION)
def encoder_interpolation(draw: Draw):
    """A motor encoder's sine and cosine are of unequal height: the reading errs with each of its lines."""
    name, j = draw.joint()
    lines, phase = draw.pick(LINES), draw.uniform(0.0, 2.0 * np.pi)

    def sense(run: Run, size: float):
        angle = lines * GEAR_RATIO[j] * run.q_act[:, j]
        run.q_act[:, j] += size * DEGREE * np.sin(angle + phase)

    return name, acting(sense, amplitude_deg=SIZE, lines=lines, phase=phase)


@other_form("encoder_interpolation")
def encoder_lissajous(draw: Draw):
    """Offset, height and phase of the two tracks are all wrong: once and twice a line."""
    name, j = draw.joint()
    lines, share = draw.pick(LINES), draw.uniform(0.4, 0.9)
    one, two = draw.rng.uniform(0.0, 2.0 * np.pi, 2)

    def at(size):
        def sense(run: Run):
            angle = lines * GEAR_RATIO[j] * run.q_act[:, j]
            wave = np.sin(angle + one) + share * np.sin(2.0 * angle + two)
            run.q_act[:, j] += size * DEGREE * wave

        values = numbers(amplitude_deg=size, lines=lines, phase=float(one), second_share=share)
        return values, {"sense": sense}

    return name, at


ECCENTRIC = joint_("smooth", "own_angle", "constant")


@declare(LIBRARY, "joint", 5e-4, 1.0, signal="tcp", all_runs=True, depends=ECCENTRIC)
def joint_eccentricity(draw: Draw):
    """The gear's last wheel does not run true: an error once a turn of the joint."""
    name, j = draw.joint()
    phase = draw.uniform(0.0, 2.0 * np.pi)

    def gear(run: Run, size: float):
        run.q_load[:, j] += size * DEGREE * np.sin(run.q_act[:, j] + phase)

    return name, acting(gear, amplitude_deg=SIZE, phase=phase)


@other_form("joint_eccentricity")
def joint_eccentricity_of_two(draw: Draw):
    """Once and twice a turn, eccentric and oval, and none at the mark at which it was mastered."""
    name, j = draw.joint()
    share, one, two = draw.uniform(0.3, 0.7), *draw.rng.uniform(0.0, 2.0 * np.pi, 2)

    def gear(run: Run, size: float):
        q = run.q_act[:, j]
        wave = np.sin(q + one) - np.sin(one) + share * (np.sin(2.0 * q + two) - np.sin(two))
        run.q_load[:, j] += size * DEGREE * wave

    return name, acting(gear, amplitude_deg=SIZE, phase=float(one), second_share=share)
