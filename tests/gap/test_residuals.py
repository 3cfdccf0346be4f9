"""Residuals of a judged link: before and after its named causes, and of what the gap is made."""

import numpy as np
import pytest

from gcode2krl.gap.answer.evidence import residuals_of, smoothed
from gcode2krl.gap.compare.interpolation import rms_length
from gcode2krl.gap.posterior.judgement import judge
from tests.gap.constructed import LINK, motion, noise, question, trace, wave

SIGMA = 1e-4
TIME_S = motion().time_s
EFFECT = wave(2.0)
SINE = EFFECT.form(TIME_S)
STEPS = np.repeat([1.0, -1.0, -1.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0], 50)


def judged(y, held=1):
    runs = [trace(SIGMA * y[:, None] + noise(500, number, SIGMA), number=number) for number in range(3)]
    return judge(LINK["servo"], runs[: 3 - held], runs[3 - held :], question([EFFECT]))


def test_a_named_cause_is_the_shape_of_the_gap_in_every_run_and_gone_after_it():
    residuals = residuals_of(judged(3.0 * SINE))
    assert [each.trace.run for each in residuals] == ["run-1", "run-2", "run-3"]
    for each in residuals:
        np.testing.assert_allclose(each.shape[:, 0], 3.0 * SIGMA * SINE, atol=0.3 * SIGMA)
        np.testing.assert_allclose(each.before - each.after, each.shape, atol=1e-15)
        assert np.std(each.after) == pytest.approx(SIGMA, rel=0.15)
        assert each.noise == pytest.approx([SIGMA], rel=0.15)


def test_without_a_named_cause_nothing_is_gone_and_the_shape_is_the_smoothed_rest():
    found = judged(4.0 * STEPS)
    assert found.applied == ()
    for each in residuals_of(found):
        np.testing.assert_array_equal(each.before, each.after)
        within = np.abs(np.diff(STEPS, prepend=0.0, append=0.0))
        far = np.convolve(within, np.ones(17), mode="same")[:500] == 0.0
        np.testing.assert_allclose(each.shape[far, 0], 4.0 * SIGMA * STEPS[far], atol=2.0 * SIGMA)
        assert np.std(each.shape[far, 0] - 4.0 * SIGMA * STEPS[far]) < 0.4 * SIGMA  # 15 samples


def test_the_mean_over_a_tenth_of_a_second():
    time_s = 0.01 * np.arange(100)
    values = np.zeros((100, 2))
    values[50] = (1.0, -2.0)
    mean = smoothed(time_s, values)
    assert mean.sum(axis=0) == pytest.approx([1.0, -2.0])
    assert np.count_nonzero(mean[:, 0]) == 10
    np.testing.assert_allclose(smoothed(time_s, np.ones(100)), 1.0)  # to the ends
    np.testing.assert_allclose(smoothed(0.5 * np.arange(3), np.arange(3.0)), np.arange(3.0))


def test_the_rms_length_of_rows():
    assert rms_length([np.array([[3.0, 4.0]]), np.zeros((3, 2))]) == pytest.approx(2.5)
