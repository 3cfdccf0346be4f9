"""The gap at the part: millimetres whatever signal shows it best, seconds for clocks, newtons at last."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl.gap.answer.evidence import Residual
from gcode2krl.gap.answer.where import at_part, at_part_of, run_sizes
from gcode2krl.gap.compare.links import FORCE, GEAR, MECHANICS, PART, PATH, SERVO
from gcode2krl.gap.compare.slips import Slip
from gcode2krl.gap.posterior.examination import Size
from gcode2krl.gap.posterior.judgement import Cause, Judged, Judgement
from tests.gap.constructed import motion, trace
from tests.gap.synthetic import applied

SIZE = Size(100, 4.0, 1.0, 0.25, 0.25, 0.0, 1.0, 1.0, 5.0, 2.0)


def judged(link, *texts, probability=0.9, traces=()):
    causes = tuple(
        Cause(each, link.name, probability, {}, 0.9, 0.1) for text in texts for each in applied(text)
    )
    return Judgement(
        link=link,
        verdict="explained",
        causes=causes,
        size=SIZE,
        held_out=True,
        factor=10.0,
        traces=traces,
        examination=SimpleNamespace(),
    )


def bent(joint, rad, link="gear"):
    """Return the residual of a joint that is off by an angle all the time."""
    values = np.zeros((500, 6))
    values[:, joint] = rad
    one = trace(values, link, inputs=motion())
    return Residual(trace=one, before=values, after=values, shape=values, noise=np.full(6, 1e-5))


def test_a_gap_behind_a_gear_is_what_it_is_at_the_tip():
    gear = judged(GEAR, "backlash:target=A2,gap_deg=0.02")
    found = at_part([gear], {GEAR: [bent(1, 1e-3)]}, None)
    arm_mm = np.linalg.norm(motion().jacobian[:, :3, 1], axis=1)
    assert (found.what, found.unit, found.link, found.noise) == ("tip", "mm", "gear", None)
    assert found.rms_before == pytest.approx(1e-3 * np.sqrt(np.mean(arm_mm**2)))
    # 1 - (1 - .25) / (4 - .25) of the power is gone
    assert found.rms_after == pytest.approx(found.rms_before * np.sqrt(0.2))


def test_the_tip_itself_is_as_it_was_measured_and_forces_come_after_it():
    tip, force = judged(MECHANICS), judged(FORCE)
    found = at_part([force, tip], {}, None)
    assert (found.what, found.rms_before, found.rms_after, found.noise) == ("tip", 20.0, 10.0, 5.0)
    alone = at_part([force], {}, None)
    assert (alone.what, alone.unit, alone.rms_before) == ("force", "N", 20.0)
    assert at_part([], {}, None) is None


def test_of_two_gaps_in_mm_the_larger_is_said():
    gear, servo = judged(GEAR), judged(SERVO)
    residuals = {GEAR: [bent(1, 1e-4)], SERVO: [bent(1, 2e-4, "servo")]}
    assert at_part([gear, servo], residuals, None).link == "servo"


def test_clocks_are_seconds_and_nothing_is_off_in_space():
    clock = judged(GEAR, "clock:target=q_load,offset_s=-0.003,skew=0")
    found = at_part([clock], {GEAR: [bent(1, 1e-3)]}, None)
    assert (found.what, found.unit, found.link) == ("time", "s", "gear")
    assert found.rms_before == pytest.approx(0.003)
    assert at_part([clock, judged(MECHANICS)], {}, None).what == "tip"


def test_a_late_path_is_seconds():
    one = trace(np.zeros((500, 6)), "path", inputs=motion())
    late = trace(-0.05 * one.rate, "path", inputs=motion())
    path = judged(PATH, traces=(late,))
    found = at_part([path], {}, path)
    assert (found.what, found.link) == ("time", "timing")
    assert found.rms_before == pytest.approx(0.05, rel=1e-3)


def test_a_scan_is_the_part_and_joints_of_an_unknown_robot_stay_joints():
    part = Judged(link=PART, verdict="explained", causes=(), size=SIZE, held_out=True, factor=1.0)
    assert at_part([part], {}, None).what == "part"
    one = bent(1, 1e-3)
    nowhere = replace(one, trace=replace(one.trace, inputs=replace(motion(), position_mm=np.zeros((500, 3)))))
    assert at_part([judged(GEAR)], {GEAR: [nowhere]}, None).what == "joints"
    assert at_part([judged(GEAR)], {GEAR: [one]}, None).what == "tip"


def tip(run, mm, number=0):
    """Return the residual of a tip that is off by a length all the time, and half of it with the causes."""
    values = np.tile([0.0, mm, 0.0], (500, 1))
    one = replace(trace(values, "mechanics", number), run=run)
    return Residual(trace=one, before=values, after=values / 2.0, shape=values, noise=np.full(3, 1e-2))


def test_the_size_is_that_of_all_runs_and_each_run_is_told():
    off = [tip("run-1", 1.0), tip("run-2", 3.0, 1)]
    one = judged(MECHANICS, traces=(off[0].trace,))
    found = at_part([one], {MECHANICS: off}, None)
    assert found.rms_before == pytest.approx(10.0 * np.sqrt(5.0))
    assert (found.held_out_before, found.rms_after) == (20.0, 10.0)
    assert found.per_run == run_sizes(one, off)
    assert [(each.run, each.rms_before, each.rms_after, each.held_out) for each in found.per_run] == [
        ("run-1", pytest.approx(10.0), pytest.approx(5.0), False),
        ("run-2", pytest.approx(30.0), pytest.approx(15.0), True),
    ]


def test_a_gap_in_joints_is_told_at_the_tip_in_each_run_and_one_of_timing_in_seconds():
    gear = judged(GEAR)
    (run,) = at_part([gear], {GEAR: [bent(1, 1e-3)]}, None).per_run
    assert run.rms_before == pytest.approx(at_part([gear], {GEAR: [bent(1, 1e-3)]}, None).rms_before)
    assert run.rms_after is None
    one = trace(np.zeros((500, 6)), "path", inputs=motion())
    late = [
        trace(-late_s * one.rate, "path", number, inputs=motion())
        for number, late_s in enumerate((0.05, 0.1))
    ]
    path = judged(PATH, traces=(late[0],))
    path = replace(path, every=tuple(late))
    told = at_part([path], {}, path)
    assert [(each.rms_before, each.held_out) for each in told.per_run] == [
        (pytest.approx(0.05, rel=1e-3), False),
        (pytest.approx(0.1, rel=1e-3), True),
    ]
    assert told.rms_before == pytest.approx(np.sqrt((0.05**2 + 0.1**2) / 2.0), rel=1e-3)


def test_slips():
    slip = Slip(applied("override:percent=50")[0], MECHANICS, 2.0, 0.1, "mm", "shown")
    found = at_part_of(slip)
    assert (found.what, found.rms_before, found.rms_after) == ("tip", 2.0, 0.1)
    assert at_part_of(Slip(slip.applied, PATH, 2.0, 0.1, "deg", "shown")) is None
