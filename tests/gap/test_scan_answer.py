"""What a scan adds to the answer of the other links."""

from dataclasses import replace

import pytest

from gcode2krl.gap.choose.intervals import Interval
from gcode2krl.gap.choose.surface import SurfaceFinding
from gcode2krl.gap.tell.result import (
    CauseResult,
    Gap,
    GapSize,
    NotExamined,
    SignalResult,
    Unexplained,
    Where,
)
from gcode2krl.gap.tell.scan_answer import with_scan
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.synthetic import LIBRARY, applied

LEAST = THRESHOLDS.tell.scan_least_shrink
GAP = Gap(
    verdict="no_gap",
    gap=GapSize(signal="tcp", unit="mm", rms_before=0.02),
    links=(),
    where=Where(signals=(SignalResult(signal="tcp", rms=0.02, noise=0.02, significant=False),)),
    causes=(),
    unexplained=Unexplained(rms=0.02, significant=False, structure="white"),
    not_examined=(NotExamined(link="force", needs="force.csv"), NotExamined(link="part", needs="scan.csv")),
)


def _finding(shrink, is_gap=True):
    cause = applied("tool_diameter:offset_mm=0.2")[0]
    return SurfaceFinding(
        effect=LIBRARY["tool_diameter"], points=500, rms_before=0.1, rms_after=0.01, noise=0.01,
        offset=Interval(0.2, 0.18, 0.22), shrink=shrink, applied=cause if is_gap else None,
    )  # fmt: skip


def test_without_a_scan_nothing_changes():
    assert with_scan(GAP, None) is GAP


def test_a_diameter_that_explains_the_scan_is_named():
    gap = with_scan(GAP, _finding(LEAST))
    assert gap.verdict == "explained"
    assert (gap.gap.signal, gap.gap.rms_before, gap.gap.held_out) == ("scan", 0.1, True)
    assert [(link.link, link.verdict) for link in gap.links] == [("part", "explained")]
    (cause,) = gap.named_causes
    assert (cause.effect, cause.link, cause.parameters) == (
        "tool_diameter", "part", {"offset_mm": Interval(0.2, 0.18, 0.22)}
    )  # fmt: skip
    assert [one.effect.name for one in gap.named] == ["tool_diameter"]
    assert [each.link for each in gap.not_examined] == ["force"]
    assert [(each.signal, each.significant) for each in gap.where.signals] == [("tcp", False), ("scan", True)]


def test_one_that_takes_less_is_listed_and_not_named():
    gap = with_scan(GAP, _finding(LEAST - 1e-6))
    assert (gap.verdict, gap.gap, gap.named, gap.named_causes) == ("no_gap", GAP.gap, (), ())
    assert [cause.effect for cause in gap.causes] == ["tool_diameter"]


def test_a_scan_within_mismatch_is_no_gap():
    gap = with_scan(GAP, _finding(0.9, is_gap=False))
    assert (gap.verdict, gap.causes) == ("no_gap", ())
    assert gap.links[0].verdict == "no_gap"


def test_what_the_force_has_named_is_not_named_twice():
    known = CauseResult(
        effect="tool_diameter", target=None, link="force", probability=0.9, parameters={}, shrink=0.9,
        rms_after=1.0,
    )  # fmt: skip
    gap = with_scan(replace(GAP, verdict="explained", causes=(known,)), _finding(0.9))
    assert gap.causes == (known,)
    assert gap.named == ()


@pytest.mark.parametrize(
    ("before", "after"),
    [("no_gap", "explained"), ("unexplained", "partly_explained"), ("explained", "explained")],
)
def test_a_named_diameter_explains_a_part(before, after):
    assert with_scan(replace(GAP, verdict=before), _finding(0.9)).verdict == after
