"""Of one signal one family is the right one: probabilities of all of them add up to no more than one."""

import numpy as np
import pytest

from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.posterior.calibrated import family_probabilities, probabilities_table
from gcode2krl.gap.posterior.judgement import judge
from gcode2krl.gap.thresholds import declared_nats
from tests.gap import constructed as c

SIGMA = 1e-4
TIME_S = c.motion().time_s


def told(forms, larger_links=0):
    """Return the families of what is left of A1, A2 … with these forms (n,), in sigmas."""
    values = np.stack(forms, axis=1)
    traces = [
        c.trace(
            SIGMA * values + c.noise(500, n, SIGMA, values.shape[1]),
            number=n,
            declared_sigma=SIGMA,
        )
        for n in range(2)
    ]
    found = judge(c.LINK["servo"], traces, [], c.question([]))
    return family_probabilities(found.rest, larger_links)


STEP = 3.0 * (TIME_S > 6.2)
"""In each run."""
SINCE_START = "time since the run's start"


def test_the_best_is_first_and_calibrated():
    first, *others = told([STEP])
    assert first.probability == probabilities_table().dependence(first.features)
    assert all(each.probability <= first.probability for each in others)
    assert sum(each.probability for each in (first, *others)) <= 1.0


def test_each_signal_has_a_right_one_of_its_own():
    found = told([STEP, 2.0 * np.sin(2.0 * np.pi * 5.3 * TIME_S)])
    of_joint = {name: [each for each in found if each.evidence.place.name == name] for name in ("A1", "A2")}
    assert [of_joint[name][0].evidence.on.value for name in ("A1", "A2")] == [SINCE_START, "tone"]
    for each in of_joint.values():
        assert each[0].features.lead_nats > 0.0
        assert all(other.features.lead_nats <= 0.0 for other in each[1:])


def test_what_a_larger_gap_may_leave_here_is_less_certain():
    alone, behind = (told([STEP], larger)[0].probability for larger in (0, 2))
    assert behind <= alone


def test_a_signal_with_little_of_the_gap_is_less_certain():
    found = told([20.0 * STEP, 0.4 * STEP])
    loud, quiet = (next(each for each in found if each.evidence.place.name == at) for at in ("A1", "A2"))
    assert quiet.features.of_largest == pytest.approx(quiet.evidence.nats / loud.evidence.nats, rel=1e-6)
    assert quiet.probability < loud.probability


def test_a_place_is_at_least_as_probable_as_its_families_and_excludes_other_places():
    found = told([STEP, 2.0 * np.sin(2.0 * np.pi * 5.3 * TIME_S)])
    for name in ("A1", "A2"):
        there = [each for each in found if each.evidence.place.name == name]
        assert len({each.place_probability for each in there}) == 1
        assert there[0].place_probability >= min(sum(each.probability for each in there), 0.98)
        assert there[0].place_probability > there[0].probability


def test_what_the_data_do_not_tell_apart_is_a_set():
    """A weak drift of both runs may be one of each."""
    first, *others = told([0.3 * np.tanh((TIME_S - 6.0) / 3.0)])
    assert [each.told for each in first.alike] == [("A1", Dependence.RUN_TIME)]
    assert first.set_probability > first.probability
    assert all(each.set_probability == 0.0 for each in others)
    assert len({each.told for each in (first.evidence, *first.alike)}) == 1 + len(first.alike)
    for each in first.alike:
        assert first.evidence.nats - each.nats < declared_nats() * first.evidence.inflation


def test_a_step_and_a_drift_are_told_as_one_input():
    of_time = [each for each in told([STEP]) if each.evidence.told == ("A1", Dependence.RUN_TIME)]
    assert {each.evidence.on for each in of_time} == {Dependence.RUN_TIME, Dependence.RUN_TIME_STEP}
