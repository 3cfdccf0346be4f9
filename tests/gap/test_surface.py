"""What a scan adds to the answer of the other links, and when its cause is named."""

from types import SimpleNamespace

import pytest

from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.answer.assembly import answer
from gcode2krl.gap.compare.links import MECHANICS, PART
from gcode2krl.gap.compare.trace import Context
from gcode2krl.gap.posterior import geometry
from gcode2krl.gap.posterior.cause_tests import Interval
from gcode2krl.gap.posterior.examination import Size
from gcode2krl.gap.posterior.judgement import Judged
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.synthetic import LIBRARY, applied

LEAST = THRESHOLDS.posterior.scan_least_shrink
(LARGER,) = applied("tool_diameter:offset_mm=0.2")


def _context(*judgements):
    return Context((), 1, LIBRARY, Mismatch(), judgements=judgements)


def _judged(shrink, is_gap=True, *earlier):
    found = geometry._Finding(LARGER, Interval(0.2, 0.18, 0.22), is_gap, 500, 0.01, 1e-4, shrink)
    return geometry._judgement(PART, found, _context(*earlier))


def _earlier(verdict, named=()):
    """Return the judgement of a link before the part."""
    size = Size(100, 4.0, 1.0, 0.25, 0.25, 0.0, 1.0, 1.0, 5.0, 2.0)
    judged = Judged(link=MECHANICS, verdict=verdict, causes=(), size=size, held_out=True, factor=1.0)
    if named:
        causes = tuple(SimpleNamespace(applied=each, probability=0.9) for each in named)
        object.__setattr__(judged, "causes", causes)
    return judged


def test_a_diameter_that_explains_the_scan_is_named():
    gap = answer(_context(_judged(LEAST)), [], [])
    assert gap.verdict == "explained"
    assert (gap.gap.signal, gap.gap.rms_before, gap.gap.held_out) == ("scan", 0.1, True)
    assert gap.as_dict()["gap"]["max_before"] is None
    assert [(link.link, link.verdict) for link in gap.links] == [("part", "explained")]
    (cause,) = gap.named_causes
    assert (cause.effect, cause.link, cause.shrink) == ("tool_diameter", "part", LEAST)
    assert cause.parameters == {"offset_mm": Interval(0.2, 0.18, 0.22)}
    assert gap.named == (LARGER,)
    assert "part" not in [each.link for each in gap.not_examined]
    assert [(each.signal, each.significant) for each in gap.where.signals] == [("scan", True)]


def test_one_that_takes_less_is_listed_and_not_named():
    gap = answer(_context(_judged(LEAST - 1e-6)), [], [])
    assert (gap.verdict, gap.named, gap.named_causes) == ("no_gap", (), ())
    assert [cause.effect for cause in gap.causes] == ["tool_diameter"]


def test_a_scan_within_mismatch_is_no_gap():
    gap = answer(_context(_judged(0.9, is_gap=False)), [], [])
    assert (gap.verdict, gap.causes) == ("no_gap", ())
    assert gap.links[0].verdict == "no_gap"


def test_what_the_force_has_named_is_not_named_twice():
    assert _judged(0.9, True, _earlier("explained", (LARGER,))).causes == ()


@pytest.mark.parametrize(
    ("before", "after"),
    [("no_gap", "explained"), ("unexplained", "partly_explained"), ("explained", "explained")],
)
def test_a_named_diameter_explains_a_part(before, after):
    gap = answer(_context(_earlier(before), _judged(0.9)), [], [])
    assert gap.verdict == after
