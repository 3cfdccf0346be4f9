"""Hum of the mains goes, folded or not; a tone beside the mains, and that of a spindle, stays."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap.compare.events import without_hum
from tests.gap.constructed import motion, noise, trace

COUNT, STEP_S = 5000, 0.004
TIME_S = STEP_S * np.arange(COUNT)


def left_of(hz, size=1.0, spindle_hz=0.0, step_s=STEP_S):
    """Return the amplitude of a tone that is left in white noise of unit variance."""
    inputs = motion(COUNT * step_s, step_s)
    inputs = replace(inputs, spindle_rad_s=np.full(COUNT, 2.0 * np.pi * spindle_hz))
    tone = np.sin(2.0 * np.pi * hz * inputs.time_s + 0.7)
    made = trace(noise(COUNT, 3) + size * tone[:, None], inputs=inputs)
    (found,) = without_hum([made])
    rest = (found.measured - made.nominal)[:, 0]
    wave = np.exp(-2j * np.pi * hz * inputs.time_s)
    return 2.0 * abs(wave @ rest) / COUNT


@pytest.mark.parametrize("hz", [50.0, 50.02, 149.95, 60.0, 180.05])
def test_hum_goes(hz):
    assert left_of(hz) < 0.1


def test_hum_that_is_folded_by_slow_sampling_goes():
    """50 Hz at 12 ms shows at 33.3 Hz."""
    assert left_of(50.01, step_s=0.012) < 0.1


@pytest.mark.parametrize("hz", [47.0, 51.5, 33.0])
def test_a_tone_beside_the_mains_stays(hz):
    assert left_of(hz) == pytest.approx(1.0, abs=0.1)


def test_what_turns_with_the_spindle_stays():
    """3000 a minute is 50 Hz: a runout, not hum."""
    assert left_of(50.0, spindle_hz=50.0) == pytest.approx(1.0, abs=0.1)


def test_noise_alone_stays_as_it_is():
    made = [trace(noise(COUNT, seed), inputs=motion(COUNT * STEP_S, STEP_S)) for seed in range(20)]
    assert sum(found is not one for found, one in zip(without_hum(made), made, strict=True)) <= 1


def test_what_went_is_told():
    tone = np.sin(2.0 * np.pi * 50.0 * TIME_S)[:, None]
    (found,) = without_hum([trace(noise(COUNT, 3) + tone, inputs=motion(COUNT * STEP_S, STEP_S))])
    assert found.left_out == ("hum of the mains at 50 Hz",)
