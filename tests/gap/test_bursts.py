"""Bursts and outliers are told from what effects, jumps, vibration or louder cutting do."""

import numpy as np
import pytest

from gcode2krl.gap.compare.events import loud_rows
from tests.gap.constructed import noise

COUNT = 1500
TIME_S = 0.01 * np.arange(COUNT)
WHOLE = np.array([[0, COUNT]], dtype=np.int64)


def loud(values):
    return loud_rows(TIME_S, values.reshape(COUNT, -1), WHOLE)


def test_a_burst_goes_and_little_besides():
    y = noise(COUNT, 1)[:, 0]
    inside = (TIME_S >= 6.0) & (TIME_S < 6.3)
    y[inside] *= 7.0
    found = loud(y)
    assert found[inside].mean() > 0.95
    assert found[~inside].sum() < 25


def test_white_noise_has_no_bursts():
    assert sum(loud(noise(COUNT, seed)[:, 0]).sum() for seed in range(50)) < 100


@pytest.mark.parametrize("size", [30.0, 200.0])
def test_outliers_go_and_jumps_stay(size):
    y = noise(COUNT, 2)[:, 0]
    y[[200, 900]] += size
    assert np.flatnonzero(loud(y)).tolist() == [200, 900]
    jumped = noise(COUNT, 2)[:, 0] + size * (TIME_S > 7.0)
    assert not loud(jumped).any()


def test_what_effects_do_stays():
    """Spikes that decay after a reversal, and ten damped swings of 12 Hz, at ten times the noise."""
    after = np.mod(TIME_S, 3.0)
    spikes = 10.0 * np.exp(-after / 0.05)
    swings = 10.0 * np.exp(-after / 0.15) * np.sin(2.0 * np.pi * 12.0 * after) * (TIME_S > 12.0)
    for form in (spikes, swings):
        assert loud(noise(COUNT, 3)[:, 0] + form).sum() < 10


def test_what_is_loud_for_long_stays():
    """A cut that takes a third of the run is no burst, and neither is what all of a run is like."""
    y = noise(COUNT, 4)[:, 0]
    y[500:1000] *= 6.0
    assert not loud(y).any()


def test_where_the_model_jumps_nothing_is_left_out():
    """A tool that enters the material: what is left beside the jumps of the model is the model's."""
    y, edges = noise(COUNT, 7)[:, 0], 20.0 * (np.mod(TIME_S, 0.04) > 0.02) * (np.abs(TIME_S - 7.0) < 0.1)
    y += 0.5 * edges
    assert loud(y).sum() > 10
    model = edges.reshape(COUNT, -1)
    assert not loud_rows(TIME_S, y.reshape(COUNT, -1), WHOLE, model)[np.abs(TIME_S - 7.0) < 0.15].any()
