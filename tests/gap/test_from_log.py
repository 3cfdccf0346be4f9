"""Logs alone, without a prediction."""

from dataclasses import replace

import pytest

from gcode2krl.gap import diagnose_log
from gcode2krl.runs import RunHead
from tests.gap.synthetic import applied, prediction, runs

pytestmark = pytest.mark.slow

SERVO = {"tracker": False, "force": False}


def test_a_lag_is_found_from_the_log_alone():
    gap = diagnose_log(runs(applied("servo_lag:target=A3,tau_s=0.012"), 2, 5, **SERVO))
    assert [(each.effect, each.target) for each in gap.named_causes] == [("servo_lag", "A3")]
    missing = {each.link for each in gap.not_examined}
    assert {"timing", "path", "force", "mechanics"} <= missing


def test_backlash_is_found_between_the_encoders():
    some = runs(applied("backlash:target=A2,gap_deg=0.01"), 2, 5, load_encoders=True, **SERVO)
    gap = diagnose_log(some)
    assert [(each.effect, each.target) for each in gap.named_causes] == [("backlash", "A2")]


def test_a_known_robot_adds_the_mechanics():
    some = runs(applied("mastering:target=A2,offset_deg=0.05"), 2, 5, force=False)
    gap = diagnose_log(some, prediction().cell)
    assert "mechanics" in {each.link for each in gap.links}


def test_relative_angles_have_no_kinematics():
    some = [
        replace(run, head=RunHead(angles="relative"))
        for run in runs([], 2, 5, load_encoders=True, force=False)
    ]
    gap = diagnose_log(some, prediction().cell)
    assert gap.verdict == "no_gap"
    assert "mechanics" in {each.link for each in gap.not_examined}
