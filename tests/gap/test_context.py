"""What is known while links are judged: each step is a new context and leaves the old one as it was."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from gcode2krl.effects import Applied, library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.compare.links import MECHANICS, PATH, SERVO
from gcode2krl.gap.compare.trace import Context
from gcode2krl.gap.components import strongest_hz
from gcode2krl.gap.posterior.examination import question_of
from tests.gap.constructed import Added, applied, motion, noise, pair, stub, trace

LIBRARY = library()


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
