"""What every judgement says: named causes, the shrink, what is reported."""

from dataclasses import replace

import pytest

from gcode2krl.gap.compare.links import SERVO
from gcode2krl.gap.posterior.examination import Size
from gcode2krl.gap.posterior.judgement import NAMED, Cause, Judged
from tests.gap.synthetic import applied

SIZE = Size(100, 4.0, 1.0, 0.25, 0.25, 0.0, 1.0, 1.0, 5.0, 2.0)
(BACKLASH,) = applied("backlash:target=A2,gap_deg=0.02")
(LAG,) = applied("servo_lag:target=A1,tau_s=0.01")


def _cause(effect, probability):
    return Cause(effect, "servo", probability, {}, 0.9, 0.1)


CAUSES = (_cause(BACKLASH, NAMED), _cause(LAG, NAMED - 1e-9))


def _judged(verdict="explained", held_out=True, causes=CAUSES):
    return Judged(link=SERVO, verdict=verdict, causes=causes, size=SIZE, held_out=held_out, factor=1.0)


def test_causes_are_named_from_one_half_on():
    assert NAMED == 0.5
    assert _judged().applied == (BACKLASH,)


def test_the_shrink_is_that_of_held_out_data():
    assert _judged().shrink == pytest.approx(1.0 - (1.0 - 0.25) / (4.0 - 0.25))
    assert _judged(held_out=False).shrink is None
    assert _judged(causes=()).shrink is None


def test_without_a_gap_no_cause_is_reported():
    assert _judged().reported == _judged().causes
    assert _judged("no_gap").reported == ()


def test_a_cause_can_be_taken_back():
    assert [each.applied for each in _judged().without(BACKLASH).causes] == [LAG]


def test_what_is_told_is_the_size_with_the_named_causes_alone():
    assert _judged().told is SIZE
    before = replace(SIZE, after=4.0)
    unnamed = replace(_judged(causes=CAUSES[1:]), size_with_named=before)
    assert unnamed.told is before
    assert unnamed.shrink is None  # a cause without a name takes nothing
