"""Load encoders on some joints must not hide what the gears of the others do."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.effects import Applied, library, simulate
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap import diagnose_log
from gcode2krl.gap.compare.trace import Context, unmeasured_at
from gcode2krl.gap.components import Signatures
from gcode2krl.gap.noise.nuisance import nuisance_of
from gcode2krl.gap.posterior.examination import question_of
from gcode2krl.runs import Run, RunHead, Tracker
from tests.gap.constructed import LINK, cell, controller, joints, motion, noise, table, trace

LIBRARY = library()

JOINTS = {"gear": frozenset({"A1", "A2", "A3"})}
EVERY = frozenset({"path", "servo", "gear", "mechanics"})


@pytest.mark.parametrize(("target", "link"), [("A2", "gear"), ("A4", "mechanics")])
def test_a_play_shows_where_its_joint_is_measured(target, link):
    context = Context((), 0, LIBRARY, Mismatch(), examined=EVERY, joints=JOINTS)
    play = LIBRARY["backlash"]
    assert play.visible_links(context.examined_at(play, target), target) == {link}


def test_a_clock_of_the_encoders_is_theirs_and_the_wrists_coupling_is_not():
    assert unmeasured_at(LIBRARY["clock"], "q_load", JOINTS) == frozenset()
    assert unmeasured_at(LIBRARY["wrist_coupling"], None, JOINTS) == {"gear"}
    assert unmeasured_at(LIBRARY["wrist_coupling"], None, {"gear": frozenset({"A5", "A6"})}) == frozenset()


def test_usual_play_of_joints_without_an_encoder_moves_the_tip():
    tip = trace(np.zeros((500, 3)), "mechanics")
    found = nuisance_of(tip, LIBRARY, Mismatch(), Signatures(), frozenset(), joints=JOINTS)
    plays = {each.name for each in found if each.name.startswith("backlash") and not each.bent}
    assert plays == {"backlash A4", "backlash A5", "backlash A6"}


def test_a_joint_without_an_encoder_keeps_its_models_gear():
    """Measured where there is an encoder, simulated on the motor side where there is none."""
    inputs = motion()
    actual = inputs.q_cmd_rad + 1e-3
    load = actual + 1e-4
    load[:, 3:] = np.nan
    seen = replace(inputs, q_act_rad=actual, q_load_rad=load)
    play = Applied(LIBRARY["backlash"], "A4", {"gap_deg": 0.1})
    true = simulate(seen, [play]).q_true_rad
    np.testing.assert_array_equal(true[:, :3], load[:, :3])
    np.testing.assert_array_equal(true[:, 4:], actual[:, 4:])
    assert np.ptp(true[:, 3] - actual[:, 3]) == pytest.approx(np.radians(0.1), rel=1e-6)


def test_a_question_to_the_tip_asks_for_gears_without_encoders():
    tip = trace(np.zeros((500, 3)), "mechanics")
    context = Context((), 0, LIBRARY, Mismatch(), examined=EVERY, joints=JOINTS)
    asked = {block.key for block in question_of(LINK["mechanics"], [tip], context).blocks}
    plays = {target for name, target in asked if name == "backlash"}
    assert plays == {"A4", "A5", "A6"}


def logged(number, gap_deg, encoders):
    """Return a log of a robot whose A4 has a play, with load encoders on the first joints only."""
    time_s = np.arange(0.0, 10.0, 0.02)
    q = joints(time_s)
    true = np.array(q)
    true[:, 3] = played(q[:, 3], np.radians(gap_deg) / 2.0)
    tip, _ = robot.forward(true, cell(), 1)
    load = true + noise(500, 10 + number, 3e-6, 6)
    load[:, encoders:] = np.nan
    log = controller(time_s, q_cmd_rad=q, q_act_rad=q + noise(500, 20 + number, 3e-6, 6))
    tracker = table(Tracker, time_s, position_mm=tip + noise(500, 30 + number, 0.01, 3))
    if encoders:
        log = replace(log, q_load_rad=load)
    return Run(f"run-{number}", Path(f"run-{number}"), RunHead(), log, tracker)


def played(values, half_width):
    """Return a play, sample by sample."""
    follower = np.empty_like(values)
    at = values[0]
    for row, value in enumerate(values):
        at = min(max(at, value - half_width), value + half_width)
        follower[row] = at
    return follower


@pytest.mark.slow
@pytest.mark.parametrize("encoders", [0, 3])
def test_a_play_of_a4_is_found_with_and_without_load_encoders_elsewhere(encoders):
    gap = diagnose_log([logged(number, 0.08, encoders) for number in range(2)], cell())
    (cause,) = gap.named_causes
    assert (cause.effect, cause.target, cause.link) == ("backlash", "A4", "mechanics")
    assert cause.parameters["gap_deg"].value == pytest.approx(0.08, rel=0.05)
