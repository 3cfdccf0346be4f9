"""What effects say they depend on is what they do: deviations are regressed on the inputs that are declared.

Each input is a few functions of the motion, written here without looking at any effect; inputs declared
together may also multiply one another. What an effect does to its signal must be a combination of them, and
that of a foreign input must not be.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from gcode2krl import load_cell
from gcode2krl.effects import Applied, Dependence, Where, simulate
from gcode2krl.effects.operators import play, since_reversal
from gcode2krl.frames import rotation_from_quaternion
from tests.effects import KNOWN

CELL = load_cell()
D = Dependence
LEAST = 0.95
"""Share of the deviation's power that declared inputs explain."""
NOT_HERE = {
    "velocity_rule": "plans the motion anew: tests/gap/test_planning.py has its time law",
    "corner": "as velocity_rule",
    "advance_stop": "as velocity_rule",
    "override": "as velocity_rule",
    "other_program": "can be found, not predicted",
    "current_limit": "what is cut off is caught up later: test_joint_effects.py",
    "force_steps": "a sawtooth of the force: test_force_effects.py",
    "tool_number": "this cell has one tool",
    "fixture_compliance": "shows in the finished part, which has no time: test_tip_causes.py",
    # these remove the material again, which this made-up run has not
    "force_scale": "needs a part",
    "edge_force": "needs a part",
    "runout": "needs a part",
    "spindle_droop": "needs a part",
    "stock_offset": "needs a part",
    "tool_diameter": "needs a part",
    "swapped_tool": "needs a part",
}
CASES = [
    pytest.param(effect.at(target), target, id=f"{name} {target or ''}".strip())
    for name, effect in sorted(KNOWN.items())
    if name not in NOT_HERE
    for target in effect.targets(CELL)
    if target
    in {None, "tip", "A2", "A3", "A5", "all", "x", "tracker", "force", "q_load", "a1", "c3", "linked_arm"}
]


@pytest.fixture(scope="session")
def varied(swinging):
    """The free swing with a spindle that is switched twice and begins two hours after the first run."""
    t = swinging.time_s
    spindle = np.where(t < 3.0, 0.0, np.where(t < 11.0, 1200.0, 600.0))
    return replace(swinging, spindle_rad_s=spindle, hours=2.0)


def deviation(effect, target, inputs):
    """Return what an effect does (m, k) to the signal where it shows, and its joint."""
    values = effect.start(inputs, target)
    if effect.direction:
        values |= dict(zip(effect.direction, (0.48, 0.6, -0.64), strict=True))
    if effect.moment:
        values[effect.moment.name] = inputs.hours * 3600.0 + 7.0
    values |= {p.name: p.grid[0] for p in effect.parameters if p.role.value == "count"}
    signals, nominal = simulate(inputs, [Applied(effect, target, values)]), simulate(inputs)
    if effect.is_clock:
        where = {"tracker": "tcp_base_mm", "force": "force_meas_base_N", "q_load": "q_load_rad"}[target]
        return signals.seen(where) - getattr(nominal, where), None
    force = signals.force_meas_base_N - nominal.force_meas_base_N
    if Where.FORCE_AXIS in effect.where and force.any():
        return np.einsum("nji,nj->ni", inputs.sensor_rotation, force), joint_of(target)
    stages = [nominal.q_cmd_rad, signals.q_act_rad, signals.q_load_rad, signals.q_true_rad]
    if effect.is_misread:
        motor, gear = stages[1] - stages[0], stages[2] - stages[1]
        return motor if motor.any() else gear, joint_of(target)
    moved = (
        signals.q_true_rad - nominal.q_true_rad
        if signals.q_true_rad is not stages[0]
        else stages[1] - stages[0]
    )
    if Where.JOINT in effect.where and moved.any():
        return moved, joint_of(target)
    return signals.tcp_base_mm - nominal.tcp_base_mm, joint_of(target)


def at_tip(effect, target, y):
    """Tell whether the deviation is one of the tip."""
    return Where.TIP in effect.where and y.shape[1] == 3 and target != "force"


def joint_of(target):
    return int(target[1]) - 1 if target and target[0] == "A" else None


def powers(x, most):
    scaled = (x - x.mean(axis=0)) / max(float(np.abs(x - x.mean(axis=0)).max()), 1e-12)
    return np.column_stack([scaled**n for n in range(1, most + 1)])


