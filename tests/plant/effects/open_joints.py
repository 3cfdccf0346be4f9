"""Errors of joints, drives and encoders that are in no library.

An effect each: what happens, where that is known from, and when.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import joint as joint_
from tests.plant.effects.registry import SIZE, UNKNOWN, Draw, acting, declare
from tests.plant.robot import SLOW, Run, STEP_s, joints_for
from tests.plant.scene import DEGREE, GEAR_RATIO, World


@declare(
    UNKNOWN,
    "joint",
    1e-3,
    3.0,
    signal="tcp",
    all_runs=True,
    depends=joint_("periodic", "acceleration", "tone"),
)
def belt_resonance(draw: Draw):
    """The toothed belt between motor and gear is a spring: the load rings when the motor accelerates.

    A belt of 1e5 to 1e6 N/m with the motor's wheel and the gear's inertia has its first mode at some 8 to 20
    Hz (Hace, Jezernik, Sabanovic 2005, on belt-driven servos).

    `size` scales how far the load rings; 1 is the free mode.
    """
    name, j = draw.joint()
    hz, damping = draw.uniform(8.0, 20.0), draw.log_uniform(0.02, 0.06)

    def gear(run: Run, size: float):
        rings = memory.second_order(run.q_act[:, j].copy(), hz, damping, STEP_s)
        run.q_load[:, j] += size * (rings - run.q_act[:, j])

    return name, acting(gear, share=SIZE, hz=hz, damping=damping)


@declare(
    UNKNOWN,
    "joint",
    1e-5,
    2.0,
    signal="any",
    all_runs=True,
    depends=joint_("drift", "acceleration", "travel", "own_torque_memory", "time_smooth"),
)
def belt_slips(draw: Draw):
    """The belt of a motor's encoder slips when the motor speeds up hard: the reading creeps away.

    Above a peripheral force a smooth belt slips in proportion to what is beyond (Euler and Eytelwein); the
    drive follows the encoder, so that the joint truly goes astray, one way for each direction of
    acceleration.

    `size` in degrees lost per second at the largest acceleration of the run.
    """
    name, j = draw.joint()
    holds = draw.uniform(0.2, 0.6)

    def gear(run: Run, size: float):
        push = run.rates(run.rates(run.q_cmd))[:, j]
        push = push / max(np.abs(push).max(), 1e-12)
        slips = np.sign(push) * np.maximum(np.abs(push) - holds, 0.0) / (1.0 - holds)
        uneven = np.where(slips > 0.0, 1.0, 0.6)  # the belt is tighter on one side
        run.q_load[:, j] += size * DEGREE * np.cumsum(slips * uneven) * STEP_s

    return name, acting(gear, deg_per_s=SIZE, holds=holds)


STILL_rad_s = 2e-4


def since_rest(speed: np.ndarray, rest_s: float) -> np.ndarray:
    """Seconds since a joint last stood for at least so long; far in the past where it never did."""
    out, stood, since = np.full(len(speed), 1e9), 0.0, 1e9
    for i, moves in enumerate(np.abs(speed) > STILL_rad_s):
        stood = 0.0 if moves else stood + STEP_s
        since = 0.0 if stood >= rest_s else since + STEP_s
        out[i] = since
    return out


@declare(
    UNKNOWN,
    "servo",
    1e-6,
    0.5,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "velocity", "reversals", "time_since_start", links=("servo",)),
)
def brake_after_stop(draw: Draw):
    """The holding brake falls in at each stop of a joint and lets go late: the joint starts against it.

    A brake's coil takes 50 to 300 ms to lift; for so long after each start the drive lags behind its command.

    `size` in degrees of lag at the start after a rest of 50 ms.
    """
    name, j = draw.joint()
    lifts_s = draw.log_uniform(0.05, 0.3)

    def servo(run: Run, size: float):
        speed = run.rates(run.q_cmd)[:, j]
        drags = np.exp(-since_rest(speed, 0.05) / lifts_s) * np.tanh(speed / 2e-3)
        run.q_act[:, j] -= size * DEGREE * drags

    return name, acting(servo, deg=SIZE, lifts_s=lifts_s)


@declare(
    UNKNOWN,
    "servo",
    1e-6,
    0.2,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("loop", "reversals", "time_since_start", "velocity", links=("servo",)),
)
def brake_drag(draw: Draw):
    """A holding brake that does not lift all the way: it drags until it has warmed.

    The drive's integral part works off a part of the constant torque; what is left is a following error
    against the motion. Friction of a brake lining fades with heat within seconds to a minute.
    """
    name, j = draw.joint()
    fades_s, still = draw.log_uniform(3.0, 15.0), 2e-3

    def servo(run: Run, size: float):
        speed = run.rates(run.q_cmd)[:, j]
        drag = np.exp(-run.elapsed_s / fades_s) * np.tanh(speed / still)
        late = memory.lag(drag, np.full(len(drag), 0.03), 0.001)
        run.q_act[:, j] -= size * DEGREE * late

    return name, acting(servo, deg=SIZE, fades_s=fades_s)


@declare(
    UNKNOWN,
    "servo",
    1e-6,
    0.05,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("periodic", "motor_angle", "velocity", links=("servo", "gear", "mechanics")),
)
def cogging(draw: Draw):
    """The motor cogs: its magnets favour some angles, so the drive lags and leads within a turn.

    Cogging repeats with the least common multiple of slots and poles, 6 to 18 times a motor turn here. The
    speed loop suppresses it where it comes slowly, inertia where it comes fast (Jahns and Soong 1996).
    """
    name, j = draw.joint()
    count, phase, middle_hz = draw.pick([6, 12, 18]), draw.uniform(0.0, 2.0 * np.pi), draw.uniform(6.0, 20.0)

    def servo(run: Run, size: float):
        angle = count * GEAR_RATIO[j] * run.q_cmd[:, j]
        hz = np.abs(run.rates(angle)) / (2.0 * np.pi) / middle_hz
        band = 2.0 * hz / (1.0 + hz**2)  # most at the middle, less on either side
        run.q_act[:, j] += size * DEGREE * band * np.sin(angle + phase)

    return name, acting(servo, deg=SIZE, count=count, middle_hz=middle_hz)


@declare(
    UNKNOWN,
    "compliance",
    1e-5,
    1.0,
    signal="tcp",
    hours=True,
    all_runs=True,
    depends=joint_("smooth", "wall_clock", "own_angle", "temperature", links=("mechanics",)),
)
def counterbalance(draw: Draw):
    """The gas spring that carries A2 has another pressure than the model: the arm sags with its angle.

    Its torque about A2 goes with the sine of the angle from the dead point and with the gas' absolute
    temperature; as the spring warms by 10 to 20 K in a shift the torque grows by some percent (ideal gas).

    `size` is the sag in degrees at a right angle, once warm; cold half of it.
    """
    dead_deg, warms_h = draw.uniform(-130.0, -60.0), draw.uniform(0.5, 2.0)

    def bend(run: Run, size: float):
        hours = (run.age_s + run.elapsed_s[::SLOW]) / 3600.0
        warm = 1.0 - 0.5 * np.exp(-hours / warms_h)
        run.extra_rad[:, 1] += size * DEGREE * warm * np.sin(run.q_load[::SLOW, 1] - dead_deg * DEGREE)

    return "A2", acting(bend, deg=SIZE, dead_deg=dead_deg, warms_h=warms_h)


@declare(
    UNKNOWN,
    "sensor",
    1e-6,
    0.2,
    signal="joint_load",
    needs=("q_load",),
    all_runs=True,
    depends=joint_("step", "time_step", "own_angle", "travel", links=("gear",)),
)
def encoder_drop_out(draw: Draw):
    """A scratch on the disc of a load encoder: each pass over it loses some counts, and they stay lost.

    Without a reference mark on the way the count is off from then on; passes to and fro need not cancel.

    `size` in degrees lost at each pass in one direction, where the tip is at some place of the work.
    """
    name, j = draw.joint()
    place = draw.rng.uniform([[40.0, -30.0, -5.0]], [[120.0, 30.0, 5.0]])
    scratch = float(joints_for(World(), place)[0, j])

    def sense(run: Run, size: float):
        q = run.q_load[:, j]
        passes = np.diff((q > scratch).astype(int), prepend=int(q[0] > scratch)) > 0
        run.q_load[:, j] -= size * DEGREE * np.cumsum(passes)

    return name, acting(sense, deg=SIZE, at_deg=scratch / DEGREE)


@declare(
    UNKNOWN,
    "servo",
    1e-4,
    0.3,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "time_smooth", "time_step", "velocity", "noise", links=("servo",)),
    moments=True,
)
def held_set_points(draw: Draw):
    """Packets of set-points are lost: all drives hold the last one for some cycles and then catch up.

    A lost packet of a field bus repeats the last value; the loops see a step of speed times the hold and take
    it up with their own time. Lost packets come by chance, a handful a run.

    `size` in seconds of the longest hold.
    """
    seed, count = int(draw.rng.integers(1 << 30)), draw.uniform(3.0, 9.0)

    def servo(run: Run, size: float):
        rng = np.random.default_rng([seed, run.number])
        behind = np.zeros(len(run.t_s))
        for begin, share in rng.uniform([0.5, 0.4], [run.t_s[-1], 1.0], (int(count), 2)):
            since = run.t_s - begin
            behind += np.where((since >= 0.0) & (since < size * share), since, 0.0)
        behind = memory.lag(behind, np.full(len(behind), 0.008), STEP_s)
        run.q_act -= behind[:, None] * run.rates(run.q_cmd)

    return None, acting(servo, hold_s=SIZE, count=int(count))


@declare(
    UNKNOWN,
    "servo",
    1e-6,
    0.1,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("periodic", "velocity", "tone", links=("servo",)),
)
def interpolation_jitter(draw: Draw):
    """One axis' set-points come a cycle late at every so many cycles: a beat between bus and interpolator.

    With bus and interpolator on clocks of their own one set-point is held twice now and then; the axis is
    late by a fraction of a cycle in proportion to its speed and catches up.

    `size` is the delay in s at its worst.
    """
    name, j = draw.joint()
    every_s, tau_s = draw.uniform(0.4, 2.0), 0.02

    def servo(run: Run, size: float):
        saw = np.mod(run.t_s, every_s) / every_s  # grows over the beat, then a cycle is caught up
        late = memory.lag(saw, np.full(len(saw), tau_s), STEP_s)
        run.q_act[:, j] -= size * late * run.rates(run.q_cmd)[:, j]

    return name, acting(servo, delay_s=SIZE, every_s=every_s)


@declare(
    UNKNOWN,
    "servo",
    1e-7,
    0.1,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "acceleration", links=("servo",)),
)
def load_inertia(draw: Draw):
    """The load's inertia in the controller is wrong, its weight is right: a following error at acceleration.

    The drive's feed-forward torque misses the difference of inertia times the acceleration; the position loop
    sees it as a disturbance of its stiffness.

    `size` in s²: the error over the acceleration, 1 / (loop stiffness over missing inertia).
    """
    name, j = draw.joint()
    tau_s, sign = draw.uniform(0.005, 0.02), draw.sign()

    def servo(run: Run, size: float):
        push = run.rates(run.rates(run.q_cmd))[:, j]
        run.q_act[:, j] -= sign * size * memory.lag(push, np.full(len(push), tau_s), STEP_s)

    return name, acting(servo, s2=lambda size: sign * size, tau_s=tau_s)


def film(speed: np.ndarray, full: float, up_s: float, down_s: float) -> np.ndarray:
    """Thickness in 0 ... 1 that follows (|speed|/full)^0.7 quickly up and slowly down."""
    wanted = np.minimum(np.abs(speed) / full, 1.0) ** 0.7
    out, now = np.empty(len(speed)), 0.0
    rise, fall = 1.0 - np.exp(-STEP_s / up_s), 1.0 - np.exp(-STEP_s / down_s)
    for i, goal in enumerate(wanted):
        now += (goal - now) * (rise if goal > now else fall)
        out[i] = now
    return out


@declare(
    UNKNOWN,
    "joint",
    1e-5,
    0.3,
    signal="any",
    all_runs=True,
    depends=joint_("smooth", "velocity", "travel", "time_since_start"),
)
def oil_film(draw: Draw):
    """The film between a gear's teeth is squeezed out at rest and builds up in motion: the joint creeps.

    Film thickness follows the rolling speed with a fraction of a second on the way up (Hamrock and Dowson)
    and seconds on the way down, as oil has to be squeezed out; a helical or skewed gear turns by the film
    over its angle.

    `size` in degrees at a full film; the encoder behind the gear and the arm both turn.
    """
    name, j = draw.joint()
    full, down_s, sign = draw.log_uniform(0.02, 0.1), draw.uniform(0.5, 3.0), draw.sign()

    def gear(run: Run, size: float):
        thick = film(run.rates(run.q_act)[:, j], full, 0.1, down_s)
        run.q_load[:, j] += sign * size * DEGREE * thick

    return name, acting(gear, deg=SIZE, full_rad_s=full, down_s=down_s)


def stribeck(speed: np.ndarray, slow: float, peak: float, viscous: float) -> np.ndarray:
    """Friction over its Coulomb level at a speed, odd."""
    boundary = np.tanh(speed / (0.1 * slow)) * (1.0 + peak * np.exp(-((speed / slow) ** 2)))
    return boundary + viscous * speed


@declare(
    UNKNOWN,
    "servo",
    1e-6,
    0.1,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "velocity", "reversals", links=("servo",)),
)
def oil_friction(draw: Draw):
    """Cold oil in one gear: friction rises with speed, and most when it barely moves.

    Stribeck's curve: boundary friction falls to a minimum and viscous friction rises beyond; in cold oil the
    viscous part is several times the warm one (Bittencourt and Axelsson 2014, on robot joints). The drive
    follows late by what its stiffness gives.

    `size` is the lag in degrees at the Coulomb level.
    """
    name, j = draw.joint()
    slow, peak, viscous = draw.log_uniform(0.003, 0.02), draw.uniform(0.5, 1.5), draw.uniform(10.0, 60.0)

    def servo(run: Run, size: float):
        rubs = stribeck(run.rates(run.q_cmd)[:, j], slow, peak, viscous)
        run.q_act[:, j] -= size * DEGREE * memory.lag(rubs, np.full(len(rubs), 0.015), STEP_s)

    return name, acting(servo, deg=SIZE, slow_rad_s=slow, peak=peak, viscous_s_rad=viscous)


@declare(
    UNKNOWN,
    "servo",
    1e-5,
    0.2,
    signal="joint_actual",
    all_runs=True,
    depends=joint_("smooth", "velocity", "acceleration", links=("servo",)),
)
def supply_sags(draw: Draw):
    """The drives' common supply sags when all of them pull at once: every joint follows later at high power.

    The bus voltage falls with the sum of force times speed and comes back within tenths of a second; loops
    with less voltage have less gain, so that their lag grows (a weak line or an ageing capacitor).

    `size` in seconds of extra lag at the largest power of the run.
    """
    back_s = draw.log_uniform(0.05, 0.4)

    def lags(run: Run, size: float):
        speed = run.rates(run.q_cmd)
        power = np.abs(np.sum(speed * run.rates(speed), axis=1)) + 0.3 * np.sum(speed**2, axis=1)
        sag = memory.lag(power / max(power.max(), 1e-12), np.full(len(power), back_s), STEP_s)
        run.lag_s += size * sag[:, None]

    return None, acting(lags, lag_s=SIZE, back_s=back_s)


@declare(
    UNKNOWN, "joint", 1e-5, 0.5, signal="any", all_runs=True, depends=joint_("smooth", "own_angle", "place")
)
def tooth_chipped(draw: Draw):
    """A tooth of a gear's last wheel is chipped: the joint kicks each time that this tooth carries.

    A cycloidal or planetary last stage has 40 to 120 teeth a turn; the one that is chipped gives way for a
    third of its pitch, always at the same angle of the joint.

    `size` in degrees in the middle of the tooth, which lies somewhere in the work.
    """
    name, j = draw.joint()
    teeth, sign = draw.uniform(120.0, 360.0), draw.sign()
    place = draw.rng.uniform([[40.0, -30.0, -5.0]], [[120.0, 30.0, 5.0]])
    spot = float(joints_for(World(), place)[0, j])

    def gear(run: Run, size: float):
        off = (run.q_act[:, j] - spot) / (2.0 * np.pi / teeth / 3.0)
        run.q_load[:, j] += sign * size * DEGREE * np.exp(-0.5 * off**2)

    return name, acting(gear, deg=SIZE, at_deg=spot / DEGREE, teeth=teeth)
