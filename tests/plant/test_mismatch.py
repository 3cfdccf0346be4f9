"""Laws of the normal mismatch: bounds, shapes, joints that err together."""

import numpy as np
import pytest

from tests.plant import kinds, mismatch
from tests.plant.mismatch import BOUNDS, SHAPES, Law


def many(law: Law, count: int = 4000, n: int = 6) -> np.ndarray:
    rng = np.random.default_rng(2)
    return np.array([law.shares(rng, n) for _ in range(count)])


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_shares_keep_their_bounds_and_are_not_even(shape, scale):
    x = many(Law(shape, scale, 0.5)) / scale
    assert np.abs(x).max() <= 1.0
    counts = np.histogram(x, 5, (-1.0, 1.0))[0] / x.size
    assert np.abs(counts - 0.2).max() > 0.08
    if shape == "bimodal":
        assert counts[1:4].sum() == 0.0
    if shape == "beta":
        assert x.mean() == pytest.approx(2.0 * 2.0 / 7.0 - 1.0, abs=0.03)
    if shape == "clipped_normal":
        assert np.mean(np.abs(x) < 0.5) == pytest.approx(0.683, abs=0.02)


def test_joints_err_together():
    loose, tight = many(Law("clipped_normal", 1.0, 0.0)), many(Law("clipped_normal", 1.0, 0.8))
    assert np.corrcoef(loose.T)[0, 1] == pytest.approx(0.0, abs=0.05)
    assert np.corrcoef(tight.T)[0, 1] == pytest.approx(0.8, abs=0.05)


def test_a_robot_and_a_day_keep_the_scaled_bounds_and_use_them():
    wide = 0.0
    for seed in range(40):
        plan, _ = kinds.plan_of("null_foreign_mismatch", seed)
        law, robot = plan.options.law, plan.robot
        assert law.shape in SHAPES
        assert np.abs(robot.stiffness - 1.0).max() <= law.scale * BOUNDS["stiffness"] + 1e-12
        assert 0.0 <= robot.play_deg.min() <= robot.play_deg.max() <= law.scale * BOUNDS["play_deg"] + 1e-12
        for day in plan.days:
            assert np.linalg.norm(day.mismatch.shift_mm) <= law.scale * BOUNDS["shift_mm"] * (1 + 1e-12)
            assert (
                max(abs(v) for v in day.mismatch.clocks_s.values()) <= law.scale * BOUNDS["clock_s"] + 1e-12
            )
        wide = max(wide, np.abs(robot.stiffness - 1.0).max() / BOUNDS["stiffness"])
    assert wide > 1.5


def test_the_usual_law_is_even():
    x = many(mismatch.USUAL)
    assert np.abs(np.histogram(x, 5, (-1.0, 1.0))[0] / x.size - 0.2).max() < 0.01