def inputs_by_name(run, joint, y, at_tip):
    """Return the functions (m, f) of each admissible input."""
    t, q = run.time_s, run.q_cmd_rad
    own = q[:, [joint]] if joint is not None else q
    ones, seconds = np.ones((len(t), 1)), (t - t[0])[:, None]
    tip, turn = run.position_mm / 1000.0, rotation_from_quaternion(run.rotation).reshape(len(t), 9)
    pose = np.column_stack([powers(tip[:, [i]], 2) for i in range(3)] + [turn, turn[:, :6] * tip[:, [0]]])
    force = np.concatenate(
        [run.force_base_N, np.einsum("nji,nj->ni", run.tool_rotation, run.force_base_N)], axis=1
    )
    if joint is None and not at_tip:  # a sensor remembers
        sensed = np.einsum("nji,nj->ni", run.sensor_rotation, run.force_base_N)
        loops = [play(np.append(0.0, f), np.abs(f).max() / 2.0)[1:] for f in sensed.T]
        force = np.concatenate([force, sensed, np.stack(loops, axis=1)], axis=1)
    signal = tip if at_tip else np.concatenate([own, force], axis=1)
    reversals = []
    for column in own.T:
        sense, since = since_reversal(column, t)
        reversals += [sense] + [sense * np.exp(-since / tau) for tau in (0.02, 0.05, 0.1, 0.2)]
        reversals += [play(column, width) - column for width in np.radians((0.002, 0.005, 0.02))]
    process = np.einsum(
        "nij,ni->nj", run.jacobian, np.concatenate([run.force_base_N, run.moment_base_Nmm], axis=1)
    )
    torques = np.concatenate([process / 1000.0, run.own_torque_Nm], axis=1)
    if joint is not None:
        torques = torques[:, [joint, 6 + joint]]
    size = np.abs(torques).max(axis=0)
    torque = [torques, *(np.tanh(torques / (share * size)) for share in (0.1, 0.3, 1.0))]
    torque += [np.stack([play(c, s / 2.0) for c, s in zip(torques.T, size, strict=True)], axis=1)]
    ratio = np.array(CELL.robot.drives.gear_ratio) * q
    motor = ratio[:, [joint]] if joint is not None else ratio
    krpm = run.spindle_rad_s / 100.0
    warm = [np.convolve(krpm, np.exp(-seconds[:, 0] / tau))[: len(t)] for tau in (3.0, 60.0, 600.0)]
    jerk = np.gradient(np.gradient(np.gradient(signal, t, axis=0), t, axis=0), t, axis=0)
    jerk[:3], jerk[-3:] = jerk[3], jerk[-4]  # one-sided differences are no jerk
    cut_m = np.cumsum(np.diff(run.path_mm, prepend=run.path_mm[:1]) * run.force_base_N.any(axis=1))
    return {
        D.CONSTANT: ones,
        D.RUN_TIME: powers(seconds, 3),
        D.RUN_TIME_STEP: (t[:, None] > np.arange(0.5, t[-1], 0.5)).astype(float),
        # hats about the moment at which `deviation` lets things happen
        D.EVENT: np.clip(1.0 - np.abs(t[:, None] - np.arange(6.7, 7.5, 0.024)) / 0.024, 0.0, None),
        D.RUN_START: np.exp(-seconds / np.array([1.0, 10.0, 60.0])),
        D.WALL_CLOCK: np.concatenate([ones, run.run_hours[:, None], run.run_hours[:, None] ** 2], axis=1),
        D.OWN_ANGLE: np.concatenate([ones, *(powers(column[:, None], 4) for column in own.T)], axis=1),
        D.MOTOR_ANGLE: np.concatenate([f(n * motor) for n in (1, 2, 3) for f in (np.sin, np.cos)], axis=1),
        D.REVERSALS: np.stack(reversals, axis=1),
        D.OWN_TORQUE: np.concatenate(torque, axis=1),
        D.VELOCITY: np.gradient(signal, t, axis=0),
        D.ACCELERATION: np.gradient(np.gradient(signal, t, axis=0), t, axis=0),
        D.JERK: jerk,
        D.FORCE: force,
        D.FORCE_BY_PLACE: np.concatenate([force[:, :3]] + [force[:, [i]] * pose for i in range(3)], axis=1),
        D.METRES_CUT: cut_m[:, None],
        D.TRAVEL: powers(run.path_mm[:, None], 4),
        D.PLACE: np.concatenate([ones, pose], axis=1),
        D.SPINDLE_SPEED: np.stack([krpm, *warm], axis=1),
        # what rings at one frequency is its own second derivative
        D.TONE: np.gradient(np.gradient(y, t, axis=0), t, axis=0),
    }


