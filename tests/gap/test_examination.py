"""What a selection has accepted: causes beside mismatch, what is left without one, where an effect acts."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap.posterior.examination import Examination
from tests.gap.constructed import STEP_S, Added, examined, noise, trace

SIGMA, COUNT = 1e-4, 400
TIME_S = STEP_S * np.arange(COUNT)
HALF = TIME_S[-1] / 2.0
EARLY = Added("early", lambda t: np.where(t < HALF, np.sin(20.0 * t), 0.0))
LATE = Added("late", lambda t: np.where(t >= HALF, np.cos(20.0 * t), 0.0))


@pytest.fixture(scope="module")
def made() -> Examination:
    y = SIGMA * (3.0 * EARLY.form(TIME_S) + 2.0 * LATE.form(TIME_S))
    return examined([trace(y[:, None] + noise(COUNT, 3, SIGMA))], [EARLY, LATE], SIGMA)


def test_accepted_effects_are_causes_unless_they_are_mismatch(made):
    assert [each.effect.name for each in made.causes] == ["early", "late"]
    usual = replace(made, usual=(True, False))
    assert [each.effect.name for each in usual.causes] == ["late"]
    assert [each.effect.name for each in usual.mismatch] == ["early"]
    assert usual.cause_numbers == (1,)
    assert usual.applied == made.applied


def test_an_effect_changes_its_rows_only(made):
    first, second = made.rows_changed(0), made.rows_changed(1)
    assert not (first & second).any()
    assert first[: COUNT // 2].mean() > 0.9
    assert second[COUNT // 2 + 1 :].mean() > 0.9


def test_dropping_and_rejecting_leave_the_examination_as_it_is(made):
    fewer = made.dropping(0, replace(made.fitted, applied=made.without(0)))
    assert [each.effect.name for each in fewer.applied] == ["late"]
    assert fewer.surprises == made.surprises[1:]
    assert made.rejecting(("early", "A1")).rejected == {("early", "A1")}
    assert (len(made.applied), made.rejected) == (2, frozenset())
    assert made.accepted_keys == {("early", "A1"), ("late", "A1")}


def test_it_counts_values_and_times(made):
    assert (made.data.values, made.data.times) == (COUNT, COUNT)
