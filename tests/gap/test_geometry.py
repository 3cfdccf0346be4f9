"""Scans of the part: the diameter comes back, nothing else is taken for it, and what it adds to an answer."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.answer.assembly import answer
from gcode2krl.gap.compare.links import MECHANICS, PART
from gcode2krl.gap.compare.pair import pairs_of
from gcode2krl.gap.compare.trace import Context
from gcode2krl.gap.diagnosis import known_effects
from gcode2krl.gap.posterior import geometry
from gcode2krl.gap.posterior.cause_tests import Interval
from gcode2krl.gap.posterior.examination import Size
from gcode2krl.gap.posterior.geometry import judge_surface
from gcode2krl.gap.posterior.judgement import Judged
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs.scan import Scan
from tests.gap.synthetic import LIBRARY, applied, prediction, refined, runs

# Scans against the swept surface: the diameter comes back, and nothing else is taken for it


SHIFT_MM = np.array([0.03, -0.02, 0.15])


def _side(larger_mm: float = 0.0, noise_mm: float = 0.03, seed: int = 1):
    """Return a run whose scan is that of walls and floors of the nominal motion with another diameter."""
    generator = np.random.default_rng(seed)
    some = runs([], 1, 5, controller=False, tracker=False, normal=False)
    (pair,) = pairs_of(refined(), some)
    inputs = pair.inputs
    tip = inputs.position_mm + inputs.deflection_mm
    radius = prediction().cell.tool[1].diameter_mm / 2.0 + larger_mm / 2.0
    feed = np.gradient(tip, axis=0)
    level = inputs.force_base_N.any(axis=1) & (np.hypot(feed[:, 0], feed[:, 1]) > 1e-3)
    # two straight slots of the part: 80 mm apart, so that no pass takes the walls of the other
    rows = np.flatnonzero(level & (np.abs(feed[:, 1]) < 1e-3) & (tip[:, 2] < -3.5))[::6]
    left = np.stack([-feed[rows, 1], feed[rows, 0], 0.0 * rows], axis=1)
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    up = np.array([0.0, 0.0, 1.0])
    points = [
        tip[rows] + way * radius * left + generator.uniform(1.0, 2.5, (len(rows), 1)) * up for way in (-1, 1)
    ]
    cloud = np.concatenate([tip[rows], *points]) + SHIFT_MM
    cloud = cloud + generator.normal(0.0, noise_mm, cloud.shape)
    return replace(pair, run=replace(pair.run, scan=Scan(cloud)))


@pytest.mark.parametrize("larger_mm", [0.12, -0.2])
def test_a_diameter_comes_back(larger_mm):
    found = judge_surface(PART, Context((_side(larger_mm),), 1, known_effects([]), Mismatch()))
    assert found is not None
    (cause,) = found.causes
    offset = cause.parameters["offset_mm"]
    assert offset.value == pytest.approx(larger_mm, abs=0.015)
    assert offset.low < larger_mm < offset.high
    assert found.applied == (cause.applied,)
    assert found.shrink > 0.9
    assert found.size.after < found.size.before


@pytest.mark.parametrize("seed", range(4))
def test_a_right_cutter_is_no_finding(seed):
    found = judge_surface(PART, Context((_side(seed=seed),), 1, known_effects([]), Mismatch()))
    assert found is not None
    assert (found.verdict, found.causes, found.applied) == ("no_gap", (), ())


def test_without_scan_or_library_nothing_is_said():
    pair = _side()
    bare = replace(pair, run=replace(pair.run, scan=None))
    assert judge_surface(PART, Context((bare,), 1, known_effects([]), Mismatch())) is None
    assert judge_surface(PART, Context((pair,), 1, {}, Mismatch())) is None


# What a scan adds to the answer of the other links, and when its cause is named


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
