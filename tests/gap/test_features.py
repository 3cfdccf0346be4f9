"""The tests of a cause as numbers: what goes in, how they are rounded, and their names in the JSON object."""

from dataclasses import fields

import numpy as np
import pytest

from gcode2krl.gap.answer.causes import cause_of
from gcode2krl.gap.answer.result import plain
from gcode2krl.gap.posterior.calibrated import NAMES, FamilyFeatures, Features, family_features
from gcode2krl.gap.posterior.judgement import judge
from tests.gap.constructed import LINK, motion, noise, question, trace, wave

COUNT, SIGMA = 500, 1e-4
TIME_S = motion().time_s
EFFECT = wave(2.0)


def run(number, y):
    return trace(SIGMA * y[:, None] + noise(COUNT, number, SIGMA), number=number)


def judged(values, held=(), effects=(EFFECT,)):
    traces = [run(i, y) for i, y in enumerate(values)]
    return judge(
        LINK["servo"], traces, [run(len(traces) + i, y) for i, y in enumerate(held)], question(effects)
    )


def features(values, held=(), effects=(EFFECT,)):
    return judged(values, held, effects).causes[0].features


def test_a_right_cause_has_good_tests():
    found = features([2.0 * EFFECT.form(TIME_S)] * 3)
    assert found.fold_agreement == 1.0
    assert found.shrink_of_rest > 0.95
    assert found.shrink_where_others == 1.0  # nothing is above it
    assert (found.share_left, found.conditions_failed, found.causes) == (0.0, 0, 1)
    assert found.inconstancy < 0.1
    # a sine of 2 sigma has an rms of √2 in values of one sigma
    assert found.size_over_noise == pytest.approx(2.0**0.5, rel=0.25)
    assert found.gap_p < 0.01
    assert found.surprise > 100.0


def test_without_the_effect_on_held_out_runs_they_are_bad():
    found = features([2.0 * EFFECT.form(TIME_S)] * 2, held=[0.0 * TIME_S])
    assert found.shrink_of_rest == 0.0
    assert found.fold_agreement is None  # one choice, made without the held-out run


def test_a_size_that_differs_from_run_to_run_is_inconstant():
    y = EFFECT.form(TIME_S)
    found = features([1.0 * y, 3.0 * y])
    assert found.inconstancy > 0.2
    assert found.constant_p < 1e-3


def test_the_object_names_every_test_and_rounds_to_four_digits():
    judgement = judged([2.0 * EFFECT.form(TIME_S)] * 2)
    tests = plain(cause_of(judgement.causes[0], judgement, "servo"))["tests"]
    assert tuple(tests) == NAMES == tuple(entry.name for entry in fields(Features))
    assert all(value is None or isinstance(value, float) for value in tests.values())
    assert all(value is None or np.isfinite(value) for value in tests.values())
    assert tests["size_over_noise"] == float(f"{judgement.causes[0].features.size_over_noise:.4g}")


def test_the_lead_of_a_family_is_over_the_best_other():
    t = TIME_S
    rest = judged([3.0 * (t > 5.0)]).rest
    first, second = (family_features(rest, each) for each in rest.study.evidences[:2])
    assert first.lead_nats > 0.0 > second.lead_nats
    assert first.lead_nats == pytest.approx(-second.lead_nats)
    assert first.share > 0.9
    assert isinstance(first, FamilyFeatures)
    assert list(first.as_dict()) == ["lead_nats", "share", "p", "of_largest", "larger_links"]
    assert (first.of_largest, first.larger_links) == (1.0, 0)
