"""Pairs are truly confounded: what one answer does to the data another does too."""

import numpy as np
import pytest

from tests.plant import faults, instruments, kinds, truth
from tests.plant.confounded import PAIRS
from tests.plant.effects import LIBRARY
from tests.plant.plans import Plan


def change(plan: Plan, fault: faults.Fault, size: float, signal: str) -> np.ndarray:
    """What an effect changes in a signal over all runs, (n, 3)."""
    out = []
    for day in plan.days:
        acted, bare = plan.drive(day, [fault.hooks(size)]), plan.drive(day, [])
        tables = (instruments.clean(run, plan.how) for run in (acted, bare))
        out.append(truth.differences(*tables)[signal][1])
    return np.concatenate(out)


def framed(plan: Plan) -> np.ndarray:
    """Columns of a small shift and turn of all places, (n, 3, 6)."""
    place = []
    for day in plan.days:
        table = instruments.clean(plan.drive(day, []), plan.how)["tracker"]
        place.append(np.stack([table[f"{a}_mm"] for a in "xyz"], axis=1))
    p = np.concatenate(place)
    shifts = np.broadcast_to(np.eye(3), (len(p), 3, 3))
    turns = np.stack([np.cross(e, p) for e in np.eye(3)], axis=2)
    return np.concatenate([shifts, turns], axis=2)


def left_over(truly: np.ndarray, columns: np.ndarray) -> float:
    """Share of the RMS that the best combination of columns leaves."""
    a, b = columns.reshape(truly.size, -1), truly.ravel()
    scaled = a / np.abs(a).max(axis=0)
    rest = b - scaled @ np.linalg.lstsq(scaled, b, rcond=None)[0]
    return float(np.linalg.norm(rest) / np.linalg.norm(b))


FRAMED = [name for name, pair in PAIRS.items() if ("base_frame", None) in pair.answers]


@pytest.mark.parametrize("name", FRAMED)
def test_a_moved_base_does_the_same(name):
    plan, _ = kinds.plan_of("confounded", 3, name)
    size = np.sqrt(np.prod(plan.faults[0].kind.sizes))
    assert left_over(change(plan, plan.faults[0], size, "tcp"), framed(plan)) < 0.03


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("arm_or_linked_arm", "stiffness@linked_arm"),
        ("linked_arm_or_arm", "stiffness@arm"),
    ],
)
def test_another_spring_does_nearly_the_same(name, other):
    plan, _ = kinds.plan_of("confounded", 3, name)
    size = 0.3
    truly = change(plan, plan.faults[0], size, "tcp")
    mimic = change(plan, faults.build(other, "same", 1), size, "tcp")
    assert left_over(truly, mimic[:, :, None]) < 0.2


def test_a_weight_is_a_constant_force_at_one_orientation():
    plan, _ = kinds.plan_of("confounded", 3, "weight_or_offset")
    force = change(plan, plan.faults[0], 50.0, "force")
    assert left_over(force, np.broadcast_to(np.eye(3), (len(force), 3, 3))) < 1e-4  # play turns it


def test_a_creeping_tracker_is_the_beginning_of_a_warming():
    plan, _ = kinds.plan_of("confounded", 3, "thermal_or_tracker_drift")
    creep = change(plan, plan.faults[0], 0.3, "tcp")
    hours = np.linalg.norm(creep, axis=1) / 0.3
    warming = -np.expm1(-hours / 3.5)[:, None] * np.array(plan.faults[0].values(0.3)["direction"])
    assert left_over(creep, warming[:, :, None]) < 0.2


def test_answers_are_effects():
    for pair in PAIRS.values():
        assert pair.effect.partition("@")[0] in LIBRARY
        assert all(name in LIBRARY for name, _ in pair.answers)
