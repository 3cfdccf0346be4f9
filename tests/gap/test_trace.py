"""Traces: what an instrument would show, what is held out, and what is known while links are judged."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import robot
from gcode2krl.effects import Applied, library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.compare.links import MECHANICS, PATH, SERVO
from gcode2krl.gap.compare.trace import Context, Trace, folds_of
from gcode2krl.gap.components import Signatures, strongest_hz
from gcode2krl.gap.noise.nuisance import nuisance_of
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.posterior.examination import question_of
from gcode2krl.gap.posterior.likelihood import Likelihood
from tests.gap.constructed import Added, applied, joint_rates, joints, motion, noise, pair, stub, trace, wave

# Traces: what an instrument would show, in its frame, on its clock, with effects at work

LIBRARY = library()
INPUTS = motion()
TIME_S = INPUTS.time_s
INSIDE = slice(10, -10)


@pytest.fixture(scope="module")
def pushed():
    """The motion with a force that turns in space."""
    force = np.stack([100 * np.cos(TIME_S), 80 * np.sin(TIME_S), 30 + 0 * TIME_S], axis=1)
    return replace(INPUTS, force_base_N=force)


def test_the_nominal_tip_is_that_of_forward_kinematics():
    one = trace(np.zeros((500, 3)), "mechanics", time_s=TIME_S + 0.004)
    tip, _ = robot.forward(joints(TIME_S + 0.004), INPUTS.cell, 1)
    np.testing.assert_allclose(one.nominal[INSIDE], tip[INSIDE], atol=1e-3)
    assert not one.residual.any()


def test_a_force_is_turned_into_the_axes_of_its_instrument(pushed):
    one = trace(np.zeros((500, 3)), "force", inputs=pushed)
    _, quaternion = robot.forward(INPUTS.q_cmd_rad, INPUTS.cell, 1)
    tool = Rotation.from_quat(quaternion)
    flange = tool * Rotation.from_matrix(INPUTS.cell.tool_matrix(1)[:3, :3]).inv()
    np.testing.assert_allclose(one.nominal, pushed.force_base_N, atol=1e-12)
    in_tool = replace(one, frame="tcp").nominal
    np.testing.assert_allclose(in_tool, tool.inv().apply(pushed.force_base_N), atol=1e-9)
    in_sensor = replace(one, frame="sensor").nominal
    np.testing.assert_allclose(in_sensor, flange.inv().apply(pushed.force_base_N), atol=1e-9)
    assert not np.allclose(in_tool, in_sensor)


def test_a_difference_of_two_sides_has_the_recorded_columns():
    one = replace(trace(np.zeros((500, 2)), "servo"), columns=(0, 3))
    effect = wave(1.0)
    found = one.sample([applied(effect, 0.02)])
    np.testing.assert_allclose(found[:, 0], 0.02 * effect.form(TIME_S), atol=1e-12)
    assert not found[:, 1].any()


def test_what_was_found_before_is_part_of_the_model():
    first, second = wave(1.0), wave(2.0)
    one = replace(trace(np.zeros((500, 1))), base=(applied(first, 0.01),))
    np.testing.assert_allclose(one.nominal[:, 0], 0.01 * first.form(TIME_S), atol=1e-12)
    both = 0.01 * first.form(TIME_S) + 0.03 * second.form(TIME_S)
    np.testing.assert_allclose(one.sample([applied(second, 0.03)])[:, 0], both, atol=1e-12)


def test_a_clock_shows_the_signal_as_it_was():
    """offset_s > 0: what is stamped t was true at t - offset."""
    one = trace(np.zeros((500, 6)), "path")
    late = Applied(LIBRARY["clock"], "controller", {"offset_s": 0.05, "skew": 0.0})
    np.testing.assert_allclose(one.sample([late])[INSIDE], joints(TIME_S - 0.05)[INSIDE], atol=1e-6)
    fast = Applied(LIBRARY["clock"], "controller", {"offset_s": 0.0, "skew": 1e-3})
    np.testing.assert_allclose(one.sample([fast])[INSIDE], joints(TIME_S / 1.001)[INSIDE], atol=1e-6)


def test_one_side_alone_may_be_late():
    one = replace(trace(np.zeros((500, 6)), "gear"), plus_late_s=0.02)
    expected = joints(TIME_S - 0.02) - joints(TIME_S)
    np.testing.assert_allclose(one.nominal[INSIDE], expected[INSIDE], atol=2e-6)


def test_rates_are_derivatives():
    path = trace(np.zeros((500, 6)), "path")
    np.testing.assert_allclose(path.rate[INSIDE], joint_rates(TIME_S)[INSIDE], atol=2e-4)
    assert (path.clock_rate == path.rate).all()
    gear = trace(np.zeros((500, 6)), "gear")
    assert not gear.rate.any()  # both sides move alike
    np.testing.assert_allclose(gear.clock_rate[INSIDE], joint_rates(TIME_S)[INSIDE], atol=2e-4)


def test_it_says_what_its_link_is():
    gear = trace(np.zeros((500, 2)), "gear")
    assert isinstance(gear, Trace)
    assert (gear.signal, gear.link.unit, gear.shape) == ("joint_load", "deg", (500, 2))
    tip = trace(np.zeros((500, 3)), "mechanics")
    assert (tip.signal, tip.link.unit) == ("tcp", "mm")


def test_late_commands_show_in_the_drives():
    """The model begins at the commands as they were stamped: the drives are then ahead of these."""
    nominal = trace(np.zeros((500, 6)), "servo")
    late = nominal.sample([Applied(library()["clock"], "q_cmd", {"offset_s": 0.012, "skew": 0.0})])
    ahead = replace(nominal, plus_late_s=-0.012).nominal
    np.testing.assert_allclose(late, ahead, atol=1e-12)
    assert np.abs(late).max() > 1e-3


# What is held out, and when nothing can be

COUNT, STEP_S = 2000, 0.01


def _part(number):
    return trace(np.zeros((COUNT, 1)), number=number, inputs=motion(COUNT * STEP_S, STEP_S))


def test_whole_runs_are_held_out_by_turns():
    traces = [_part(0), _part(1), _part(2)]
    pairs = folds_of(traces, [np.ones(COUNT)] * 3)
    assert [[trace.run for trace in held] for _, held in pairs] == [["run-1"], ["run-2"], ["run-3"]]
    assert all(held[0] not in kept for kept, held in pairs)


def test_where_one_run_has_the_power_its_quarters_are_held_out_with_guards():
    traces = [_part(0), _part(1)]
    pairs = folds_of(traces, [np.ones(COUNT), np.zeros(COUNT)])
    assert len(pairs) == 4
    for kept, held in pairs:
        first, last = held[0].time_s[[0, -1]]
        own = next(trace for trace in kept if trace.run_number == 0)
        away = np.minimum(np.abs(own.time_s - first), np.abs(own.time_s - last))
        assert away[(own.time_s < first) | (own.time_s > last)].min() > 1.0
        assert not np.any((own.time_s >= first) & (own.time_s <= last))


def test_what_happens_at_one_place_only_cannot_be_held_out():
    power = np.zeros(COUNT)
    power[1000:1080] = 1.0  # 0.8 s, within any guard
    assert folds_of([_part(0), _part(1)], [power, np.zeros(COUNT)]) == []
    power[300:380] = 1.0
    assert folds_of([_part(0), _part(1)], [power, np.zeros(COUNT)]) != []


# Rows at a kink of the path: where a clock is off by less than a sample they may be on either side of it

TURN_S, JUMP, SIGMA = 5.0, 0.2, 1e-6


def turning(rate_jump=JUMP):
    """Return inputs whose A2 turns back at once: its rate (rad/s) jumps by so much."""
    inputs = motion()
    q = inputs.q_cmd_rad.copy()
    q[:, 1] += 0.5 * rate_jump * np.abs(inputs.time_s - TURN_S)
    return replace(inputs, q_cmd_rad=q)


def test_a_kink_is_the_jump_of_the_rate_and_a_smooth_path_has_none():
    inputs = turning()
    own = trace(np.zeros((len(inputs.time_s), 6)), inputs=inputs)
    at = np.argmin(np.abs(own.time_s - TURN_S))
    assert own.kinks[at, 1] == pytest.approx(JUMP, rel=0.05)
    far = np.abs(own.time_s - TURN_S) > 0.1
    assert own.kinks[far].max() < 0.01 * JUMP
    assert own.kinks[:, 0].max() < 0.01 * JUMP


def test_a_row_beside_a_kink_counts_by_what_the_clock_is_sure_of():
    inputs = turning()
    own = trace(np.zeros((len(inputs.time_s), 6)), inputs=inputs)
    parts = nuisance_of(own, {}, Mismatch(), Signatures(), frozenset())
    data = Likelihood([own], [parts], [white(SIGMA)] * 6)
    late_s = 5e-4  # within the clock's bound: the lateness of a path that turns, less its rate times that
    q = np.interp(own.time_s - late_s, inputs.time_s, inputs.q_cmd_rad[:, 1]) - inputs.q_cmd_rad[:, 1]
    missed = q + late_s * np.gradient(inputs.q_cmd_rad[:, 1], inputs.time_s)
    assert np.abs(missed).max() > 20.0 * SIGMA
    white_ = data.white(0, 1, missed[:, None])
    assert np.abs(white_).max() < 3.0


# What is known while links are judged: each step is a new context and leaves the old one as it was


def context(known=LIBRARY, **more):
    return Context((pair(), pair(number=1)), 2, known, Mismatch(), **more)


class Twice(Added):
    """Plans everything at half the speed."""

    needs = frozenset({"plan"})

    def replan(self, inputs, applied):
        return replace(inputs, time_s=inputs.time_s * 2.0)


def test_it_is_frozen():
    with pytest.raises(FrozenInstanceError):
        context().slips = ()


def test_excluded_effects_are_no_candidates_and_known_all_the_same():
    found = context(exclude=frozenset({"backlash"}))
    assert "backlash" not in found.offered
    assert "backlash" in found.known
    assert "backlash" not in {effect.name for effect in found.candidates()}


def test_beside_a_slip_no_other_slip_is_tried_nor_a_new_plan_beside_stops():
    slip = Applied(LIBRARY["override"], None, {"percent": 50.0})
    assert any(effect.kind == "slip" for effect in context().candidates())
    assert not any(effect.kind == "slip" for effect in context(slips=(slip,)).candidates())
    assert any(effect.plans_anew for effect in context().candidates())
    assert not any(effect.plans_anew for effect in context(stopped=True).candidates())


def test_what_changes_the_plan_is_planned_into_every_pair():
    before = context()
    after = before.with_slip(applied(Twice("twice", np.sin), 1.0))
    for one in after.pairs:
        np.testing.assert_array_equal(one.inputs.time_s, 2.0 * motion().time_s)
    assert after.slips == ()  # all that it does is in the plan
    assert (before.pairs[0].inputs.time_s == motion().time_s).all()


def test_another_slip_is_in_the_model_of_every_link_and_its_plan_made():
    slip = Applied(LIBRARY["base_number"], None, dict.fromkeys(LIBRARY["base_number"].names, 0.0))
    (kept,) = context().with_slip(slip).slips
    assert (kept.effect, kept.values, kept.planned) == (slip.effect, slip.values, True)


def test_the_timing_is_judged_by_the_link_that_tells_time():
    path, servo = stub(link=PATH, verdict="explained"), stub(link=SERVO, verdict="no_gap")
    assert context().timing is None
    assert context().with_judgement(servo).timing is None
    assert context().with_judgement(path).with_judgement(servo).timing is path


def test_a_cause_is_taken_off_the_one_judgement():
    class Judged(type(stub())):
        def without(self, one):
            return stub(causes=tuple(cause for cause in self.causes if cause != one))

    first, second = Judged(link=PATH, causes=("a", "b")), Judged(link=SERVO, causes=("a",))
    before = context().with_judgement(first).with_judgement(second)
    after = before.without_cause(first, "a")
    assert [each.causes for each in after.judgements] == [("b",), ("a",)]
    assert before.judgements[0].causes == ("a", "b")


def test_a_link_tries_what_shows_in_it_at_every_target():
    seen = frozenset({"path", "timing", "servo", "gear", "mechanics"})
    asked = question_of(SERVO, [trace(noise(500, 1, width=6))], context(examined=seen))
    tried = {(block.effect.name, block.target) for block in asked.blocks}
    assert {("servo_lag", f"A{i}") for i in range(1, 7)} <= tried
    assert not any(name in ("backlash", "stiffness", "base_frame") for name, _ in tried)
    assert asked.upstream == frozenset({"force"})


def test_what_is_not_measured_is_tried_one_link_further():
    seen = frozenset({"path", "timing", "mechanics"})
    tip = trace(noise(500, 2, width=3), "mechanics")
    tried = {block.effect.name for block in question_of(MECHANICS, [tip], context(examined=seen)).blocks}
    assert {"servo_lag", "backlash", "stiffness", "base_frame"} <= tried


def test_an_effect_with_a_frequency_is_tried_at_the_tones_of_the_residual():
    t = motion().time_s
    ringing = np.sin(2.0 * np.pi * 11.0 * t)[:, None] * [1.0, 0.5, 0.0] + noise(500, 3, 0.05, 3)
    tip = trace(ringing, "mechanics")
    blocks = question_of(MECHANICS, [tip], context(examined=frozenset({"mechanics"}))).blocks
    hz = [block.shape["hz"] for block in blocks if block.effect.name == "vibration"]
    assert hz[0] == pytest.approx(11.0, abs=0.2)
    low, high = (getattr(LIBRARY["vibration"].parameter("hz"), end) for end in ("low", "high"))
    assert set(np.round(hz, 6)) == set(np.round(strongest_hz([tip.residual], 0.02, low, high, 4), 6))
