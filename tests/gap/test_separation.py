"""Distances between answers in canned programs, beside what geometry says of them."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.canned.trial import trials_of
from gcode2krl.effects import Applied, library, simulate
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.components import blocks_of
from gcode2krl.gap.noise.nuisance import Question
from gcode2krl.gap.posterior.least_squares import free_of
from gcode2krl.gap.posterior.likelihood import refit
from gcode2krl.gap.posterior.next_run import Bench, allowed_by, information_of
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.constructed import cell, examined, noise, trace

KNOWN = library()
SIGMA_MM = 0.02
ALONG_X = {"direction_x": 1.0, "direction_y": 0.0, "direction_z": 0.0}
TRIALS = {trial.name: trial for trial in trials_of(cell())}
MANY, FEW = 2.0 * np.log(100.0), 2.0 * np.log(3.0)
"""Squared distances of odds of 100 and of 3."""


def at(name, target=None, **values):
    effect = KNOWN[name]
    inputs = TRIALS["sync"].inputs
    return Applied(effect, target, effect.nominal(inputs, target) | values)


@functools.cache
def measured(name, target, values, hours=0.0):
    """What a run at one place and one orientation says of an effect that was there."""
    true = at(name, target, **dict(values))
    inputs = replace(TRIALS["sync"].inputs, hours=hours)
    off = simulate(inputs, [true]).tcp_base_mm - simulate(inputs, []).tcp_base_mm
    made = trace(off + noise(len(inputs), 7, SIGMA_MM, 3), "mechanics", inputs=inputs)
    question = Question({}, list(blocks_of(true.effect, target)), Mismatch(), frozenset())
    found = examined([made], question, SIGMA_MM)
    assert [(each.effect.name, each.target) for each in found.applied] == [(name, target)]
    return found


def apart(program, found, rival):
    """The squared distance of what was found and a rival, fitted to the same run, in a program."""
    second = refit(found.likelihood, (rival,)).applied[0]
    bench = Bench(found, TRIALS[program].inputs, Mismatch())
    return between(bench, found.applied[:1], (second,), information_of(found, 0, (second,)))


def between(bench, first, second, information=None):
    """What sets two answers apart in a program."""
    return bench.between(bench.foretold(first), bench.foretold(second, information))


def test_an_angle_of_axis_1_is_a_turn_of_the_base_wherever_the_arm_goes():
    """Axis 1 is fixed in the base: no motion tells its zero from a frame that turns about it."""
    found = measured("mastering", "A1", (("offset_deg", 0.03),))
    for program in TRIALS:
        assert apart(program, found, at("base_frame", c_deg=0.0, a_deg=0.01)).distance2 < FEW, program


def test_an_angle_of_a_later_axis_is_told_from_the_base_by_turning_the_tool():
    found = measured("mastering", "A5", (("offset_deg", 0.05),))
    rival = at("base_frame", x_mm=0.1)
    assert apart("orientation", found, rival).distance2 > MANY
    assert apart("orientation", found, rival).distance2 > 5.0 * apart("sync", found, rival).distance2


def test_the_tool_is_told_from_the_base_by_turning_it_and_by_nothing_at_one_orientation():
    found = measured("tool_frame", None, (("x_mm", 0.3), ("y_mm", 0.2)))
    rival = at("base_frame", x_mm=0.1)
    assert apart("orientation", found, rival).distance2 > MANY
    for program in ("circle", "sync", "dwell", "reversals"):
        assert apart(program, found, rival).distance2 < FEW, program


def test_warming_up_is_told_from_a_step_by_waiting():
    found = measured("base_frame", None, (("x_mm", 0.118),), hours=0.5)  # a step that has happened
    step, warming = found.applied[0], at("thermal", mm_per_h=0.3, time_constant_h=1.0, **ALONG_X)
    for name, parted in (("dwell", True), ("sync", False)):
        bench = Bench(found, replace(TRIALS[name].inputs, hours=0.51), Mismatch())
        distance2 = between(bench, (warming,), (step,), information_of(found, 0, (step,))).distance2
        assert distance2 > MANY if parted else distance2 < FEW
    dwell = Bench(found, TRIALS["dwell"].inputs, Mismatch())
    shown = between(dwell, (warming,), ())
    hours = TRIALS["dwell"].inputs.time_s[-1] / 3600.0
    grown = 0.3 * (1.0 - np.exp(-hours))
    assert shown.component == "x"
    assert shown.is_change
    assert shown.first == pytest.approx(grown, rel=0.02)
    assert shown.second == 0.0


@pytest.mark.parametrize("program", ["single-joint", "reversals"])
def test_play_of_one_joint_is_told_from_that_of_another(program):
    found = measured("backlash", "A1", (("gap_deg", 0.02),))
    bench = Bench(found, TRIALS[program].inputs, Mismatch())
    assert between(bench, found.applied[:1], (at("backlash", "A4", gap_deg=0.02),)).distance2 > MANY


def test_what_is_the_same_is_not_apart_and_what_grows_is_farther():
    found = measured("backlash", "A1", (("gap_deg", 0.02),))
    bench = Bench(found, TRIALS["single-joint"].inputs, Mismatch())
    assert between(bench, found.applied[:1], found.applied[:1]).distance2 < 1e-6
    small, large = (between(bench, (at("backlash", "A2", gap_deg=g),), ()).distance2 for g in (0.005, 0.01))
    assert large > 2.0 * small > 0.0


def test_what_the_runs_say_binds_the_rival():
    found = measured("tool_frame", None, (("x_mm", 0.3),))
    bench = Bench(found, TRIALS["orientation"].inputs, Mismatch())
    rival = refit(found.likelihood, (at("mastering", "A6", offset_deg=0.01),)).applied[0]
    free = between(bench, found.applied[:1], (rival,)).distance2
    bound = between(bench, found.applied[:1], (rival,), information_of(found, 0, (rival,))).distance2
    assert bound >= free - 1e-6


def test_an_answer_is_moved_where_the_runs_have_shown_it_least():
    found = measured("tool_frame", None, (("x_mm", 0.3), ("y_mm", 0.2)))
    own = found.applied[0]
    information = information_of(found, 0, (own,))
    known = np.diag(information)
    drawn = [each for (each,) in allowed_by(information, (own,), found.traces[0])]
    assert len(drawn) == 2 * THRESHOLDS.posterior.widest_ways
    names = free_of(own, found.traces[0]).names
    moved = [max(abs(each[name] - own[name]) for each in drawn) for name in names]
    most, least = names[int(np.argmin(known))], names[int(np.argmax(known))]
    assert moved[names.index(most)] > 10.0 * moved[names.index(least)]
    for each in drawn:
        for parameter in own.effect.parameters:
            assert parameter.low <= each[parameter.name] <= parameter.high


def test_nothing_is_moved_where_the_runs_cannot_show_it():
    found = measured("tool_frame", None, (("x_mm", 0.3), ("y_mm", 0.2)))
    assert allowed_by(None, found.applied[:1], found.traces[0]) == ()
