"""Causes as the answer states them: units, rivals, the intervals of slips."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from gcode2krl.effects.dependence import Dependence
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.answer.causes import cause_of, slip_cause
from gcode2krl.gap.answer.result import EffectAt, RivalResult, UnknownAt
from gcode2krl.gap.answer.words import alike
from gcode2krl.gap.compare.links import GEAR, PATH
from gcode2krl.gap.compare.slips import Slip
from gcode2krl.gap.posterior.cause_tests import Interval
from gcode2krl.gap.posterior.judgement import Cause
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.synthetic import applied

JUDGEMENT = SimpleNamespace(link=GEAR, factor=10.0)


def _rival(*texts, alike):
    together = applied(*texts)
    return SimpleNamespace(
        applied=together[0],
        companions=together[1:],
        together=together,
        alike=alike,
        behind_nats=1.0 if alike else 20.0,
    )


def _cause(rivals=(), rms_after=0.5):
    (backlash,) = applied("backlash:target=A2,gap_deg=0.02")
    parameters = {"gap_deg": Interval(0.02, 0.01, 0.03)}
    return Cause(backlash, GEAR.name, 0.8, parameters, 0.9, rms_after, tuple(rivals))


def test_a_cause_has_the_unit_of_the_report_and_the_link_it_is_reported_in():
    found = cause_of(_cause(), JUDGEMENT, "timing")
    assert (found.effect, found.target, found.link) == ("backlash", "A2", "timing")
    assert (found.probability, found.shrink, found.rms_after) == (0.8, 0.9, 5.0)
    assert found.parameters == {"gap_deg": Interval(0.02, 0.01, 0.03)}
    assert (found.words, found.rivals) == (None, ())
    assert cause_of(_cause(rms_after=None), JUDGEMENT, "gear").rms_after is None


def test_rivals_are_alike_or_have_a_probability():
    twins = [(_rival(f"mastering:target=A{n},offset_deg=1", alike=True), 0.1) for n in range(1, 7)]
    found = cause_of(_cause([*twins, (_rival("base_frame:x_mm=1", alike=False), 0.2)]), JUDGEMENT, "gear")
    assert found.indistinguishable_from == tuple(EffectAt("mastering", f"A{n}", 1.0) for n in range(1, 6))
    assert len(found.indistinguishable_from) == THRESHOLDS.answer.most_alike
    assert found.rivals == (RivalResult("base_frame", None, 0.2, 20.0),)


def test_what_only_several_do_together_is_told_as_such():
    several = _rival("mastering:target=A2,offset_deg=1", "mastering:target=A3,offset_deg=1", alike=True)
    found = cause_of(
        _cause([(_rival("tool_frame:x_mm=1", alike=True), 0.8), (several, 0.8)]), JUDGEMENT, "gear"
    )
    assert found.indistinguishable_from == (
        EffectAt("mastering", "A2", 1.0, together=True),
        EffectAt("mastering", "A3", 1.0, together=True),
        EffectAt("tool_frame", None, 1.0),
    )
    assert alike(found.indistinguishable_from) == (
        "mastering of A2 and mastering of A3 together or tool frame"
    )


@pytest.mark.parametrize(("behind", "is_open"), [(None, False), (-3.0, True), (1.0, True), (20.0, False)])
def test_an_unknown_of_the_same_kind_is_in_the_set_where_no_form_is_told_from_it(behind, is_open):
    family = SimpleNamespace(place=SimpleNamespace(name="A2"), on=Dependence.REVERSALS)
    tests = SimpleNamespace(family=family, family_behind=behind, form_ratio=1.0)
    told = cause_of(
        replace(_cause([(_rival("base_frame:x_mm=1", alike=True), 0.1)]), tests=tests), JUDGEMENT, "gear"
    )
    unknown = [UnknownAt("A2", "reversals")] if is_open else []
    assert list(told.indistinguishable_from) == [EffectAt("base_frame", None, 1.0), *unknown]


def _slip(text, before=1.0, after=0.1, **more):
    return Slip(applied(text)[0], PATH, before, after, "deg", "what shows it", **more)


def test_a_slip_is_as_sure_of_its_numbers_as_it_explains_the_gap():
    found = slip_cause(_slip("override:percent=50", 2.0, 0.1, alike=(("clock", None),)))
    assert found.parameters["percent"] == pytest.approx((50.0, 47.5, 52.5))
    assert (found.link, found.words, found.shrink, found.rivals) == ("path", "what shows it", None, None)
    assert found.indistinguishable_from == (EffectAt("clock", None),)
    assert found.is_named


def test_times_are_known_to_the_mismatch_of_clocks_at_best():
    found = slip_cause(_slip("clock:target=controller,offset_s=2", 1.0, 0.0))
    offset = found.parameters["offset_s"]
    assert offset.high - offset.value == pytest.approx(Mismatch.clock_s)


def test_a_slip_that_ends_the_comparison_has_no_numbers():
    found = slip_cause(_slip("other_program:", 0.0, None, final=True))
    assert (found.parameters, found.rms_after) == ({}, None)
    assert slip_cause(_slip("override:percent=50", 0.0, 0.0)).parameters["percent"] == (50.0, 50.0, 50.0)
