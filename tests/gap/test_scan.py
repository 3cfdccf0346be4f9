"""Scans against the swept surface: the diameter comes back, and nothing else is taken for it."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.compare.links import PART
from gcode2krl.gap.compare.pair import pairs_of
from gcode2krl.gap.compare.trace import Context
from gcode2krl.gap.diagnosis import known_effects
from gcode2krl.gap.posterior.geometry import judge_surface
from gcode2krl.runs.scan import Scan
from tests.gap.synthetic import prediction, refined, runs

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
