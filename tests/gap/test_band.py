"""The power in a band of a spectrum is that of sums over values at any times, wave by wave."""

import numpy as np
import pytest

from gcode2krl.gap.compare.interpolation import Bands


@pytest.mark.parametrize("count", [1, 2, 7, 40, 101])
@pytest.mark.parametrize("first_hz", [0.0, 49.7])
def test_sums_are_those_of_each_wave(count, first_hz):
    generator = np.random.default_rng(1)
    time_s = np.sort(generator.uniform(0.0, 20.0, 300))
    values = generator.normal(size=(300, 3))
    bands = Bands(time_s, 0.013, count)
    waves = np.exp(-2j * np.pi * bands.hz(first_hz)[:, None] * time_s)
    assert bands.power(first_hz, values) == pytest.approx(np.abs(waves @ values) ** 2, rel=1e-9)


def test_frequencies_are_evenly_spaced():
    assert Bands(np.zeros(1), 0.1, 3).hz(50.0) == pytest.approx([50.0, 50.1, 50.2])
