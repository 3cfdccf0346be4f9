"""Load encoders on some joints must not hide what the gears of the others do."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Applied, simulate
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap import diagnose
from gcode2krl.gap.beside.context import Context, unmeasured_at
from gcode2krl.gap.choose.candidates import question_of
from gcode2krl.gap.fit.nuisance import nuisance_of
from gcode2krl.gap.fit.signatures import Signatures
from tests.gap.constructed import LINK, motion, trace
from tests.gap.synthetic import LIBRARY, applied, prediction, runs

JOINTS = {"gear": frozenset({"A1", "A2", "A3"})}
EVERY = frozenset({"path", "servo", "gear", "mechanics"})


def with_encoders(run, joints):
    """Return a run whose load encoders stand on the first joints only."""
    load = np.array(run.controller.q_load_rad)
    load[:, joints:] = np.nan
    return replace(run, controller=replace(run.controller, q_load_rad=load))


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
    plays = {each.name for each in found if each.name.startswith("backlash")}
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


@pytest.mark.slow
@pytest.mark.parametrize("encoders", [0, 3])
def test_a_play_of_a5_is_found_with_and_without_load_encoders_elsewhere(encoders):
    some = runs(applied("backlash:target=A5,gap_deg=0.1"), 2, 5, load_encoders=True)
    gap = diagnose(prediction(), [with_encoders(run, encoders) for run in some])
    (cause,) = gap.named_causes
    assert (cause.effect, cause.target, cause.link) == ("backlash", "A5", "mechanics")
    assert cause.parameters["gap_deg"].value == pytest.approx(0.1, rel=0.05)
