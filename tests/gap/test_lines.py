"""Tones are taken off noise, and nothing is where there is no tone."""

import numpy as np
import pytest

from gcode2krl.gap.noise.short import Noise, drawn_noise, without_lines

COUNT = 1500


def white(seed):
    return np.random.default_rng(seed).standard_normal(COUNT)


@pytest.mark.parametrize("turns", [0.0523, 0.08317, 0.21])
@pytest.mark.parametrize("rms", [0.5, 5.0])
def test_a_tone_is_taken_off_and_the_noise_is_left(turns, rms):
    e = white(1)
    tone = rms * np.sqrt(2.0) * np.sin(2.0 * np.pi * turns * np.arange(COUNT) + 0.4)
    left = without_lines(e + tone)
    assert np.std(left - e) < 0.1
    assert left.std() == pytest.approx(e.std(), rel=0.02)


def test_several_tones_go_one_after_the_other():
    n = np.arange(COUNT)
    tones = 3.0 * np.sin(0.3 * n) + 1.0 * np.sin(1.1 * n) + 0.5 * np.sin(0.72 * n)
    assert np.std(without_lines(white(2) + tones) - white(2)) < 0.15


def test_noise_without_a_tone_is_hardly_ever_touched():
    coloured = Noise(np.array([0.7, 0.1, -0.1]), 1.0, 1.0)
    for kind in (white, lambda seed: drawn_noise(coloured, COUNT, np.random.default_rng(seed))):
        touched = sum(not np.array_equal(without_lines(kind(seed)), kind(seed)) for seed in range(200))
        assert touched <= 2


def test_a_short_signal_stays_as_it_is():
    x = np.sin(np.arange(100.0))
    np.testing.assert_array_equal(without_lines(x), x)