def explained(y, features):
    """Return the share of the power of (m, k) that a linear combination of features (m, f) takes."""
    scaled = features / np.maximum(np.linalg.norm(features, axis=0), 1e-12)
    u, s, _ = np.linalg.svd(scaled, full_matrices=False)
    u = u[:, s > 1e-9 * s[0]]
    return 1.0 - np.sum((y - u @ (u.T @ y)) ** 2) / np.sum(y**2)


def declared(effect, known):
    """Return the functions of what an effect declares, and products of two of them where these are few."""
    parts = [known[each] for each in sorted(effect.depends_on, key=lambda each: each.name) if each in known]
    products = [
        (a[:, :, None] * b[:, None, :]).reshape(len(a), -1)
        for a, b in combinations(parts, 2)
        if a.shape[1] * b.shape[1] < 100
    ]
    return np.concatenate([*parts, *products], axis=1)


@pytest.mark.parametrize(("effect", "target"), CASES)
def test_an_effect_is_a_function_of_what_it_declares(varied, effect, target):
    y, joint = deviation(effect, target, varied)
    assert y.any()
    known = inputs_by_name(varied, joint, y, at_tip(effect, target, y))
    features = declared(effect, known)
    assert features.shape[1] < len(y) / 5
    assert explained(y, features) > LEAST


FOREIGN = [
    ("thermal", None, D.REVERSALS),
    ("step", "tip", D.FORCE),
    ("step", "A3", D.REVERSALS),
    ("backlash", "A2", D.OWN_TORQUE),
    ("friction", "A2", D.PLACE),
    ("transmission", "A2", D.OWN_ANGLE),
    ("encoder_interpolation", "A2", D.OWN_ANGLE),
    ("servo_lag", "A2", D.OWN_ANGLE),
    ("gear_twist", "A2", D.REVERSALS),
    ("stiffness", "A3", D.TRAVEL),
    ("cutter_bending", None, D.TRAVEL),
    ("spindle_growth", None, D.FORCE),
    ("hysteresis", "A2", D.REVERSALS),
    ("link_length", "a1", D.FORCE),
    ("tool_wear", None, D.TRAVEL),
    ("cable_pull", "A2", D.RUN_START),
    ("dead_time", "all", D.FORCE),
    ("servo_gain", "A2", D.OWN_ANGLE),
    ("jerk_feed_forward", "A2", D.FORCE),
    ("tracker_filter", None, D.FORCE),
    ("collision", None, D.FORCE),
    ("force_hysteresis", None, D.TRAVEL),
    ("floor_vibration", "x", D.ACCELERATION),
    ("bolt_ratchet", "tip", D.VELOCITY),
    ("axis_coupling", None, D.REVERSALS),
    ("belt_wind_up", "A5", D.VELOCITY),
    ("bearing_wobble", "A2", D.FORCE),
]


@pytest.mark.parametrize(("name", "target", "foreign"), FOREIGN)
def test_an_effect_is_no_function_of_something_else(varied, name, target, foreign):
    effect = KNOWN[name].at(target)
    assert foreign not in effect.depends_on
    y, joint = deviation(effect, target, varied)
    known = inputs_by_name(varied, joint, y, at_tip(effect, target, y))
    assert explained(y - y.mean(axis=0), known[foreign] - known[foreign].mean(axis=0)) < 0.8


def test_what_is_left_out_has_a_reason_and_inputs_of_one_plain_motion_are_known(varied):
    assert set(NOT_HERE) <= set(KNOWN)
    missing = set(Dependence) - set(inputs_by_name(varied, 0, varied.q_cmd_rad, False))
    assert missing == {
        D.TEMPERATURE,
        D.RUN_TO_RUN,
        D.CORNERS,
        D.STOPS,
    }  # a plan with corners: tests/gap/test_corners.py


def test_a_play_sees_where_it_turned_and_not_how_fast(swinging):
    """The same way in half the time has the same deviation, sample by sample; that of a lag doubles."""
    quick = replace(swinging, time_s=swinging.time_s / 2.0)
    for name, factor in (
        ("backlash", 1.0),
        ("servo_lag", 2.0),
        ("transmission", 1.0),
        ("joint_eccentricity", 1.0),
    ):
        effect = KNOWN[name]
        values = effect.start(swinging, "A2") | ({"tau_s": 1e-4} if name == "servo_lag" else {})
        slow_y, quick_y = (
            simulate(run, [Applied(effect, "A2", values)]).q_load_rad - run.q_cmd_rad
            for run in (swinging, quick)
        )
        assert np.abs(slow_y).max() > 0.0
        np.testing.assert_allclose(quick_y, factor * slow_y, atol=2e-3 * np.abs(slow_y).max(), err_msg=name)
